"""How often the 95 % intervals of the fits hold the truth, over drops that the emulator's own solver integrates.

    .venv/bin/python bench/coverage_fits.py [--drops 1000] [--seed S] [--only WORD] [--write docs/fits.md]

E 2–4 GPa, C_i (or C) 4–12 Mg/s, C_d 0–15 kg/s, v0 1–4 m/s known to 0.5 % as a 10 mm flag has it, noise 1 % of F_M,
ringing 5 % at 4–12 kHz, an offset up to 1 %, 14 bits, 500 kHz or 1 MHz, the trigger up to 20 µs late.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from analysis.conditions import Impact
from analysis.fit import NotFitted, fit_record
from analysis.fit_intervals import Parameter, parameters
from analysis.record import Record
from sim_device.fall import Motion
from sim_device.sensors import Scale, signal, white
from sim_device.settings import Dart, Hang, Rig, Sensor, Specimen

CASES = ("flexed plate", "indentation", "flexed plate, no C_d")
U_V0 = 0.005
BEFORE, WHOLE = 1.5e-3, 9e-3
"""s, before contact and altogether."""


@dataclass(frozen=True)
class Drop:
    """A record, what the operator knows of it, and the truth by parameter."""

    record: Record
    impact: Impact
    truth: dict[str, float]


def drawn(case: str, rng: np.random.Generator, **given: float) -> Drop:
    """A drop of a case; ``given`` are v0, mass_kg, tip_radius_mm, E_GPa, C instead of what is drawn."""
    ring = case.startswith("flexed")
    E, C = given.get("E_GPa", rng.uniform(2, 4)), given.get("C", rng.uniform(4e3, 12e3))
    C_d = 0.0 if case.endswith("no C_d") else rng.uniform(0, 15)
    v0, mass = given.get("v0", rng.uniform(1, 4)), given.get("mass_kg", 0.503)
    tip = given.get("tip_radius_mm", 6.35)
    nu, thickness = (0.30, 4.6) if ring else (0.32, 10.0)
    specimen = Specimen(
        "ring" if ring else "rigid", E, nu, thickness, 30.0, C if ring else None, C_d, None if ring else C
    )
    rig = Rig(specimen=specimen, dart=Dart(mass, tip), drop=Hang(None, v0, catcher=True))
    motion = Motion(rig)
    top = motion.contacts[0][1].F_M
    sensor = Sensor(0.01 * top, rng.uniform(-0.01, 0.01) * top, 1.0, 1.6 * top, 14, 0.05, rng.uniform(4e3, 12e3),
                    rng.uniform(0.3e-3, 1e-3))  # fmt: skip
    rig = replace(rig, sensor=sensor)
    dt = 1e-6 if rng.random() < 0.5 else 2e-6
    n, t0 = int(WHOLE / dt), BEFORE - rng.uniform(0, 20e-6)
    clean = signal(rig, motion, 0, -t0, dt, n)
    noisy = clean + sensor.offset_N + sensor.noise_N * white((int(rng.integers(1 << 30)),), 0, n)
    scale = Scale.of(rig, 0)
    record = Record(
        scale.counts(noisy) / scale.per_unit, dt, rails=(-scale.range, scale.range), lsb=1 / scale.per_unit,
        pretrigger=int(BEFORE / dt),
    )  # fmt: skip
    impact = Impact(
        mass=mass, tip_radius=tip * 1e-3, thickness=thickness * 1e-3, nu=nu, support="ring" if ring else "rigid",
        support_radius=0.03 if ring else None, v0=v0 * (1 + U_V0 * rng.standard_normal()), u_v0=U_V0 * v0, catcher=True,
    )  # fmt: skip
    truth = {"E": E * 1e9, "C_i" if ring else "C": C, "v0": v0, "t0": t0, "baseline": sensor.offset_N}
    return Drop(record, impact, truth | ({"C_d": C_d} if ring else {}))


def one(job: tuple[str, int, int]) -> dict[str, tuple[float, bool, str, float]] | str:
    """Of a drop: by parameter its error, whether the interval holds the truth, the verdict, u. Or why it failed."""
    case, seed, number = job
    drop = drawn(case, np.random.default_rng([seed, CASES.index(case), number]))
    try:
        known = parameters(fit_record(drop.record, drop.impact))
    except (NotFitted, ArithmeticError) as e:
        return str(e)
    return {name: _judged(known[name], truth) for name, truth in drop.truth.items()}


def _judged(p: Parameter, truth: float) -> tuple[float, bool, str, float]:
    low, high = -np.inf if p.lo is None else p.lo, np.inf if p.hi is None else p.hi
    value = np.inf if p.value is None else p.value
    return value - truth, low <= truth <= high, p.verdict, p.u or np.nan


def study(case: str, drops: int, seed: int) -> tuple[list[str], int]:
    """Rows of the table, and failed fits."""
    jobs = [(case, seed, k) for k in range(drops)]
    begun, found, failed = time.perf_counter(), list[dict[str, tuple[float, bool, str, float]]](), 0
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for k, result in enumerate(pool.map(one, jobs, chunksize=5), 1):
            if isinstance(result, str):
                failed += 1
                print(f"{case} {k}: {result}", file=sys.stderr)
            else:
                found.append(result)
            if k % 100 == 0:
                print(f"{case}: {k} of {drops}, {time.perf_counter() - begun:.0f} s", file=sys.stderr)
    rows: list[str] = []
    for name in found[0]:
        error = np.array([r[name][0] for r in found])
        held = 100 * np.mean([r[name][1] for r in found])
        finite = error[np.isfinite(error)]
        low, high = np.percentile(finite, [16, 84])
        spread = 0.5 * (high - low)
        verdicts = [r[name][2] for r in found]
        words = ", ".join(f"{v} {verdicts.count(v)}" for v in sorted(set(verdicts), key=verdicts.count, reverse=True))
        unit, factor = {"E": ("GPa", 1e-9), "t0": ("µs", 1e6), "v0": ("m/s", 1), "baseline": ("N", 1)}.get(
            name, ("kg/s", 1)
        )
        rows.append(
            f"| {case} | {name} | {held:.1f} | {np.median(error) / spread:+.3f} "
            f"| {factor * spread:.3g} {unit} | {words} |"
        )
    return rows, failed


def slopes(drops: int, seed: int) -> list[str]:
    """E of emulated P2 series against drop mass and tip radius: the slope and its interval."""
    rows: list[str] = []
    for name, values in (("mass_kg", (0.743, 1.043, 1.343)), ("tip_radius_mm", (6.35, 10.0))):
        x, y, w = list[float](), list[float](), list[float]()
        for k, value in enumerate(values):
            for j in range(drops):
                rng = np.random.default_rng([seed, 7, k, j, len(values)])
                drop = drawn("indentation", rng, E_GPa=2.3, C=8000.0, v0=1.5, **{name: value})
                p = parameters(fit_record(drop.record, drop.impact))["E"]
                x.append(value)
                y.append(float(p.value or 0) * 1e-9)
                w.append(1 / (float(p.u or 1) * 1e-9) ** 2)
        a, weight = np.column_stack((np.ones(len(x)), x)), np.array(w)
        inverse = np.linalg.inv(a.T @ (a * weight[:, None]))
        slope, u = float((inverse @ (a.T @ (weight * np.array(y))))[1]), float(np.sqrt(inverse[1, 1]))
        rows.append(f"| {name} {', '.join(f'{v:g}' for v in values)} | {len(x)} | {slope:+.4f} | {1.96 * u:.4f} |")
    return rows


def main() -> int:
    """Run the study as asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drops", type=int, default=1000, help="drops a case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="cases whose name holds this")
    parser.add_argument("--write", type=Path, help="put the tables into this page, after its last heading")
    given = parser.parse_args()
    lines = ["| case | parameter | 95 % intervals hold the truth, % | median error / spread | spread | verdicts |",
             "|---|---|---|---|---|---|"]  # fmt: skip
    failed = 0
    for case in CASES:
        if given.only in case:
            rows, lost = study(case, given.drops, given.seed)
            lines += rows
            failed += lost
    lines += ["", f"{given.drops} drops a case, seed {given.seed}; {failed} fits failed.", ""]
    if not given.only:
        lines += ["| E against | drops | slope, GPa per unit | its 95 % half-width |", "|---|---|---|---|"]
        lines += slopes(max(5, given.drops // 50), given.seed)
    text = "\n".join(lines)
    print(text)
    if given.write:
        page = given.write.read_text(encoding="utf-8")
        given.write.write_text(
            f"{page[: page.rindex(chr(10) + '## ')]}\n## How often they hold\n\n{text}\n", encoding="utf-8"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
