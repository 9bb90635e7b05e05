"""The contact is read before the rest, and shown; in whatever order a record is read, it is the same record."""

import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from emulator import Emulator
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rigs import Daq, write_rig, write_test

from api.early import start, window_of
from daq.chunks import Chunks
from daq.readout import Gap, read_record
from daq.recorder import Chunk, Header, Status, crc32
from daq.rig_file import load_rig
from daq.store import Store
from daq.test_file import load_test

SAMPLES = 100_000


@pytest.mark.parametrize("wire", ["scpi_pty", "modbus_rtu"])
def test_the_contact_shows_while_the_rest_is_read(wire: str, tmp_path: Path) -> None:
    data = tmp_path / "data"
    with Emulator("--seed", "7", "--baud", "921600") as emulator:
        emulator.do("height", v0=1.39)
        rig = write_rig(tmp_path, emulator.endpoints[wire], wire.partition("_")[0], samples=SAMPLES)
        test = write_test(tmp_path)
        first = window_of(load_rig(rig)[0], load_test(test)[0])
        assert first is not None
        drop = start(rig, test, data, None)
        truth: dict[str, float] = {}
        for event in drop:
            if event["event"] == "armed":
                truth = emulator.do("release")["truth"]
        names = [e["event"] for e in drop.events]
        assert names.index("preliminary") < names.index("saved")
        assert names[names.index("window") + 1 :].count("progress") >= 2, "the rest came later"
        early = next(e for e in drop.events if e["event"] == "preliminary")["findings"]
        for symbol in ("F_M", "t_c", "v0", "alpha_M", "eps_exact"):
            found = early[symbol]
            assert abs(found["value"] - truth[symbol]) < 5 * found["u"], symbol
        progress = [e for e in drop.events if e["event"] == "progress"]
        assert progress[-1]["done"] == SAMPLES
        assert progress[-1]["left_s"] == 0
        assert all(a["bytes"] < b["bytes"] and b["rate_B_s"] > 0 for a, b in pairwise(progress))
        run = drop.result()["run"]
    whole = Store(data).read(run)
    assert not whole.missing
    assert crc32(whole.channels[0].samples) == whole.provenance["header"]["crcs"][0]


def test_the_window_holds_the_contact_of_soft_and_stiff_specimens(tmp_path: Path) -> None:
    rig = write_rig(tmp_path, "socket://127.0.0.1:1", "scpi", samples=250_000)
    test = write_test(tmp_path)
    window = window_of(load_rig(rig)[0], load_test(test)[0])
    assert window is not None
    # CR-39 lasts 3 ms, 1,500 samples; a window that is cut short would say nothing of its end.
    assert window[0] == 0
    assert 500 + 1500 < window[1] < 50_000
    short = write_rig(tmp_path, "socket://127.0.0.1:1", "scpi", samples=5_000)
    assert window_of(load_rig(short)[0], load_test(test)[0]) is None, "all of a short record is read at once"


class Memory:
    """A recorder's memory that loses some answers; the rest of a device is not asked for."""

    def __init__(self, channels: list[np.ndarray], silent: set[int]) -> None:
        self.channels, self._silent, self._asked = channels, silent, 0
        crcs = tuple(crc32(c) for c in channels)
        self._header = Header(1, 1, 1, len(channels[0]), 2000, -1000, 0, 14, crcs)

    def header(self) -> Header:
        return self._header

    def resynchronise(self) -> None:
        pass

    def status(self) -> Status:
        raise AssertionError("a chunk brings the state with it")

    def chunk(self, channel: int, start: int, count: int) -> Chunk:
        from daq.errors import BadReply

        self._asked += 1
        if self._asked in self._silent:
            raise BadReply("spoiled")
        samples = self.channels[channel - 1][start : start + count]
        return Chunk(samples, crc32(samples), 1)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    points=st.integers(1, 60_000),
    channels=st.integers(1, 3),
    window=st.tuples(st.integers(0, 70_000), st.integers(0, 70_000)),
    silent=st.sets(st.integers(1, 12), max_size=4),
    noted=st.lists(st.tuples(st.integers(1, 3), st.integers(0, 59_999), st.integers(1, 20_000)), max_size=3),
)
def test_any_order_and_any_lost_answer_give_the_same_record(
    tmp_path: Path,
    points: int,
    channels: int,
    window: tuple[int, int],
    silent: set[int],
    noted: list[tuple[int, int, int]],
) -> None:
    rng = np.random.default_rng(points)
    memory = Memory([rng.integers(-8192, 8191, points).astype(np.int16) for _ in range(channels)], silent)
    path = tmp_path / "chunks"
    path.unlink(missing_ok=True)
    before = Chunks(path, memory.header().as_json())
    for channel, at, count in noted:
        if channel <= channels and at < points:
            part = memory.channels[channel - 1][at : at + count]
            before.add(channel, at, part, crc32(part))
    before.close()
    chunks = Chunks(path, memory.header().as_json())
    readout = read_record(memory, memory.header(), chunks, lambda done, total: None, window)  # pyright: ignore
    chunks.close()
    assert readout.gaps == ()
    for got, wanted in zip(readout.channels, memory.channels, strict=True):
        assert np.array_equal(got, wanted)


def test_what_never_comes_is_in_the_map_whatever_the_order(tmp_path: Path) -> None:
    samples = np.arange(30_000, dtype=np.int16)
    memory = Memory([samples], set())
    answer = memory.chunk

    def with_a_hole(channel: int, start: int, count: int) -> Chunk:
        from daq.errors import BadReply

        if start < 12_000 < start + count:
            raise BadReply("never")
        return answer(channel, start, count)

    memory.chunk = with_a_hole  # type: ignore[method-assign]
    chunks = Chunks(tmp_path / "chunks", memory.header().as_json())
    readout = read_record(memory, memory.header(), chunks, lambda done, total: None, (11_500, 13_000))  # pyright: ignore
    chunks.close()
    assert readout.gaps == (Gap(1, 11_500, 1000),)


def test_a_window_that_is_none_is_told(tmp_path: Path) -> None:
    rig = write_rig(tmp_path, "socket://127.0.0.1:1", "scpi")
    command = [sys.executable, "-m", "daq", "acquire", "--rig", rig, "--data", tmp_path, "--test", write_test(tmp_path)]
    done = subprocess.run([*command, "--first", "9:3"], capture_output=True, text=True)
    assert done.returncode == 2
    assert "START:STOP" in done.stderr


def test_without_a_window_the_record_is_read_in_order(emulator: Emulator, tmp_path: Path) -> None:
    emulator.do("height", v0=1.39)
    rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi", samples=SAMPLES)
    daq = Daq("acquire", rig, tmp_path / "data", "--test", str(write_test(tmp_path)))
    daq.until("armed")
    emulator.do("release")
    daq.end()
    daq.close()
    assert "window" not in [e["event"] for e in daq.events]
    log = next((tmp_path / "data" / "log").iterdir())
    assert all(json.loads(line)["event"] != "progress" for line in log.read_text().splitlines())
