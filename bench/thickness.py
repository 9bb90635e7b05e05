"""Is the thickness from which on F(t) stays the same found where it is? P2's study on the emulator's layers.

    .venv/bin/python bench/thickness.py [--studies 100] [--seed 1]

Each study: one material (E 1.5–4 GPa, C 5–50 Mg/s), one v0 (1.2–2 m/s), 0.743 kg, tip 6.35 mm on a rigid base, eight
drops of each thickness of a ladder, P2's among them. E scatters by 0.5 %, v0 is known to 0.5 %, noise is 1 % of F_M,
ringing 2 %. The truth follows from the drops without noise. A study is left out as no fair question where a thickness
lies within 0.6 % of the margin.
"""

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from analysis import Impact, Record, analyze
from analysis.thickness import MARGIN, POWERS, thickness_threshold
from sim_device.fall import Motion
from sim_device.sensors import signal, white
from sim_device.settings import Dart, Hang, Rig, Sensor, Specimen

LADDERS = ((1.5, 3.0, 5.0, 8.0, 10.0), (2.0, 4.0, 8.0, 16.0, 20.0), (2.0, 3.0, 5.0, 8.0, 9.0))
"""mm; the first is P2's."""
DART, U_V0, DROPS = Dart(mass_kg=0.743), 0.005, 8


def layer(E: float, C: float, thickness: float) -> Specimen:
    """A specimen of PETG's ν on a rigid base."""
    return Specimen(kind="rigid", E_GPa=E, C=C, nu=0.32, thickness_mm=thickness, finite=True)


def drop(rng: np.random.Generator, E: float, C: float, thickness: float, v0: float) -> dict[str, float]:
    """v0, F_M and t_c of one drop as analysis finds them."""
    real = v0 * (1 + U_V0 * rng.standard_normal())
    specimen = layer(E * np.exp(0.005 * rng.standard_normal()), C, thickness)
    top = Motion(Rig(specimen=specimen, dart=DART, drop=Hang(None, real, catcher=True))).contacts[0][1].F_M
    sensor = Sensor(0.01 * top, 0.0, 1.0, 1.6 * top, 14, 0.02, rng.uniform(6e3, 12e3), 0.4e-3)
    rig = Rig(specimen=specimen, dart=DART, drop=Hang(None, real, catcher=True), sensor=sensor)
    force = signal(rig, Motion(rig), 0, -1e-3, 1e-6, 5000) + sensor.noise_N * white(
        (int(rng.integers(1 << 30)),), 0, 5000
    )
    impact = Impact(0.743, 6.35e-3, thickness * 1e-3, 0.32, "rigid", None, v0=v0, u_v0=U_V0 * v0, catcher=True)
    found = analyze(Record(force, 1e-6, pretrigger=1000), impact).values
    return {symbol: float(found[symbol].value or np.nan) for symbol in ("v0", *POWERS)}


def study(job: tuple[int, int]) -> tuple[bool, int, float | None, float | None]:
    """Whether the study is decided, its ladder, the true threshold and the one found, m."""
    rng = np.random.default_rng(list(job))
    ladder = job[1] % len(LADDERS)
    thick = LADDERS[ladder]
    E, C, v0 = rng.uniform(1.5, 4), 10 ** rng.uniform(np.log10(5e3), np.log10(5e4)), rng.uniform(1.2, 2)
    exact = {}
    for h in thick:
        contact = Motion(Rig(specimen=layer(E, C, h), dart=DART, drop=Hang(None, v0, catcher=True))).contacts[0][1]
        exact[h] = np.array([contact.F_M, contact.end])
    off = {h: float(np.abs(np.log(exact[h] / exact[thick[-1]])).max()) for h in thick[:-1]}
    decided = all(abs(o - np.log1p(MARGIN)) > 0.006 for o in off.values())
    true = next((h for h in thick[:-1] if all(off[k] < np.log1p(MARGIN) for k in thick[:-1] if k >= h)), None)
    found = thickness_threshold({h: [drop(rng, E, C, h, v0) for _ in range(DROPS)] for h in thick})
    return decided, ladder, true, None if found is None else found.thickness


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--studies", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        told = list(pool.map(study, [(given.seed, k) for k in range(given.studies)]))
    print("| ladder, mm | studies | true threshold | found there | above it | below it |\n|---|---|---|---|---|---|")
    for ladder, thick in enumerate(LADDERS):
        some = [t for t in told if t[0] and t[1] == ladder]
        step = [(thick.index(f) if f else len(thick)) - (thick.index(t) if t else len(thick)) for _, _, t, f in some]
        true = sorted({t for _, _, t, _ in some if t})
        rates = [100 * np.mean(np.sign(step) == sign) for sign in (0, 1, -1)]
        print(f"| {', '.join(f'{h:g}' for h in thick)} | {len(some)} | {', '.join(f'{h:g}' for h in true)} "
              f"| {rates[0]:.0f} % | {rates[1]:.0f} % | {rates[2]:.0f} % |")  # fmt: skip
    print(f"\n{sum(not t[0] for t in told)} of {len(told)} studies were no fair question and are left out.")


if __name__ == "__main__":
    main()
