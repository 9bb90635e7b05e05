"""How often the interval of v0_fail holds the truth, over series of 12 drops of the emulator's plates.

.venv/bin/python bench/series.py [--series 1000] [--seed 1]

Each specimen fails at a load of its own, lognormal around the material's; the force that a drop reaches is the
emulator's. The speeds are drawn around the limit, as of an operator who knows it to 30 %; or climb in even steps.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from analysis.rupture import failure_speed
from sim_device.fall import Motion
from sim_device.settings import Hang, Rig, Specimen

DROPS = 12


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--series", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    grid = np.linspace(1.0, 8.0, 60)
    plate = Specimen(E_GPa=3.4, C_i=5000.0, C_d=10.0)
    peaks = np.array([Motion(Rig(specimen=plate, drop=Hang(None, v, catcher=True))).contacts[0][1].F_M for v in grid])
    print(
        "| speeds | scatter of the load | interval holds v0_fail | clean groups | median width |\n|---|---|---|---|---|"
    )
    for how in ("drawn", "climbing"):
        for scatter in (0.03, 0.05, 0.08):
            rng = np.random.default_rng([given.seed, int(1000 * scatter), len(how)])
            held, clean, widths, none = 0, 0, list[float](), 0
            for _ in range(given.series):
                load = rng.uniform(1000, 2200)
                truth = float(np.interp(load, peaks, grid))
                about = truth * (1 + rng.uniform(-0.15, 0.15))
                v0 = about * (rng.uniform(0.7, 1.3, DROPS) if how == "drawn" else np.linspace(0.7, 1.3, DROPS))
                failed = np.interp(v0, grid, peaks) > load * np.exp(scatter * rng.standard_normal(DROPS))
                found = failure_speed(v0.tolist(), failed.tolist())
                if found is None or found.lo is None or found.hi is None:
                    none += 1
                    continue
                held += found.lo <= truth <= found.hi
                clean += v0[failed].min() > v0[~failed].max()
                widths.append((found.hi - found.lo) / truth)
            n = given.series - none
            print(f"| {how} | {100 * scatter:g} % | {100 * held / n:.1f} % | {100 * clean / n:.0f} % "
                  f"| {100 * np.median(widths):.1f} % of v0_fail |")  # fmt: skip


if __name__ == "__main__":
    main()
