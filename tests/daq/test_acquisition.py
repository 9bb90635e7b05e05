"""A drop becomes a run over every wire; what does not become one ends in a named outcome and loses nothing."""

import json
import os
import signal
import subprocess
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from emulator import Emulator, until
from rigs import WIRES, Daq, write_rig, write_test

from daq.readout import CHUNK
from daq.store import Store

Start = Callable[..., Daq]


@pytest.fixture
def start(tmp_path: Path, emulator: Emulator) -> Iterator[Start]:
    """Starts acquisition on a wire of the emulator."""
    started: list[Daq] = []

    def go(
        do: str = "acquire", wire: str = "scpi_tcp", data: Path = tmp_path / "data", *more: str, **rig: float
    ) -> Daq:
        driver = wire.partition("_")[0]
        file = write_rig(tmp_path, emulator.endpoints[wire], driver, **rig)
        arguments = ["--test", str(write_test(tmp_path))] if do == "acquire" else []
        started.append(Daq(do, file, data, *arguments, *more))
        return started[-1]

    yield go
    for daq in started:
        daq.close()


def drop(daq: Daq, emulator: Emulator) -> None:
    daq.until("armed")
    emulator.do("height", v0=1.39)
    emulator.do("release")


@pytest.mark.parametrize("wire", WIRES)
def test_a_drop_becomes_a_run_bit_for_bit(wire: str, start: Start, emulator: Emulator, tmp_path: Path) -> None:
    daq = start(wire=wire)
    drop(daq, emulator)
    end = daq.end()
    assert end["event"] == "done", end
    names = [e["event"] for e in daq.events if e["event"] != "progress"]
    assert names[-4:] == ["reading", "saved", "released", "done"]
    run = Store(tmp_path / "data").read(end["run"])
    header = run.provenance["header"]
    samples = run.channels[0].samples
    assert len(samples) == 5000
    assert zlib.crc32(samples.astype("<i2").tobytes()) == header["crcs"][0]
    assert run.first_sample_ns == -1_000_000
    assert len(run.gate_edges_ns) >= 2
    assert all(edge < 0 for edge in run.gate_edges_ns[:2])
    assert samples[:490].max() < 60 / 0.390625 <= samples[500:520].max(), "the trigger stands at the pre-trigger sample"
    assert "held" not in state_of(emulator)


def test_progress_is_told_while_a_record_is_read(start: Start, emulator: Emulator) -> None:
    daq = start(samples=100_000)
    drop(daq, emulator)
    daq.end()
    progress = [(e["done"], e["total"]) for e in daq.events if e["event"] == "progress"]
    assert progress[0] == (CHUNK, 100_000)
    assert progress[-1] == (100_000, 100_000)
    assert progress == sorted(progress)


def test_no_trigger_is_bounded_and_the_rig_is_ready_again(start: Start, emulator: Emulator) -> None:
    end = start(wait_s=0.2).end()
    assert (end["event"], end["outcome"]) == ("failed", "no-trigger")
    again = start()
    drop(again, emulator)
    assert again.end()["event"] == "done"


def test_an_armed_rig_can_be_disarmed(start: Start, emulator: Emulator, tmp_path: Path) -> None:
    daq = start()
    daq.until("armed")
    daq.process.send_signal(signal.SIGTERM)
    end = daq.end()
    assert (end["event"], end["outcome"], daq.process.wait()) == ("failed", "aborted", 1)
    assert Store(tmp_path / "data").runs() == []
    assert list((tmp_path / "data" / "armed").iterdir()) == []


def test_a_record_that_came_is_saved_even_if_the_host_is_asked_to_stop(start: Start, emulator: Emulator) -> None:
    daq = start(samples=200_000)
    drop(daq, emulator)
    daq.until("triggered")
    daq.process.send_signal(signal.SIGTERM)
    assert daq.end()["event"] == "done"


def test_an_open_door_stops_arming(start: Start, emulator: Emulator) -> None:
    emulator.do("door", open=True)
    end = start().end()
    assert end["outcome"] == "interlock"
    assert "door is open" in end["text"]


def test_a_killed_host_loses_nothing(start: Start, emulator: Emulator, tmp_path: Path) -> None:
    daq = start(samples=200_000)
    drop(daq, emulator)
    armed_run = daq.events[-1]["run"]
    daq.until("triggered")
    daq.kill()
    # The recorder holds the record: no new drop may overwrite it.
    until(lambda: "held" in state_of(emulator))
    refused = start().end()
    assert (refused["event"], refused["outcome"]) == ("failed", "held")
    assert "droptower recover" in refused["text"]
    end = start("recover").end()
    assert end == {"event": "done", "at": end["at"], "run": armed_run}
    assert Store(tmp_path / "data").read(armed_run).points == 200_000
    assert start("recover").end()["run"] is None


def state_of(emulator: Emulator) -> str:
    return json.dumps(emulator.do("status")["state"])


def test_a_host_killed_between_saving_and_releasing_finds_its_run_saved(tmp_path: Path) -> None:
    state, copy = tmp_path / "state", tmp_path / "copy"
    data = tmp_path / "data"
    with Emulator("--state", state) as emulator:
        rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi")
        daq = Daq("acquire", rig, data, "--test", str(write_test(tmp_path)))
        drop(daq, emulator)
        daq.until("reading")
        daq.process.send_signal(signal.SIGSTOP)
        copy.write_bytes(state.read_bytes())  # the recorder as it is before any acknowledgement
        daq.process.send_signal(signal.SIGCONT)
        run = daq.end()["run"]
        daq.close()
        emulator.kill()
    state.write_bytes(copy.read_bytes())
    with Emulator("--state", state) as emulator:
        rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi")
        daq = Daq("recover", rig, data)
        end = daq.end()
        daq.close()
        assert [e["event"] for e in daq.events] == ["found-saved", "released", "done"]
        assert end["run"] == run
        assert Store(data).runs() == [run]


def test_a_rig_that_a_dead_host_left_armed_is_disarmed_and_armed_anew(start: Start, emulator: Emulator) -> None:
    dead = start()
    dead.until("armed")
    dead.kill()
    daq = start()
    drop(daq, emulator)
    assert daq.end()["event"] == "done"
    assert "disarming" in [e["event"] for e in daq.events]


def test_a_reset_while_armed_is_told(start: Start, emulator: Emulator) -> None:
    daq = start(wire="modbus_rtu")
    daq.until("armed")
    emulator.do("reset")
    end = daq.end()
    assert (end["event"], end["outcome"]) == ("failed", "stale")


def test_a_second_holder_is_refused_by_the_name_of_the_first(start: Start, emulator: Emulator) -> None:
    first = start()
    first.until("armed")
    end = start().end()
    assert end["outcome"] == "RigBusy"
    assert f"process {first.process.pid} (acquire" in end["text"]


def test_a_gate_that_saw_nothing_costs_no_run(start: Start, emulator: Emulator, tmp_path: Path) -> None:
    emulator.do("height", height_mm=5)  # below the beam
    daq = start()
    daq.until("armed")
    emulator.do("release")
    end = daq.end()
    assert end["event"] == "done"
    assert "gate-silent" in [e["event"] for e in daq.events]
    assert Store(tmp_path / "data").read(end["run"]).gate_edges_ns == ()


@pytest.mark.parametrize("wire", ["scpi_tcp", "modbus_tcp"])
def test_settings_that_the_recorder_refuses_are_told(wire: str, start: Start) -> None:
    end = start(wire=wire, samples=2_000_000).end()
    assert end["outcome"] == "DeviceError"
    assert "refused" in end["text"] or "exception" in end["text"]


def test_a_port_that_is_not_there_is_told(tmp_path: Path) -> None:
    for driver, port in (("scpi", "/dev/nowhere"), ("scpi", "socket://127.0.0.1:9"), ("modbus", "tcp://127.0.0.1:9")):
        daq = Daq("acquire", write_rig(tmp_path, port, driver), tmp_path / "d", "--test", str(write_test(tmp_path)))
        end = daq.end()
        daq.close()
        assert end["outcome"] == "LinkError"
        assert port in end["text"]


def test_a_device_that_is_not_what_the_file_says_is_told(start: Start, emulator: Emulator, tmp_path: Path) -> None:
    rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi")
    rig.write_text(rig.read_text().replace("[recorder]", '[recorder]\nidentity = "ACME 9000"'))
    daq = Daq("acquire", rig, tmp_path / "data", "--test", str(write_test(tmp_path)))
    end = daq.end()
    daq.close()
    assert end["outcome"] == "DeviceError"
    assert "'ACME 9000'" in end["text"]


def test_a_driver_on_the_wrong_protocol_ends_in_words(emulator: Emulator, tmp_path: Path) -> None:
    port = emulator.endpoints["modbus_tcp"].replace("tcp://", "socket://")
    daq = Daq("acquire", write_rig(tmp_path, port, "scpi"), tmp_path / "d", "--test", str(write_test(tmp_path)))
    end = daq.end()
    daq.close()
    assert end["outcome"] in ("LinkError", "NoReply", "BadReply")
    assert port in end["text"]


def test_a_full_disk_refuses_to_arm_and_after_the_drop_the_recorder_keeps_it(
    start: Start, emulator: Emulator, tmp_path: Path
) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", disk], capture_output=True).returncode:
        pytest.skip("no small disk can be mounted here")
    try:
        assert "MB free" in start("acquire", "scpi_tcp", disk, samples=1_000_000).end()["text"]
        daq = start("acquire", "scpi_tcp", disk)
        daq.until("armed")
        free = os.statvfs(disk)
        (disk / "filler").write_bytes(bytes(free.f_bavail * free.f_bsize))
        emulator.do("release")
        end = daq.end()
        assert end["outcome"] == "unsaved"
        assert "still holds the record" in end["text"]
        (disk / "filler").unlink()
        end = start("recover", "scpi_tcp", disk).end()
        assert end["event"] == "done"
        assert [c.faults for c in Store(disk).verify()] == [[]]
    finally:
        subprocess.run(["umount", disk], check=True)
