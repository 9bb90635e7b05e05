"""Coverage of the 95 % intervals of contact, restitution and peak over simulated drops: a table in markdown.

    .venv/bin/python bench/coverage_events.py [--drops N] [--seed S] [--only WORD]

Noise is white, ringing a decaying sine that starts at contact, quantisation 12 to 16 bits over ±1.6 F_M, the sub-sample
phase random; v0 and mass are exact, so that eps_exact shows what the record itself contributes.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "analysis"))

import drops

from analysis import analyze

SYMBOLS = ("t_contact", "t_c", "eps_exact", "F_M")


def cases(shapes: dict[str, drops.Drop]) -> dict[str, tuple[drops.Drop, float, float, tuple[float, float]]]:
    """Name → drop, noise of F_M, sampling interval s, range of ringing amplitudes of F_M."""
    found: dict[str, tuple[drops.Drop, float, float, tuple[float, float]]] = {}
    for name, drop in shapes.items():
        found[f"{name}, noise 0.2 %"] = (drop, 0.002, 1e-6, (0, 0))
        found[f"{name}, noise 2 %"] = (drop, 0.02, 1e-6, (0, 0))
        found[f"{name}, noise 0.5 %, ringing 1–5 %"] = (drop, 0.005, 1e-6, (0.01, 0.05))
    found["flexed C_d=5, noise 1 %, 500 kHz"] = (shapes["flexed C_d=5"], 0.01, 2e-6, (0, 0))
    found["flexed C_d=5, noise 1 %, ringing 1–5 %, 500 kHz"] = (shapes["flexed C_d=5"], 0.01, 2e-6, (0.01, 0.05))
    return found


def one(
    drop: drops.Drop, noise: float, dt: float, ringing: tuple[float, float], rng: np.random.Generator
) -> dict[str, tuple[float, float]]:
    """Error and standard uncertainty of each symbol in one drop; NaN where it was not found."""
    ring = None
    if ringing[1] > 0:
        ring = (rng.uniform(*ringing), rng.uniform(4e3, 12e3), rng.uniform(0.3e-3, 1e-3))
    recorder = drops.Recorder(dt=dt, noise=noise, ringing=ring, bits=int(rng.integers(12, 17)))
    record, t0 = drops.record(drop, recorder, rng)
    fine = np.arange(0, drop.t_c, 1e-7)
    top = float(np.max(drop.force(fine) + drops.ring(drop, recorder, fine))) if ring else drop.F_M
    found = analyze(record, drops.impact(drop)).values
    truth = {"t_contact": t0, "t_c": drop.t_c, "eps_exact": drop.eps, "F_M": top}
    answer: dict[str, tuple[float, float]] = {}
    for symbol, true in truth.items():
        value, u = found[symbol].value, found[symbol].u
        answer[symbol] = (np.nan, np.nan) if value is None or u is None else (float(value) - true, u)
    return answer


def study(count: int, seed: int, only: str = "", show: bool = True) -> dict[str, dict[str, np.ndarray]]:
    """Case → symbol → (count, 2) errors and uncertainties."""
    result: dict[str, dict[str, np.ndarray]] = {}
    for k, (name, case) in enumerate(cases(drops.shapes()).items()):
        if only not in name:
            continue
        rng = np.random.default_rng([seed, k])
        begun = time.perf_counter()
        runs = [one(*case, rng) for _ in range(count)]
        result[name] = {s: np.array([r[s] for r in runs]) for s in SYMBOLS}
        if show:
            took = time.perf_counter() - begun
            print(f"{name}: {count} drops, {1e3 * took / count:.0f} ms a drop", file=sys.stderr, flush=True)
    return result


def covered(pairs: np.ndarray) -> np.ndarray:
    """Whether each error lies within 1.96 u; a value that was not found counts as missed."""
    return np.abs(pairs[:, 0]) <= 1.96 * pairs[:, 1]


def table(result: dict[str, dict[str, np.ndarray]]) -> str:
    """The study as markdown: coverage %, median u, median |error|."""
    units = {"t_contact": ("µs", 1e6), "t_c": ("µs", 1e6), "eps_exact": ("1e-3", 1e3), "F_M": ("N", 1.0)}
    lines = [
        "| case | " + " | ".join(f"{s}: %, u, error ({units[s][0]})" for s in SYMBOLS) + " |",
        "|---|---|---|---|---|",
    ]
    for name, symbols in result.items():
        cells: list[str] = []
        for s in SYMBOLS:
            scale = units[s][1]
            error, u = np.nanmedian(np.abs(symbols[s]), axis=0) * scale
            cells.append(f"{100 * covered(symbols[s]).mean():.1f}, {u:.2g}, {error:.2g}")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    """Run the study as asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drops", type=int, default=300, help="drops a case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="cases whose name holds this")
    options = parser.parse_args()
    print(table(study(options.drops, options.seed, options.only)))


if __name__ == "__main__":
    main()
