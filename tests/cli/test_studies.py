"""P2's study from imported files: thickness, stack, drop mass, and a lens."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from sim_device.fall import Motion
from sim_device.sensors import signal, white
from sim_device.settings import Dart, Hang, Rig, Sensor, Specimen

DROPTOWER = Path(sys.executable).with_name("droptower")
TEST = """
[dart]
mass_kg = 0.743
tip_radius_mm = 6.35
[specimen]
material = "PETG"
thickness_mm = 10
nu = 0.32
[support]
kind = "rigid"
[drop]
catcher = true
"""
STUDY = [(h, 0.743, "") for h in (1.5, 3, 5, 8, 10) for _ in range(4)]
STUDY += [(10, 0.743, "[5, 5]")] * 4 + [(10, 1.043, "")] * 3 + [(10, 1.343, "")] * 3


def imported(here: Path, rows: list[str], records: list[np.ndarray], test: str, name: str) -> dict:
    """The answer of a series of records, 1 MHz, imported with a table of drops."""
    for k, force in enumerate(records):
        table = np.column_stack((np.arange(force.size) * 1e-6, force))
        np.savetxt(here / f"{k}.csv", table, delimiter=",", header="time_s,force_N", comments="", fmt="%.7g")
    (here / "drops.csv").write_text("\n".join(rows) + "\n")
    (here / "test.toml").write_text(test)
    files = [here / f"{k}.csv" for k in range(len(records))]
    data = ["--data", here / "data"]
    options = ["--test", here / "test.toml", "--table", here / "drops.csv", "--series", name]
    subprocess.run([DROPTOWER, "import", *files, *options, *data], check=True, capture_output=True)
    done = subprocess.run([DROPTOWER, "series", name, *data, "--json"], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def record(specimen: Specimen, mass: float, v0: float, seed: int) -> np.ndarray:
    """Force of a drop, N, with noise."""
    rig = Rig(
        specimen=specimen, dart=Dart(mass_kg=mass), drop=Hang(None, v0, catcher=True), sensor=Sensor(ringing=0.01)
    )
    return signal(rig, Motion(rig), 0, -1e-3, 1e-6, 4500) + 10 * white((seed,), 0, 4500)


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> dict:
    """P2's study on the emulator's layers."""
    rng = np.random.default_rng(9)
    rows, records = ["file,v0,u_v0,specimen_id,specimen.thickness_mm,dart.mass_kg,specimen.stack_mm"], []
    for k, (thickness, mass, stack) in enumerate(STUDY):
        v0 = 1.5 * (1 + 0.003 * rng.standard_normal())
        specimen = Specimen(kind="rigid", E_GPa=2.1, C=2e4, nu=0.32, thickness_mm=thickness, finite=True)
        records.append(record(specimen, mass, v0, k))
        rows.append(f'{k}.csv,{v0:.5f},0.005,p{k},{thickness},{mass},"{stack}"')
    return imported(tmp_path_factory.mktemp("p2"), rows, records, TEST, "PETG")


def test_eight_millimetres_act_as_ten(found: dict) -> None:
    # Mass varies as well: the drops of one mass are the study of thickness.
    reached = found["thickness"]
    assert reached["value"] == pytest.approx(8e-3)
    assert reached["against"] == pytest.approx(10e-3)
    assert [row["same"] for row in reached["rows"]] == [False, False, False, True]


def test_two_plates_of_five_act_as_one_of_ten(found: dict) -> None:
    (stack,) = found["stacks"]
    assert stack["same"] is True
    assert stack["ratios"]["F_M"]["lo"] < 1 < stack["ratios"]["F_M"]["hi"]


def test_E_reads_high_on_thin_ones_and_no_joint_fit_hides_it(found: dict) -> None:
    assert found["dependence"]["thickness"]["hi"] < 0
    assert found["joint"]["one_E"] is None
    assert "no-joint-fit-one-e" in [w["code"] for w in found["warnings"]]


def test_E_is_that_of_other_masses(found: dict) -> None:
    """P2: E must not depend on the falling mass; 10 mm are no half-space, so a heavier dart reads a little more."""
    E = {group["name"]: group["means"]["E"] for group in found["groups"]}
    assert E["10 mm, 1.343 kg"]["value"] == pytest.approx(E["10 mm, 0.743 kg"]["value"], rel=0.03)


def test_groups_and_their_ratios(found: dict) -> None:
    assert len(found["groups"]) == 5 + 1 + 2
    assert sum(group["drops"] for group in found["groups"]) == len(STUDY)
    thin = next(
        pair for pair in found["comparisons"]
        if pair["against"].startswith("1.5 mm") and pair["group"].startswith("10 mm, 0.743")
    )  # fmt: skip
    assert thin["ratios"]["F_M"]["hi"] < 0.8
    assert "smaller" in thin["ratios"]["F_M"]["text"]


def test_lenses_are_ranked_without_plate_theory(tmp_path: Path) -> None:
    rows, records = ["file,v0,u_v0,specimen_id,specimen.material"], []
    for k, (material, load, v0) in enumerate(
        (m, load, v) for m, load in (("brittle", 1000.0), ("tough", 1900.0)) for v in (1.5, 2.0, 3.9, 4.5)
    ):
        specimen = Specimen(E_GPa=3.0, C_i=5000.0, C_d=5.0, fail_N=load)
        records.append(record(specimen, 0.503, v0, k))
        rows.append(f"{k}.csv,{v0},{0.005 * v0},l{k},{material}")
    test = TEST.replace('kind = "rigid"', 'kind = "ring"\nradius_mm = 30').replace("0.743", "0.503")
    test = test.replace('material = "PETG"', 'shape = "lens"')
    found = imported(tmp_path, rows, records, test, "lenses")
    assert found["sigma_r"] is None
    assert [row["material"] for row in found["ranking"]["rows"]] == ["tough", "brittle"]
    assert found["ranking"]["by"] == "E_a"
    assert all(run["fit"] == {} for run in found["runs"])
    failed = {run["specimen"]: run["failed"]["value"] for run in found["runs"]}
    assert [failed[f"l{k}"] for k in range(8)] == [False, False, True, True, False, False, False, True]
