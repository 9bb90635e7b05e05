"""What the massless fit makes of a plate with mass and of a specimen of finite thickness, as docs/fits.md shows it.

.venv/bin/python bench/plate.py
"""

import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from analysis.conditions import Impact
from analysis.fit import fit_record
from analysis.fit_intervals import parameters
from analysis.models import on_layer
from analysis.record import Record
from analysis.validity import peak_of
from sim_device.fall import Motion
from sim_device.sensors import signal, white
from sim_device.settings import Dart, Hang, Rig, Sensor, Specimen

DT, BEFORE, SAMPLES = 1e-6, 1.5e-3, 9000
NOISE = 0.003
"""Of F_M."""


def record_of(rig: Rig, seed: int) -> tuple[Record, float]:
    """A record of a drop, and F_M."""
    motion = Motion(rig)
    top = motion.contacts[0][1].F_M
    rig = replace(rig, sensor=Sensor(NOISE * top, 0.0, 1.0, 2 * top, 16, 0.0))
    force = signal(rig, motion, 0, -BEFORE, DT, SAMPLES) + NOISE * top * white((seed,), 0, SAMPLES)
    return Record(force, DT, pretrigger=int(BEFORE / DT)), top


def plates() -> None:
    """E 3.3 GPa, C_i 8000 kg/s, no C_d; four modes of 1310 kg/m³."""
    print("| damping of the modes | v0, m/s | F_M over massless | E | C_i, kg/s | C_d read, kg/s | its 95 % |")
    print("|---|---|---|---|---|---|---|")
    for damping in (None, 0.0, 0.01, 0.02, 0.05):
        for v0 in (1.4, 2.0, 2.8):
            modes, zeta = (0, 0.01) if damping is None else (4, damping)
            specimen = Specimen(C_d=0.0, C_i=8000.0, modes=modes, modal_damping=zeta)
            rig = Rig(specimen=specimen, drop=Hang(None, v0, catcher=True))
            record, top = record_of(rig, 3)
            massless = Motion(replace(rig, specimen=replace(specimen, modes=0))).contacts[0][1].F_M
            p = parameters(
                fit_record(record, Impact(0.503, 6.35e-3, 4.6e-3, 0.3, "ring", 0.03, v0=v0, u_v0=0.005 * v0))
            )
            word = "massless" if damping is None else f"{100 * damping:g} %"
            C_i, C_d = p["C_i"], p["C_d"]
            print(
                f"| {word} | {v0} | {100 * (top / massless - 1):+.1f} % "
                f"| {100 * ((p['E'].value or 0) / 3.3e9 - 1):+.2f} % "
                f"| {C_i.value or float('inf'):.0f} | {C_d.value or 0:.1f} | {C_d.lo or 0:.1f} to {C_d.hi or 0:.1f} |"
            )


def layers() -> None:
    """E 2.3 GPa, C 8000 kg/s on a rigid base, 1.5 m/s, 0.743 kg."""
    print("\n| thickness, mm | F_M, N | E read as a half-space, GPa | over the truth | added by the base at F_M "
          "| over the truth, corrected |")  # fmt: skip
    print("|---|---|---|---|---|---|")
    for thickness in (1.5, 3, 5, 8, 10, 20, 50):
        rig = Rig(specimen=Specimen("rigid", 2.3, 0.32, thickness, C=8000.0, C_d=0.0, finite=True), dart=Dart(0.743),
                  drop=Hang(None, 1.5, catcher=True))  # fmt: skip
        record, top = record_of(rig, 4)
        impact = Impact(0.743, 6.35e-3, thickness * 1e-3, 0.32, "rigid", None, v0=1.5, u_v0=0.0075)
        fit = fit_record(record, impact)
        right = (parameters(fit_record(record, impact, None, ("finite-thickness",)))["E"].value or 0) * 1e-9
        E = (parameters(fit)["E"].value or 0) * 1e-9
        share = on_layer((6.35e-3 * peak_of(fit).alpha_1) ** 0.5 / (thickness * 1e-3), 0.32) - 1
        print(f"| {thickness:g} | {top:.0f} | {E:.2f} | {100 * (E / 2.3 - 1):+.1f} % | {100 * share:+.1f} % "
              f"| {100 * (right / 2.3 - 1):+.2f} % |")  # fmt: skip


if __name__ == "__main__":
    plates()
    layers()
