"""Complete failures and intact drops of the emulator: what is found, how near, and what is taken for a failure falsely.

    .venv/bin/python bench/failure.py [--drops 2000] [--seed 1]

E 2–4 GPa, C_i 4–12 Mg/s, C_d 0–15 kg/s, v0 1.2–4 m/s known to 0.5 %, noise 1 % of F_M, 14 bits, 500 kHz or 1 MHz.
Intact drops ring with up to 15 % of F_M; failing ones fail at 30 to 99 % of the path to their peak and ring
with up to 5 %, in the curve with up to 15 %.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from analysis import Impact, Record, analyze
from sim_device.fall import Motion
from sim_device.sensors import Scale, signal, white
from sim_device.settings import Hang, Rig, Sensor, Specimen

BEFORE, WHOLE, U_V0 = 1.5e-3, 9e-3, 0.005
STEPS = (0.0, 0.05, 0.075, 0.1, 0.125, 0.15)


@dataclass(frozen=True)
class Seen:
    """Of one drop: whether it was called failed, its ringing, and of a failure the errors and their 95 % reaches."""

    failed: bool
    ringing: float
    off_t: float = np.nan
    off_F: float = np.nan
    held_t: bool = False
    held_F: bool = False


def one(job: tuple[int, int, bool, float]) -> Seen:
    """Draw a drop and look at it."""
    seed, number, fails, most = job
    rng = np.random.default_rng([seed, number, int(fails), int(1000 * most)])
    v0 = rng.uniform(1.2, 4)
    specimen = Specimen(E_GPa=rng.uniform(2, 4), C_i=rng.uniform(4e3, 12e3), C_d=rng.uniform(0, 15))
    rig = Rig(specimen=specimen, drop=Hang(None, v0, catcher=True))
    motion = Motion(rig)
    contact = motion.contacts[0][1]
    top = contact.F_M
    if fails:
        t = np.linspace(0, contact.t_M, 4000)
        at = np.interp(rng.uniform(0.3, 0.99) * contact.position(np.array([contact.t_M]))[0], contact.position(t), t)
        load = float(contact.force(np.array([at]))[0])
        motion = Motion(replace(rig, specimen=replace(specimen, fail_N=load)))
    ringing = rng.uniform(0, most)
    sensor = Sensor(0.01 * top, 0.0, 1.0, 1.6 * top, 14, ringing, rng.uniform(4e3, 12e3), rng.uniform(0.3e-3, 1e-3))
    rig = replace(rig, sensor=sensor)
    dt = 1e-6 if rng.random() < 0.5 else 2e-6
    t0, n = BEFORE - rng.uniform(0, 20e-6), int(WHOLE / dt)
    noisy = signal(rig, motion, 0, -t0, dt, n) + sensor.noise_N * white((int(rng.integers(1 << 30)),), 0, n)
    scale = Scale.of(rig, 0)
    record = Record(scale.counts(noisy) / scale.per_unit, dt, rails=(-scale.range, scale.range), lsb=1 / scale.per_unit,
                    pretrigger=int(BEFORE / dt))  # fmt: skip
    impact = Impact(0.503, 6.35e-3, 4.6e-3, 0.3, "ring", 0.03, v0=v0 * (1 + U_V0 * rng.standard_normal()),
                    u_v0=U_V0 * v0, catcher=True)  # fmt: skip
    found = analyze(record, impact).values
    failed = found["failed"].value is True
    truth = motion.contacts[0][1]
    if not (fails and failed) or truth.t_failure is None:
        return Seen(failed, ringing)
    start, t_f, F = found["t_contact"], found["t_failure"], found["F_failure"]
    off_t = float(start.value or 0) + float(t_f.value or 0) - t0 - truth.t_failure
    off_F = float(F.value or 0) / truth.F_M - 1
    return Seen(
        True, ringing, off_t, off_F, abs(off_t) < 1.96 * (t_f.u or 0), abs(off_F) * truth.F_M < 1.96 * (F.u or 0)
    )


def study(drops: int, seed: int, fails: bool, most: float) -> list[Seen]:
    """That many drops, on all cores."""
    begun = time.perf_counter()
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        found = list(pool.map(one, [(seed, k, fails, most) for k in range(drops)], chunksize=10))
    print(f"{drops} {'failing' if fails else 'intact'}: {time.perf_counter() - begun:.0f} s", file=sys.stderr)
    return found


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drops", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    intact = study(given.drops, given.seed, fails=False, most=0.15)
    failing = study(given.drops, given.seed, fails=True, most=0.05)
    loud = study(given.drops // 2, given.seed, fails=True, most=0.15)
    seen = [s for s in failing if s.failed]
    t, F = np.array([s.off_t for s in seen]), np.array([s.off_F for s in seen])
    print("| what | found | reach |\n|---|---|---|")
    print(f"| {len(intact)} intact drops, ringing to 15 %: called failed | {sum(s.failed for s in intact)} | 0 |")
    print(f"| {len(failing)} complete failures, ringing to 5 %: missed | {len(failing) - len(seen)} | 0 |")
    print(f"| time within 5 µs | {100 * np.mean(np.abs(t) < 5e-6):.1f} % | 95 % |")
    print(f"| load within 2 % | {100 * np.mean(np.abs(F) < 0.02):.1f} % | 95 % |")
    print(f"| median error | {1e6 * np.median(t):+.2f} µs, {100 * np.median(F):+.2f} % | |")
    held = 100 * np.mean([s.held_t for s in seen]), 100 * np.mean([s.held_F for s in seen])
    print(f"| 95 % intervals hold time and load in | {held[0]:.1f} %, {held[1]:.1f} % | |")
    print("\n| ringing, of F_M | failures | found | load within 2 % |\n|---|---|---|---|")
    for low, high in pairwise(STEPS):
        some = [s for s in loud if low <= s.ringing < high]
        near = [abs(s.off_F) < 0.02 for s in some if s.failed]
        print(f"| {100 * low:g} to {100 * high:g} % | {len(some)} | {100 * np.mean([s.failed for s in some]):.1f} % "
              f"| {100 * np.mean(near):.1f} % |")  # fmt: skip


if __name__ == "__main__":
    main()
