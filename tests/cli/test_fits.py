"""Fits from the command line and by REST; what will not fit is told before the specimen is spent."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from emulator import Emulator
from rigs import write_rig, write_test

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "bench"))
from coverage_fits import drawn

DROPTOWER = Path(sys.executable).with_name("droptower")
TEST = """
[dart]
mass_kg = 0.503
u_mass_kg = 0.0005
tip_radius_mm = 6.35
[specimen]
thickness_mm = 4.6
u_thickness_mm = 0.02
nu = 0.30
diameter_mm = 70
E_static_GPa = 2.2
[support]
kind = "ring"
radius_mm = 30
[drop]
v0 = 1.95
u_v0 = 0.01
[measured]
imprint_diameter_mm = 3.0
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data folder with one drop: E 3.4 GPa, C_i 4500 kg/s."""
    here = tmp_path_factory.mktemp("fit")
    drop = drawn("flexed plate", np.random.default_rng(4), E_GPa=3.4, C=4500.0, v0=1.95)
    table = np.column_stack((np.arange(drop.record.force.size) * drop.record.dt, drop.record.force))
    np.savetxt(here / "drop.csv", table, delimiter=",", header="time_s,force_N", comments="", fmt="%.9g")
    (here / "test.toml").write_text(TEST)
    run("import", here / "drop.csv", "--test", here / "test.toml", "--data", here / "data")
    return here / "data"


def run(*arguments: object, code: int = 0) -> tuple[list[dict[str, Any]], str]:
    """Objects on stdout, and stderr."""
    done = subprocess.run([DROPTOWER, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")], done.stderr


def test_analyze_gives_parameters_with_intervals_and_verdicts(folder: Path) -> None:
    ((answer,), _) = run("analyze", "--all", "--data", folder, "--json")
    fit = answer["fit"]
    assert fit["model"] == "flexed"
    for name, truth in (("E", 3.4e9), ("C_i", 4500.0)):
        p = fit["parameters"][name]
        assert p["lo"] < truth < p["hi"]
        assert p["u"] <= p["u_total"]
        assert p["verdict"] == "determined"
    assert {row["input"] for row in fit["budget"]} >= {"mass", "thickness", "nu", "gain", "v0"}
    assert answer["findings"]["alpha_perm"]["value"] > 0
    assert answer["findings"]["mark_diameter"]["unit"] == "m"
    assert [row["key"] for row in fit["measured"]] == ["E_static_GPa", "imprint_diameter_mm"]
    assert "beyond-overhang" in [w["code"] for w in answer["warnings"]]


def test_another_model_and_a_correction_are_named_and_not_kept(folder: Path) -> None:
    ((other,), _) = run("analyze", "--all", "--data", folder, "--model", "series", "--json")
    assert other["fit"]["model"] == "series"
    assert "model-misfit" in [w["code"] for w in other["warnings"]]
    ((corrected,), _) = run("analyze", "--all", "--data", folder, "--correct", "overhang", "--json")
    assert corrected["fit"]["corrections"] == ["overhang"]
    ((kept,), _) = run("analyze", "--all", "--data", folder, "--json")
    assert kept["fit"]["model"] == "flexed"
    assert kept["fit"]["corrections"] == []


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_a_fit_is_drawn(folder: Path, tmp_path: Path, suffix: str) -> None:
    name = next((folder / "runs").iterdir()).name
    run("analyze", name, "--data", folder, "--plot", tmp_path / f"fit.{suffix}")
    head = (tmp_path / f"fit.{suffix}").read_bytes()[:200]
    assert head.startswith(b"\x89PNG") if suffix == "png" else b"<?xml" in head


def _armed(tmp_path: Path, drop: str) -> list[dict[str, Any]]:
    """Events of an acquisition, up to arming."""
    with Emulator("--seed", "3") as emulator:
        rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi")
        test = write_test(tmp_path)
        text = test.read_text()
        test.write_text(text.replace("[specimen]", "[specimen]\nE_static_GPa = 3.3") + f"\n[drop]\n{drop}\n")
        command = [DROPTOWER, "acquire", "--rig", rig, "--test", test, "--data", tmp_path / "data", "--json"]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        assert process.stderr is not None
        events: list[dict[str, Any]] = []
        for line in process.stderr:
            events.append(json.loads(line))
            if events[-1]["event"] == "armed":
                process.terminate()
        process.wait()
        process.stderr.close()
    return events


def test_force_contact_and_energy_are_predicted_before_arming(tmp_path: Path) -> None:
    events = _armed(tmp_path, "energy_J = 5.0\nv0 = 1.39")
    names = [e["event"] for e in events]
    assert names.index("predicted") < names.index("armed")
    predicted = next(e for e in events if e["event"] == "predicted")
    assert 690 < predicted["findings"]["F_M"]["value"] < 770
    height = next(e for e in events if e["event"] == "height")
    assert height["height_mm"] == pytest.approx(5e3 / (0.503 * 9.80665), rel=1e-6)
    assert "energy-not-met" in [e.get("code") for e in events]
    assert "force-beyond-range" not in [e.get("code") for e in events]


def test_a_force_past_the_range_is_told_before_arming(tmp_path: Path) -> None:
    events = _armed(tmp_path, "v0 = 12.0")
    told = [e.get("code") for e in events]
    assert "force-beyond-range" in told
    assert [e["event"] for e in events].index("armed") > told.index("force-beyond-range")


def test_a_series_is_fitted_together(tmp_path: Path) -> None:
    files = []
    for k, v0 in enumerate((1.4, 2.0, 2.8)):
        drop = drawn("flexed plate", np.random.default_rng([6, k]), E_GPa=3.4, C=6000.0, v0=v0)
        table = np.column_stack((np.arange(drop.record.force.size) * drop.record.dt, drop.record.force))
        files.append(tmp_path / f"drop{k}.csv")
        np.savetxt(files[-1], table, delimiter=",", header="time_s,force_N", comments="", fmt="%.9g")
    (tmp_path / "drops.csv").write_text(
        "file,v0,u_v0\n" + "".join(f"drop{k}.csv,{v},0.01\n" for k, v in enumerate((1.4, 2.0, 2.8)))
    )
    (tmp_path / "test.toml").write_text(TEST.replace("v0 = 1.95\nu_v0 = 0.01\n", ""))
    run("import", *files, "--test", tmp_path / "test.toml", "--table", tmp_path / "drops.csv", "--series", "plates",
        "--data", tmp_path / "data")  # fmt: skip
    ((found,), _) = run("series", "plates", "--data", tmp_path / "data", "--json")
    assert sorted(r["v0"]["value"] for r in found["runs"]) == [1.4, 2.0, 2.8]
    E = found["joint"]["one_E"]["parameters"]["E"]
    assert E["lo"] < 3.4e9 < E["hi"]
    assert (
        found["joint"]["E_over_v0"]["parameters"]["n"]["lo"] < 0 < found["joint"]["E_over_v0"]["parameters"]["n"]["hi"]
    )
    _, err = run("series", "none", "--data", tmp_path / "data", code=1)
    assert "no run of a series 'none'" in err
