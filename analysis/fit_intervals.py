"""What a fit says of each parameter: value, standard error, 95 % interval, and whether the record can tell it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from analysis.fit import Fit
from analysis.fit_problem import DAMPER, FLOW, LEVEL, LN_E, MODES, PER_MODE, T0, V0
from analysis.levenberg import covariance, minimise
from analysis.record import Array

DETERMINED, UPPER, LOWER, NOT = (
    "determined", "upper limit only", "lower limit only", "not determined by this record"
)  # fmt: skip
LEVEL_95 = 1.959964
_FAR = 4.0
"""Standard errors from its bound within which a damper's interval is a profile, not value ± 1.96 u."""
_UNSURE = 0.25
"""Of ln E, past which E is not determined."""


@dataclass(frozen=True)
class Parameter:
    """value, u in ``unit``; lo, hi : the 95 % interval, an open side None."""

    value: float | None
    unit: str
    u: float | None
    lo: float | None
    hi: float | None
    verdict: str = DETERMINED


def spread(fit: Fit) -> Array:
    """(p, p) covariance of the parameters that are not at a bound, from the record and v0."""
    return covariance(fit.best.N, fit.problem.free & ~fit.best.at_bound)


def profile_end(fit: Fit, at: int, u: float, side: int) -> float | None:
    """Where the sum of squares, all others fitted, has risen by 1.96²: up (side 1) or down (−1) from the best point.

    None: it does not, before the bound (down) or a hundred times u (up).
    """
    problem, best = fit.problem, fit.best
    low, high = problem.bounds()
    free = problem.free.copy()
    free[at] = False
    C = spread(fit)
    lean = C[:, at] / C[at, at] if C[at, at] > 0 else np.zeros(len(C))
    start = best.x.copy()

    def rise(value: float) -> float:
        nonlocal start
        x = start + lean * (value - start[at])
        x[at] = value
        found = minimise(problem.residuals, np.clip(x, low, high), free, low, high)
        start = found.x
        return float(np.sqrt(max(found.chi2 - best.chi2, 0.0)))

    x0, far = float(best.x[at]), 100 * u
    inner, r_inner, step = x0, 0.0, LEVEL_95 * u
    outer = r_outer = None
    for _ in range(12):
        trial = x0 + side * step
        if side < 0 and trial <= low[at]:
            trial = float(low[at])
        r = rise(trial)
        if abs(r - LEVEL_95) < 0.02:
            return trial
        if r > LEVEL_95:
            outer, r_outer = trial, r
        else:
            if (side < 0 and trial <= low[at]) or step > far:
                return None
            inner, r_inner = trial, r
        if outer is None or r_outer is None:
            step *= min(max(LEVEL_95 / max(r, 0.1), 1.2), 3.0)
        else:
            step = side * (inner + (outer - inner) * (LEVEL_95 - r_inner) / (r_outer - r_inner) - x0)
    return x0 + side * step


def interval(fit: Fit, at: int) -> tuple[float, float | None, float | None]:
    """u, lo and hi of a parameter that cannot be below 0; lo None: 0 is not excluded."""
    free = fit.problem.free
    value = float(fit.best.x[at])
    u = float(np.sqrt(covariance(fit.best.N, free & (~fit.best.at_bound | (np.arange(free.size) == at)))[at, at]))
    if value > _FAR * u:
        return u, value - LEVEL_95 * u, value + LEVEL_95 * u
    low = profile_end(fit, at, u, -1) if value > 0 else None
    return u, low, profile_end(fit, at, u, 1)


def parameters(fit: Fit) -> dict[str, Parameter]:
    """By the contract's names: E, C_i, C_d (series: C; parallel: C), t0, baseline, v0, and the ringing."""
    x, C, problem = fit.best.x, spread(fit), fit.problem
    u = np.sqrt(np.diag(C))
    window = problem.window
    E, u_lnE = float(np.exp(x[LN_E])), float(u[LN_E])
    ends = (E * math.exp(-LEVEL_95 * u_lnE), E * math.exp(LEVEL_95 * u_lnE))
    found = {"E": Parameter(E, "Pa", E * u_lnE, *ends, DETERMINED if u_lnE < _UNSURE else NOT)}
    J = problem.impact.mass * window.v0.value
    if problem.free[FLOW]:
        name = "C" if problem.kind == "series" else "C_i"
        # A limit says something if the dashpot could not have taken all of the displacement.
        found[name] = _in_series(float(x[FLOW]), *interval(fit, FLOW), most=window.v0.value * window.length / J)
    if problem.free[DAMPER]:
        name = "C" if problem.kind == "parallel" else "C_d"
        most = problem.window.length / problem.constants(x)[5] if problem.kind == "flexed" else J / 1e-6
        found[name] = _damper(float(x[DAMPER]), *interval(fit, DAMPER), most=most)
    found["v0"] = _plain(float(x[V0]), "m/s", float(u[V0]))
    found["t0"] = _plain(float(x[T0]), "s", float(u[T0]))
    found["baseline"] = _plain(float(x[LEVEL]) + window.level, "N", float(u[LEVEL]))
    for j, k in enumerate(range(MODES, x.size, PER_MODE)):
        name = f"ringing_{j + 1}" if j else "ringing"
        decay = float(np.exp(x[k + 3]))
        found[f"{name}_Hz"] = _plain(float(x[k + 2]), "Hz", float(u[k + 2]))
        found[f"{name}_decay"] = _plain(decay, "s", decay * float(u[k + 3]))
        found[f"{name}_amplitude"] = _plain(float(np.hypot(x[k], x[k + 1])), "N", float(u[k + 1]))
    return found


def _plain(value: float, unit: str, u: float) -> Parameter:
    return Parameter(value, unit, u, value - LEVEL_95 * u, value + LEVEL_95 * u)


def _in_series(c: float, u: float, lo: float | None, hi: float | None, most: float) -> Parameter:
    """C_i = 1/c: its ends are those of c, the other way round."""
    value = 1 / c if c > 0 else None
    verdict = NOT if hi is None or hi > most else DETERMINED if lo is not None and lo > 0 else LOWER
    return Parameter(value, "kg/s", u / c**2 if c > 0 else None, _over(hi), _over(lo), verdict)


def _over(c: float | None) -> float | None:
    return 1 / c if c is not None and c > 0 else None


def _damper(value: float, u: float, lo: float | None, hi: float | None, most: float) -> Parameter:
    verdict = NOT if hi is None or hi > most else DETERMINED if lo is not None and lo > 0 else UPPER
    return Parameter(value, "kg/s", u, lo, hi, verdict)
