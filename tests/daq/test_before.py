"""What is told while the specimen is still whole."""

import json
from collections.abc import Iterator
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import pytest
from emulator import Emulator, until
from rigs import Daq, write_rig, write_test

from api.answer import answer_of
from daq.history import FEWEST
from daq.store import Store

Events = list[dict[str, Any]]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return tmp_path / "data"


@pytest.fixture(scope="module")
def one_emulator() -> Iterator[Emulator]:
    with Emulator("--seed", "7") as running:
        yield running


@pytest.fixture
def emulator(one_emulator: Emulator) -> Emulator:
    one_emulator.fresh()
    one_emulator.do("height", v0=1.39)
    return one_emulator


def take(emulator: Emulator, folder: Path, *more: str, rig: str = "", test: str = "", again: bool = True) -> Events:
    """A drop with lines added to the first channel of the rig file, and to the test file; what was said."""
    rig_file = write_rig(folder, emulator.endpoints["scpi_tcp"], "scpi")
    rig_file.write_text(rig_file.read_text().replace("range = 3200", f"range = 3200\n{rig}"))
    test_file = write_test(folder)
    test_file.write_text(test_file.read_text() + test)
    daq = Daq("acquire", rig_file, folder / "data", "--test", str(test_file), *more, again=again)
    for event in daq:
        if event["event"] == "armed":
            emulator.do("release")
    daq.close()
    until(lambda: not emulator.do("status")["moving"])
    return daq.events


def told(events: Events) -> dict[str, str]:
    return {e["code"]: e["text"] for e in events if e["event"] == "warning"}


def test_a_good_rig_is_told_nothing(emulator: Emulator, tmp_path: Path) -> None:
    events = take(emulator, tmp_path, test="[drop]\ncatcher = true\n")
    assert events[-1]["event"] == "done"
    assert told(events) == {}


@pytest.mark.parametrize(("days", "code"), [(-1, "calibration-expired"), (10, "calibration-due"), (100, None)])
def test_a_calibration_that_is_over_or_soon_will_be(emulator: Emulator, tmp_path: Path, days: int, code: str | None):
    due = date.today() + timedelta(days=days)
    events = take(emulator, tmp_path, rig=f'calibration_due = "{due}"', test="[drop]\ncatcher = true\n")
    assert list(told(events)) == ([code] if code else [])
    run = events[-1]["run"]
    warned = [w["code"] for w in answer_of(Store(tmp_path / "data"), run)["warnings"]]
    assert (code in warned) == bool(code), "the run knows it too"


def test_a_gate_that_reads_nothing_is_told_before_arming(emulator: Emulator, tmp_path: Path) -> None:
    # The flag hangs in the beam.
    emulator.do("fault", name="gate_missing", count=None)
    emulator.do("height", height_mm=20)
    events = take(emulator, tmp_path)
    names = [e["event"] for e in events]
    assert "gate-silent" in names


def test_zero_level_and_noise_are_judged_by_the_last_drops(emulator: Emulator, tmp_path: Path, data: Path) -> None:
    for _ in range(FEWEST):
        assert set(told(take(emulator, tmp_path))) <= {"catcher-on"}
    emulator.do("sensor", offset_N=45, noise_N=9)
    events = take(emulator, tmp_path)
    assert {"baseline-drift", "noise-high"} <= set(told(events))
    assert "+10" in told(events)["baseline-drift"], "40 N are 102 counts"
    assert events[-1]["event"] == "done", "told, not refused"


def test_a_tare_is_what_drift_is_judged_by(emulator: Emulator, tmp_path: Path, data: Path) -> None:
    rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi")
    tare = Daq("check", rig, data, "--tare")
    assert tare.end()["event"] == "done"
    tare.close()
    assert "baseline-drift" not in told(take(emulator, tmp_path))
    emulator.do("sensor", offset_N=-40)
    assert "tare" in told(take(emulator, tmp_path))["baseline-drift"]
    again = Daq("check", rig, data, "--tare")
    again.end()
    again.close()
    assert "baseline-drift" not in told(take(emulator, tmp_path))


def test_a_damaged_history_is_told_and_begun_anew(emulator: Emulator, tmp_path: Path, data: Path) -> None:
    take(emulator, tmp_path)
    (path,) = (data / "history").iterdir()
    path.write_text("{")
    assert "history-lost" in told(take(emulator, tmp_path))
    assert len(json.loads(path.read_text())["tup"]["zero"]) == 1


def test_the_catcher_and_the_test_file_have_to_agree(emulator: Emulator, tmp_path: Path, data: Path) -> None:
    emulator.do("catcher", on=True)
    refused = take(emulator, tmp_path, test="[drop]\ncatcher = false\n")[-1]
    assert (refused["event"], refused["outcome"]) == ("failed", "catcher")
    assert "catcher = true" in refused["text"]
    events = take(emulator, tmp_path)
    assert "catcher-on" in told(events)
    assert Store(data).read(events[-1]["run"]).provenance["catcher"] is True
    emulator.do("catcher", on=False)
    assert "catcher-off" in told(take(emulator, tmp_path, test="[drop]\ncatcher = true\n"))
    emulator.do("catcher", on=True)


def test_a_specimen_is_hit_once(emulator: Emulator, tmp_path: Path, data: Path) -> None:
    first = take(emulator, tmp_path, again=False)[-1]
    assert first["event"] == "done"
    second = take(emulator, tmp_path, again=False)[-1]
    assert second["outcome"] == "specimen"
    assert first["run"] in second["text"]
    assert "--again" in second["text"]
    assert take(emulator, tmp_path)[-1]["event"] == "done"


def test_a_quiet_record_of_a_killed_host_is_nobodys_specimen(emulator: Emulator, tmp_path: Path, data: Path) -> None:
    rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi")
    emulator.do("fault", name="stall", command="TRAC:DATA?", nth=10, seconds=0.8)
    daq = Daq("acquire", rig, data, "--test", str(write_test(tmp_path)))
    until(lambda: emulator.do("status")["held"])
    daq.kill()
    daq.close()
    emulator.do("clear")
    events = take(emulator, tmp_path)
    assert "quiet-record-released" in [e["event"] for e in events]
    assert events[-1]["event"] == "done"
    assert len(Store(data).runs()) == 1


def test_every_outcome_is_in_the_log(emulator: Emulator, tmp_path: Path, data: Path) -> None:
    emulator.do("door", open=True)
    take(emulator, tmp_path)
    emulator.do("door", open=False)
    rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi", wait_s=0.3)
    daq = Daq("acquire", rig, data, "--test", str(write_test(tmp_path)))
    daq.end()
    daq.close()
    (log,) = (data / "log").iterdir()
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert [line["outcome"] for line in lines if line["event"] == "failed"] == ["interlock", "no-trigger"]
    assert {line["specimen"] for line in lines} == {"s-1"}


def checked(emulator: Emulator, folder: Path, peak_N: float | None, *more: str) -> dict[str, tuple[bool, str]]:
    rig = write_rig(folder, emulator.endpoints["scpi_tcp"], "scpi")
    daq = Daq("check", rig, folder / "data", "--tap", *more)
    for event in daq:
        if event["event"] == "tap-now" and peak_N is not None:
            until(lambda: emulator.do("status")["state"] == "armed")
            emulator.do("tap", peak_N=peak_N)
    daq.close()
    assert emulator.do("status")["state"] == "idle"
    return {e["name"]: (e["ok"], e["text"]) for e in daq.events if e["event"] == "check"}


def test_a_tap_shows_trigger_and_polarity(emulator: Emulator, tmp_path: Path) -> None:
    rows = checked(emulator, tmp_path, 120)
    assert rows["tap"][0]
    assert "1" in rows["tap"][1]
    assert rows["polarity"] == (True, "a push reads positive")


def test_a_tup_the_wrong_way_round_is_told(emulator: Emulator, tmp_path: Path) -> None:
    rows = checked(emulator, tmp_path, -120)
    assert rows["tap"][0]
    assert not rows["polarity"][0]
    assert "counts_to_unit" in rows["polarity"][1]


def test_a_dead_tup_is_told(emulator: Emulator, tmp_path: Path) -> None:
    rows = checked(emulator, tmp_path, None)
    assert not rows["tap"][0]
    assert "cable" in rows["tap"][1]
