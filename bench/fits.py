"""How fast the fits are, against peers and against the floor; each row in one run, medians of several.

.venv/bin/python bench/fits.py
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parent))

import lmfit
from coverage_fits import drawn
from scipy.integrate import odeint, solve_ivp
from scipy.optimize import least_squares

from analysis.conditions import Impact
from analysis.events import locate
from analysis.findings import Answer
from analysis.fit import fit_window
from analysis.fit_answer import to_json
from analysis.fit_intervals import parameters
from analysis.fit_problem import DAMPER, FLOW, LN_E, T0, Problem, kernel
from analysis.fit_start import start_of
from analysis.fit_window import POINTS, Window, window_of
from analysis.kinematics import passed
from analysis.levenberg import minimise
from analysis.restitution import speed_at_contact
from analysis.speed import Speed

M, R, NU, D, RING, G, V0 = 0.503, 6.35e-3, 0.33, 4.6e-3, 30e-3, 9.80665, 2.0
TRUE = (3.3e9, 7000.0, 8.0)
IMPACT = Impact(M, R, D, NU, "ring", RING, v0=V0)
N = 5000
X = np.array([np.log(TRUE[0]), 1 / TRUE[1], TRUE[2], V0, 0.0, 0.0])


def stiffness(E: float) -> tuple[float, float]:
    """K_i, K_d."""
    return 4 / 3 * np.sqrt(R) * E / (1 - NU**2), 4 * np.pi / 3 * D**3 / ((1 - NU) * (3 + NU) * RING**2) * E


def rates(y: Any, K_i: float, K_d: float, C_i: float, C_d: float) -> list[float]:
    """PHYSICS.md's state form: v, α, α₁, α₃."""
    v, _, a1, a3 = y
    F = K_i * max(a1, 0.0) ** 1.5
    a3_rate = (F - K_d * a3) / C_d
    return [G - F / M, v, v - F / C_i - a3_rate, a3_rate]


def by_odeint(p: tuple[float, float, float], t: Any) -> Any:
    """Force at the times."""
    K_i, K_d = stiffness(p[0])
    y = odeint(lambda y, _: rates(y, K_i, K_d, p[1], p[2]), [V0, 0, 0, 0], t, rtol=1e-8, atol=1e-12)
    return K_i * np.maximum(y[:, 2], 0) ** 1.5


def by_ivp(p: tuple[float, float, float], t: Any) -> Any:
    """The same by solve_ivp's LSODA."""
    K_i, K_d = stiffness(p[0])
    run = solve_ivp(lambda _, y: rates(y, K_i, K_d, p[1], p[2]), (0, t[-1]), [V0, 0, 0, 0], "LSODA", t, rtol=1e-8,
                    atol=1e-12)  # fmt: skip
    return K_i * np.maximum(run.y[2], 0) ** 1.5


def timed(call: Callable[[], Any], repeats: int) -> tuple[float, Any]:
    """Median seconds, and the last result."""
    call()
    spent: list[float] = []
    result = None
    for _ in range(repeats):
        begun = time.perf_counter()
        result = call()
        spent.append(time.perf_counter() - begun)
    return median(spent), result


def three(t: Any, force: Any, noise: float) -> tuple[float, float, float]:
    """E, C_i, C_d of 5,000 samples, all else known; by means of a few samples, as every fit of ours."""
    block = N // POINTS
    at, mean = 0.5 * (t[::block] + t[block - 1 :: block]), force.reshape(-1, block).mean(axis=1)
    problem = Problem("flexed", IMPACT, window_at(at, mean, noise / block**0.5), noise / block**0.5)
    free = problem.free
    free[T0:] = False
    x = minimise(problem.residuals, start_of(problem), free, *problem.bounds()).x
    return float(np.exp(x[LN_E])), 1 / float(x[FLOW]), float(x[DAMPER])


def window_at(t: Any, force: Any, noise: float) -> Window:
    """All of a record, its start, zero level and v0 known."""
    kept = np.ones(t.size, dtype=bool)
    return Window(t, force, kept, t[1] - t[0], 1, noise, 0.0, 1.0, 0.0, t[-1], True, Speed(V0, 0.0), None)


def peers() -> list[str]:
    """A fit of three parameters against lmfit with odeint and least_squares with solve_ivp."""
    rng = np.random.default_rng(1)
    t = np.linspace(0, 2.85e-3, N)
    F = Problem("flexed", IMPACT, window_at(t, t, 1.0), 1.0).contact(X, t)
    noise = 0.01 * F.max()
    force = F + noise * rng.standard_normal(N)
    ours, found = timed(lambda: three(t, force, noise), 201)

    start = (3.0e9, 6000.0, 5.0)
    scale = np.array([1e9, 1e3, 1.0])

    def with_lmfit() -> Any:
        p = lmfit.Parameters()
        for name, value in zip("EID", np.array(start) / scale, strict=True):
            p.add(name, value=value, min=0.05)
        return lmfit.minimize(
            lambda p: by_odeint((p["E"] * 1e9, p["I"] * 1e3, p["D"].value), t) - force, p, epsfcn=1e-8
        )

    def with_ivp() -> Any:
        return least_squares(
            lambda x: by_ivp(tuple(x * scale), t) - force,
            np.array(start) / scale,
            bounds=(0.05, np.inf),
            diff_step=1e-4,
        )

    theirs, fitted = timed(with_lmfit, 3)
    values = [fitted.params[k].value for k in "EID"]
    ivp, solved = timed(with_ivp, 1)
    for name, other in (("lmfit", values), ("least_squares", solved.x)):
        off = np.abs(np.array(found) / scale / np.array(other) - 1).max()
        print(f"{name} finds {np.round(np.array(other), 4)}, ours {np.round(np.array(found) / scale, 4)}, "
              f"at most {100 * off:.2f} % apart", file=sys.stderr)  # fmt: skip
    return [
        f"| fit of E, C_i, C_d to 5,000 samples, against lmfit with odeint "
        f"| {1e3 * theirs:.0f} ms | {1e3 * ours:.2f} ms "
        f"| {theirs / ours:.0f} times | ≥ 300 |",
        f"| the same against least_squares with solve_ivp (LSODA) | {1e3 * ivp:.0f} ms | {1e3 * ours:.2f} ms "
        f"| {ivp / ours:.0f} times | ≥ 1,000 |",
    ]


def windows(count: int) -> list[tuple[Window, Impact]]:
    """Windows of drawn drops, ready to be fitted."""
    found: list[tuple[Window, Impact]] = []
    for k in range(count):
        drop = drawn("flexed plate", np.random.default_rng([3, k]))
        events = locate(drop.record, drop.impact)
        assert events is not None
        v0 = speed_at_contact(drop.record, drop.impact, events, Answer())
        assert v0 is not None
        found.append((window_of(drop.record, events, v0), drop.impact))
    return found


def whole(job: tuple[Window, Impact]) -> float:
    """A fit with its nuisances, ringing and intervals: E."""
    return parameters(fit_window(*job, "flexed"))["E"].value or 0.0


def rate(jobs: list[tuple[Window, Impact]]) -> list[str]:
    """Full fits a second on a core, and on two."""
    whole(jobs[0])
    begun = time.perf_counter()
    for job in jobs:
        whole(job)
    one = (time.perf_counter() - begun) / len(jobs)
    many = (jobs * (1000 // len(jobs) + 1))[:1000]
    with ProcessPoolExecutor(1) as pool:
        list(pool.map(whole, many[:8]))
        begun = time.perf_counter()
        list(pool.map(whole, many, chunksize=25))
        alone = time.perf_counter() - begun
    with ProcessPoolExecutor(2) as pool:
        list(pool.map(whole, many[:16], chunksize=1))
        begun = time.perf_counter()
        list(pool.map(whole, many, chunksize=25))
        both = time.perf_counter() - begun
    with_budget, _ = timed(lambda: to_json(fit_window(*jobs[0], "flexed")), 9)
    return [
        f"| full fit: nuisances, ringing, intervals | | {1e3 * one:.1f} ms | {1 / one:.0f} a second | ≥ 100 |",
        f"| 1,000 fits on two cores, warm, against one | {alone:.1f} s | {both:.1f} s "
        f"| {alone / both:.2f} times | ≥ 1.7 |",
        f"| the answer of one fit, budget and correlations too | | {1e3 * with_budget:.1f} ms | | |",
    ]


def forward() -> list[str]:
    """A forward run as analysis asks for it, against the compiled kernel with nothing around it."""
    t = np.linspace(0, 2.9e-3, N)
    problem = Problem("flexed", IMPACT, window_at(t, t, 1.0), 1.0)
    c, F, none, contact = problem.constants(X), np.empty(N), np.empty((0, 0)), kernel().contact
    floor, _ = timed(lambda: contact(c, t, F, none), 301)
    ours, _ = timed(lambda: problem.contact(X, t), 301)
    what = "forward run of 5,000 points, against the kernel alone"
    return [f"| {what} | {1e6 * floor:.0f} µs | {1e6 * ours:.0f} µs | {ours / floor:.2f} | ≤ 1.5 |"]


def model_free() -> list[str]:
    """v, α, J, E over 1M samples, arrays given, against a copy of four arrays of that size."""
    n = 1_000_000
    t = np.arange(n) * 1e-6
    force = 1000 * np.sin(np.pi * np.minimum(t / 0.99, 1))
    out = [np.empty(n) for _ in range(4)]

    def copy() -> None:
        for a in out:
            np.copyto(a, force)

    floor, _ = timed(copy, 15)
    ours, _ = timed(lambda: passed(t, force, 0.5, 2.0, G), 15)
    return [f"| v, α, J, E over 1M samples, against a copy | {1e3 * floor:.1f} ms | {1e3 * ours:.1f} ms "
            f"| {ours / floor:.1f} | ≤ 2.5 |"]  # fmt: skip


def main() -> None:
    """Print the table."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    print("| what | peer or floor | ours | ratio | reach |\n|---|---|---|---|---|")
    jobs = windows(40)
    for rows in (peers, lambda: rate(jobs), forward, model_free):
        print("\n".join(rows()), flush=True)


if __name__ == "__main__":
    main()
