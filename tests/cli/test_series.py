"""A series whose specimens fail from some speed on: where, at what load, stress and energy."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas
import pytest
from playwright.sync_api import Browser

from api import frames
from api.figure_series import FIGURES
from daq.catalog import Catalog
from daq.store import Store
from sim_device.fall import Motion
from sim_device.sensors import signal, white
from sim_device.settings import Hang, Rig, Sensor, Specimen

DROPTOWER = Path(sys.executable).with_name("droptower")
TEST = """
[dart]
mass_kg = 0.503
tip_radius_mm = 6.35
[specimen]
thickness_mm = 4.6
nu = 0.30
[support]
kind = "ring"
radius_mm = 30
[drop]
catcher = true
"""
SPEEDS = (2.6, 3.0, 3.3, 3.5, 3.7, 4.0)


@pytest.fixture(scope="module")
def series_data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with six CR-39 plates that fail at 1,800 N."""
    here = tmp_path_factory.mktemp("series")
    rows = ["file,v0,u_v0"]
    for k, v0 in enumerate(SPEEDS):
        specimen = Specimen(E_GPa=3.4, C_i=5000.0, C_d=10.0, fail_N=1800.0)
        sensor = Sensor(noise_N=5, ringing=0.02)
        rig = Rig(specimen=specimen, drop=Hang(None, v0, catcher=True), sensor=sensor)
        motion = Motion(rig)
        force = signal(rig, motion, 0, -1.5e-3, 2e-6, 4000) + 5 * white((k,), 0, 4000)
        table = np.column_stack((np.arange(4000) * 2e-6, force))
        np.savetxt(here / f"{k}.csv", table, delimiter=",", header="time_s,force_N", comments="", fmt="%.9g")
        rows.append(f"{k}.csv,{v0},{0.005 * v0}")
    (here / "drops.csv").write_text("\n".join(rows) + "\n")
    (here / "test.toml").write_text(TEST)
    files = [here / f"{k}.csv" for k in range(len(SPEEDS))]
    data = ["--data", here / "data"]
    command = [
        "import",
        *files,
        "--test",
        here / "test.toml",
        "--table",
        here / "drops.csv",
        "--series",
        "CR-39",
        *data,
    ]
    subprocess.run([DROPTOWER, *command], check=True, capture_output=True)
    return here / "data"


@pytest.fixture(scope="module")
def found(series_data: Path) -> dict:
    """The answer of the series."""
    data = ["--data", series_data]
    done = subprocess.run([DROPTOWER, "series", "CR-39", *data, "--json"], check=True, capture_output=True, text=True)
    shown = subprocess.run([DROPTOWER, "series", "CR-39", *data], check=True, capture_output=True, text=True)
    assert "v0_fail" in shown.stdout
    assert "speed at which half" in shown.stdout
    return json.loads(done.stdout)


def test_the_bracket_and_the_interval(found: dict) -> None:
    failing = {r["v0"]["value"]: r["failed"]["value"] for r in found["runs"]}
    first = min(v for v, failed in failing.items() if failed)
    assert found["v0_failed_min"]["value"] == first
    assert found["v0_survived_max"]["value"] == max(v for v, failed in failing.items() if not failed)
    limit = found["v0_fail"]
    assert limit["lo"] < found["v0_survived_max"]["value"] < limit["value"] < first < limit["hi"]
    assert found["E_a"]["value"] == pytest.approx(0.5 * 0.503 * limit["value"] ** 2)


def test_load_stress_and_energy_at_failure(found: dict) -> None:
    assert found["F_rupture"]["value"] == pytest.approx(1800, rel=0.02)
    assert found["sigma_r"]["value"] == pytest.approx(198.9e6, rel=0.02)
    assert found["sigma_r_as_published"]["value"] == pytest.approx(142.0e6, rel=0.02)
    assert 2.0 < found["E_a_prime"]["value"] < 3.5
    assert found["F_rupture"]["n"] == sum(bool(r["failed"]["value"]) for r in found["runs"])


def test_what_survived_is_fitted_together(found: dict) -> None:
    E = found["joint"]["one_E"]["parameters"]["E"]
    assert E["lo"] < 3.4e9 < E["hi"]


def test_the_report_is_one_file_that_needs_no_network(found: dict, tmp_path: Path, series_data: Path) -> None:
    out = tmp_path / "report.html"
    subprocess.run([DROPTOWER, "report", "CR-39", "--data", series_data, "-o", out], check=True, capture_output=True)
    text = out.read_text(encoding="utf-8")
    for loads in ("<script", "<link", 'src="', "@import", "url(http"):
        assert loads not in text
    for run in found["runs"]:
        assert run["run"] in text
    for word in ("v<sub>0,fail</sub>", "σ<sub>r</sub> as published", "SHA-256", "P1 (15)", "beyond-plate-inertia"):
        assert word in text
    wrong = [DROPTOWER, "report", "x", "--data", series_data, "-o", out]
    done = subprocess.run(wrong, capture_output=True, text=True)
    assert done.returncode == 1
    assert "no run of a series 'x'" in done.stderr


def test_the_report_opens_in_a_browser(found: dict, tmp_path: Path, series_data: Path, browser: Browser) -> None:
    out = tmp_path / "report.html"
    subprocess.run([DROPTOWER, "report", "CR-39", "--data", series_data, "-o", out], check=True, capture_output=True)
    page = browser.new_page()
    asked: list[str] = []
    page.on("request", lambda r: asked.append(r.url))
    page.goto(out.as_uri())
    assert page.locator("svg").count() == len(FIGURES) + len(found["runs"])
    width = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    page.close()
    assert width <= 0, "nothing is cut off at the right"
    assert asked == [out.as_uri()]


def test_the_load_lasts_shorter_from_the_failure_on(found: dict) -> None:
    change = found["transition"]
    assert change["v0_lo"]["value"] == found["v0_survived_max"]["value"]
    assert change["v0_hi"]["value"] == found["v0_failed_min"]["value"]
    assert change["ratio"] < 0.6
    assert change["F_M_after"]["value"] == pytest.approx(1800, rel=0.02)


def test_plate_theory_is_checked_at_failure(found: dict) -> None:
    """P1's CR-39 bends by 0.59 of its thickness at rupture."""
    words = {row["check"]: row for row in found["plate_checks"]}
    assert words["thin-plate"]["value"] == pytest.approx(4.6 / 60)
    assert words["deflection"]["value"] == pytest.approx(0.59, abs=0.05)
    assert words["deflection"]["word"] == "beyond"


def test_the_report_as_pdf(series_data: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.pdf"
    subprocess.run([DROPTOWER, "report", "CR-39", "--data", series_data, "-o", out], check=True, capture_output=True)
    content = out.read_bytes()
    assert content.startswith(b"%PDF")
    assert len(content) > 100_000, "the figures are in it"
    wrong = subprocess.run(
        [DROPTOWER, "report", "CR-39", "--data", series_data, "-o", tmp_path / "r.doc"], capture_output=True, text=True
    )
    assert wrong.returncode == 2
    assert ".html nor .pdf" in wrong.stderr


def test_tables_and_figures_of_a_series(series_data: Path, tmp_path: Path, found: dict) -> None:
    for suffix in ("csv", "parquet"):
        options = ["--table", tmp_path / f"t.{suffix}", "--plot", tmp_path / "figures"]
        subprocess.run([DROPTOWER, "series", "CR-39", "--data", series_data, *options], check=True, capture_output=True)
    read = [pandas.read_csv(tmp_path / "t.csv"), pandas.read_parquet(tmp_path / "t.parquet")]
    for table in read:
        by_run = table.set_index("run")
        for run in found["runs"]:
            row = by_run.loc[run["run"]]
            assert pytest.approx(run["F_M"]["value"]) == row.F_M
            assert bool(row.failed_counted) is run["failed"]["counted"]
            assert row.thickness == pytest.approx(4.6e-3)
    for name in FIGURES:
        assert (tmp_path / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        assert "<svg" in (tmp_path / "figures" / f"{name}.svg").read_text()


def test_frames_for_python(series_data: Path, found: dict) -> None:
    frame = frames.series(series_data, "CR-39")
    assert sorted(frame.index) == sorted(run["run"] for run in found["runs"])
    intact = next(run for run in found["runs"] if run["failed"]["value"] is False)
    data = frames.contact(series_data, intact["run"])
    assert float(data.alpha.max()) == pytest.approx(intact["alpha_M"]["value"], rel=1e-3)
    assert data.attrs["F_M"] == intact["F_M"]["value"]
    assert data.force.attrs["units"] == "N"


def test_the_operator_overrules_and_both_are_kept(series_data: Path, found: dict, tmp_path: Path) -> None:
    data = tmp_path / "data"
    shutil.copytree(series_data, data)
    run = next(run["run"] for run in found["runs"] if run["failed"]["value"] is True)
    said = ["--author", "A. Operator", "--reason", "looked at it"]
    change = ["--set", "measured.failure_type=YU", "--set", "specimen.material=CR-39 aged"]
    subprocess.run([DROPTOWER, "correct", run, "--data", data, *change, *said], check=True, capture_output=True)
    done = subprocess.run(
        [DROPTOWER, "analyze", run, "--data", data, "--json"], check=True, capture_output=True, text=True
    )
    findings = json.loads(done.stdout)["findings"]
    assert findings["failure_type"]["value"] == "NY"
    assert findings["failure_type_operator"]["value"] == "YU"
    assert (data / "runs" / run / "test-0002.toml").read_text().count("A. Operator") == 1
    assert next(r for r in Catalog(Store(data)).runs() if r.run == run).material == "CR-39 aged"
    wrong = ["--set", "measured.failure_type=broken", *said]
    refused = subprocess.run([DROPTOWER, "correct", run, "--data", data, *wrong], capture_output=True, text=True)
    assert refused.returncode == 1
    assert "failure_type" in refused.stderr
    assert not (data / "runs" / run / "test-0003.toml").exists()
    assert subprocess.run([DROPTOWER, "verify", "--data", data], capture_output=True).returncode == 0
