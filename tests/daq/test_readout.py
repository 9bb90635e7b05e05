"""A readout that was cut off goes on where it stopped; what cannot be had is a partial run with a map of its gaps."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from emulator import Emulator
from rigs import Daq, write_rig, write_test

from api.answer import answer_of
from daq.chunks import Chunks
from daq.readout import CHUNK
from daq.recorder import crc32
from daq.store import Store


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return tmp_path / "data"


def start(emulator: Emulator, folder: Path, do: str, wire: str = "scpi_tcp", samples: int = 5000, *more: str) -> Daq:
    rig = write_rig(folder, emulator.endpoints[wire], wire.partition("_")[0], samples=samples)
    arguments = ["--test", str(write_test(folder))] if do == "acquire" else []
    return Daq(do, rig, folder / "data", *arguments, *more)


def drop(daq: Daq, emulator: Emulator) -> str:
    run = daq.until("armed")["run"]
    emulator.do("height", v0=1.39)
    emulator.do("release")
    return run


@pytest.fixture
def slow() -> Iterator[Emulator]:
    """An emulator whose lines take four seconds for 200,000 samples."""
    with Emulator("--seed", "7", "--baud", "921600") as running:
        yield running


@pytest.mark.parametrize("wire", ["scpi_pty", "modbus_rtu"])
def test_a_killed_host_goes_on_where_it_stopped(wire: str, slow: Emulator, tmp_path: Path, data: Path) -> None:
    daq = start(slow, tmp_path, "acquire", wire, 100_000)
    run = drop(daq, slow)
    assert daq.until("progress")["done"] == CHUNK
    daq.until("progress")
    daq.kill()
    again = start(slow, tmp_path, "recover", wire, 100_000)
    end = again.end()
    again.close()
    daq.close()
    assert end["run"] == run
    reading = next(e for e in again.events if e["event"] == "reading")
    assert reading["noted"] == 2 * CHUNK, "so much need not be read again"
    progress = [e["done"] for e in again.events if e["event"] == "progress"]
    assert progress[0] == 3 * CHUNK, "from there on"
    assert progress == sorted(progress)
    assert progress[-1] == 100_000
    assert Store(data).read(run).missing == 0
    assert list((data / "armed").iterdir()) == []


def test_a_pulled_cable_keeps_what_was_read_and_recover_finishes(tmp_path: Path, data: Path) -> None:
    state = tmp_path / "state"
    with Emulator("--state", state, "--baud", "921600") as emulator:
        daq = start(emulator, tmp_path, "acquire", "scpi_pty", 100_000)
        run = drop(daq, emulator)
        daq.until("progress")
        emulator.kill()
        end = daq.end()
        daq.close()
    assert (end["event"], end["outcome"]) == ("failed", "LinkError")
    assert "still holds" in end["text"]
    with Emulator("--state", state) as emulator:
        again = start(emulator, tmp_path, "recover", "scpi_tcp", 100_000)  # another port, and the note is found
        end = again.end()
        again.close()
    assert end["event"] == "done"
    assert end["run"] == run
    assert Store(data).read(run).missing == 0


def test_what_cannot_be_read_is_a_partial_run_that_is_not_released(
    emulator: Emulator, tmp_path: Path, data: Path
) -> None:
    daq = start(emulator, tmp_path, "acquire", samples=5300)
    drop(daq, emulator)
    # every reply of 1,500 bytes and more is spoilt: of 5,300 samples only a last piece of 300 gets through
    emulator.do("fault", name="flip_byte", command="TRAC:DATA?", nth=1500, count=1_000_000)
    end = daq.end()
    daq.close()
    assert end["event"] == "done"
    partial = next(e for e in daq.events if e["event"] == "partial")
    assert partial["gaps"] == [[1, 0, 5000]]
    assert "released" not in [e["event"] for e in daq.events]
    store = Store(data)
    run = store.read(end["run"])
    assert (run.missing, run.channels[0].gaps) == (5000, ((0, 5000),))
    assert np.isnan(run.channels[0].calibrated()[:5000]).all()
    assert answer_of(store, end["run"])["warnings"][0]["code"] == "partial-record"
    assert [c.faults for c in store.verify()] == [[]]
    # the line is mended: the whole record is had after all
    emulator.do("clear")
    again = start(emulator, tmp_path, "recover", samples=5300)
    whole = again.end()
    again.close()
    assert store.read(whole["run"]).missing == 0
    assert whole["run"] != end["run"]
    assert "released" in [e["event"] for e in again.events]


def test_a_partial_run_can_be_settled_for(emulator: Emulator, tmp_path: Path, data: Path) -> None:
    daq = start(emulator, tmp_path, "acquire", samples=5300)
    drop(daq, emulator)
    emulator.do("fault", name="flip_byte", command="TRAC:DATA?", nth=1500, count=1_000_000)
    run = daq.end()["run"]
    daq.close()
    for arguments, released in (([], False), (["--give-up"], True)):
        again = start(emulator, tmp_path, "recover", "scpi_tcp", 5300, *arguments)
        assert again.end()["run"] == run
        again.close()
        assert ("released" in [e["event"] for e in again.events]) is released
    assert Store(data).runs() == [run]


def test_a_record_that_the_recorder_lost_is_kept_as_far_as_it_was_read(tmp_path: Path, data: Path) -> None:
    state = tmp_path / "state"
    with Emulator("--state", state, "--baud", "921600") as emulator:
        daq = start(emulator, tmp_path, "acquire", "scpi_pty", 100_000)
        run = drop(daq, emulator)
        daq.until("progress")
        os.kill(daq.process.pid, signal.SIGSTOP)
        emulator.kill()
        state.unlink()  # its memory is gone too
        os.kill(daq.process.pid, signal.SIGCONT)
        assert daq.end()["event"] == "failed"
        daq.close()
    with Emulator("--state", state) as emulator:
        again = start(emulator, tmp_path, "recover", samples=100_000)
        end = again.end()
        again.close()
    assert end["run"] == run
    kept = Store(data).read(run)
    assert kept.missing == 100_000 - CHUNK
    assert kept.channels[0].gaps == ((CHUNK, 100_000 - CHUNK),)


def test_chunks_come_back_but_for_a_torn_or_damaged_one(tmp_path: Path) -> None:
    path, record = tmp_path / "a.chunks", {"identity": "x"}
    samples = np.arange(1000, dtype=np.int16)
    chunks = Chunks(path, record)
    for start_at in (0, 1000, 2000):
        chunks.add(1, start_at, samples, crc32(samples))
    chunks.close()
    content = path.read_bytes()
    path.write_bytes(content[:-10])
    again = Chunks(path, record)
    assert [key for key, _ in again.noted()] == [(1, 0), (1, 1000)]
    again.close()
    path.write_bytes(content[:100] + b"\xff" + content[101:])
    again = Chunks(path, record)
    assert again.noted() == []
    again.close()
    path.write_bytes(content)
    other = Chunks(path, {"identity": "y"})
    assert other.noted() == []
    other.remove()
    assert not path.exists()


def test_a_disk_that_takes_no_chunks_costs_no_record(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    chunks = Chunks(tmp_path / "file" / "a.chunks", {})
    chunks.add(1, 0, np.zeros(10, dtype=np.int16), 0)
    assert chunks.noted() == []
    chunks.remove()
