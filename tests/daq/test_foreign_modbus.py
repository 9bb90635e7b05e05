"""Modbus gear by a map alone, against pymodbus's own server on TCP and RTU: a recorder, a counter as photodetector."""

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from emulator import Emulator, until
from foreign import RegisterServer, write_rig
from rigs import RIG, Daq, write_test

from api.answer import answer_of
from daq.store import Store

MAP = """driver = "modbus"
tried_on = "pymodbus's own server"
order = "low-first"
bits = 14

[registers]
state = { at = 0, type = "u16" }
record_points = { at = 2, type = "u32" }
record_interval_ns = { at = 4, type = "f32", scale = 1000 }
record_first_ns = { at = 6, type = "i32" }
points = { at = 20, type = "u32", function = 3 }

[states]
0 = "idle"
1 = "armed"
2 = "measuring"
3 = "complete"

[writes]
configure = [{ at = 20, values = ["points:u32", "pretrigger:u16"] }]
arm = [{ at = 30, values = ["1:u16"] }]
abort = [{ at = 30, values = ["0:u16"] }]

[data]
at = 1000
type = "u16"
function = 3
page = [{ at = 40, values = ["start:u32"] }]
page_samples = 2000
per_read = 100
"""
RECORDER = """[recorder]
driver = "modbus"
profile = "own.toml"
port = "{port}"
baud = 115200
sample_rate_Hz = 500e3
samples = 5000
pretrigger = 500
trigger_level = 60
wait_s = 5

[[recorder.channel]]
name = "tup"
counts_to_unit = 0.39
"""


def words(*values: int, form: str = "I") -> list[int]:
    """Registers of values, least significant word first."""
    out: list[int] = []
    for value in values:
        data = struct.pack(f">{form}", value)
        out += list(struct.unpack(f">{len(data) // 2}H", data))[::-1]
    return out


class Recorder:
    """A recorder on somebody else's server: unsigned samples behind a window of 2,000."""

    def __init__(self, rtu: bool) -> None:
        self.samples = np.random.default_rng(5).integers(0, 65536, 5000).astype(np.uint16)
        self.writes: list[tuple[int, list[int]]] = []
        self.server = RegisterServer(rtu, self._written)
        self.state = 0
        self.server.put(4, words(2, form="f"))
        self.server.put(6, words(-1_000_000, form="i"))

    def _written(self, at: int, values: list[int]) -> None:
        self.writes.append((at, values))
        if at == 30:
            self._go(values[0])
        elif at == 40:
            start = values[1] << 16 | values[0]
            page = self.samples[start : start + 2000]
            self.server.put(1000, [int(v) for v in np.pad(page, (0, 2000 - len(page)))])

    def _go(self, state: int) -> None:
        self.state = state
        self.server.put(0, [state])

    def trigger(self) -> None:
        until(lambda: self.state == 1, what="armed")
        self.server.put(2, words(5000))
        self._go(3)


@pytest.fixture(params=[False, True], ids=["tcp", "rtu"])
def recorder(request: pytest.FixtureRequest) -> Iterator[Recorder]:
    device = Recorder(request.param)
    yield device
    device.server.close()


def start(recorder: Recorder, folder: Path, do: str = "acquire") -> Daq:
    (folder / "own.toml").write_text(MAP)
    rig = write_rig(folder, RECORDER.format(port=recorder.server.port))
    arguments = ["--test", str(write_test(folder))] if do == "acquire" else []
    return Daq(do, rig, folder / "data", *arguments)


def end_of(daq: Daq) -> dict:
    end = daq.end()
    daq.close()
    return end


def test_a_record_behind_a_foreign_map_becomes_a_run(recorder: Recorder, tmp_path: Path) -> None:
    daq = start(recorder, tmp_path)
    daq.until("armed")
    recorder.trigger()
    end = end_of(daq)
    assert end["event"] == "done", end
    run = Store(tmp_path / "data").read(end["run"])
    assert np.array_equal(run.channels[0].samples, recorder.samples.astype(int) - 32768)
    assert (run.dt, run.pretrigger) == (pytest.approx(2e-6), 500)
    assert (20, [*words(5000), 500]) in recorder.writes
    assert [c.faults for c in Store(tmp_path / "data").verify()] == [[]]


def test_a_killed_host_leaves_a_record_that_is_not_armed_over(recorder: Recorder, tmp_path: Path) -> None:
    daq = start(recorder, tmp_path)
    daq.until("armed")
    daq.kill()
    daq.close()
    recorder.trigger()
    assert end_of(start(recorder, tmp_path))["outcome"] == "held"
    end = end_of(start(recorder, tmp_path, "recover"))
    assert end["event"] == "done", end
    samples = Store(tmp_path / "data").read(end["run"]).channels[0].samples
    assert np.array_equal(samples, recorder.samples.astype(int) - 32768)


def rig_with_counter(emulator: Emulator, counter: RegisterServer, folder: Path) -> Path:
    text = RIG.format(driver="scpi", port=emulator.endpoints["scpi_tcp"], samples=5000, wait_s=20)
    before, _, after = text.partition("[gate]")
    gate = f'[gate]\ndriver = "modbus"\nprofile = "modbus-counter"\nport = "{counter.port}"\n'
    gate += "flag_width_mm = 10\ngap_mm = 20\n"
    return write_rig(folder, before + gate + after[after.index("\n[interlock]") :])


@pytest.mark.parametrize("passages", [1, 0, 2])
def test_a_counter_times_the_flag_and_its_count_says_whose_time_it_is(
    emulator: Emulator, tmp_path: Path, passages: int
) -> None:
    counter = RegisterServer(rtu=False)
    counter.put(0, [0, 41])
    counter.put(4, [1])
    rig = rig_with_counter(emulator, counter, tmp_path)
    daq = Daq("acquire", rig, tmp_path / "data", "--test", str(write_test(tmp_path)))
    daq.until("armed")
    emulator.do("height", v0=1.39)
    # The flag's 10 mm at the speed that the dart has 20 mm above contact.
    at_gate = (1.39**2 - 2 * 9.80665 * 0.02) ** 0.5
    if passages:
        counter.put(0, [0, 41 + passages])
        counter.put(2, [0, round(0.01 / at_gate * 1e6)])
    emulator.do("release")
    end = daq.end()
    daq.close()
    counter.close()
    store = Store(tmp_path / "data")
    silent = [e for e in daq.events if e["event"] == "gate-silent"]
    if passages != 1:
        assert "does not belong" in silent[0]["text"]
        assert store.read(end["run"]).gate_edges_ns == ()
        return
    assert not silent
    run = store.read(end["run"])
    assert not run.gate_on_clock
    found = answer_of(store, end["run"])["findings"]["v0"]
    assert found["value"] == pytest.approx(1.39, abs=3e-3)
    assert 0 < found["u"] < 0.02
