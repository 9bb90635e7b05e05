"""Oscilloscopes as recorders, by profile alone: nothing is lost although they count, check and keep nothing."""

import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import pyvisa
from foreign import LineServer, Oscilloscope, write_rig
from rigs import Daq, write_test

from daq.store import Store

RIG = """[recorder]
driver = "scpi"
profile = "rigol-ds1000z"
port = "{port}"
sample_rate_Hz = 500e3
samples = 12000
pretrigger = 3000
trigger_level = 100
wait_s = 5

[[recorder.channel]]
name = "tup"
volts_to_unit = 400
u_volts_to_unit = 2
range = 1600

[[recorder.channel]]
name = "second tup"
volts_to_unit = 410
range = 1600
"""


@pytest.fixture
def scope() -> Iterator[Oscilloscope]:
    instrument = Oscilloscope()
    yield instrument
    instrument.close()


@pytest.fixture
def data(tmp_path: Path) -> Path:
    return tmp_path / "data"


def start(scope: Oscilloscope, folder: Path, do: str, *more: str) -> Daq:
    rig = write_rig(folder, RIG.format(port=scope.port))
    arguments = ["--test", str(write_test(folder))] if do == "acquire" else []
    return Daq(do, rig, folder / "data", *arguments, *more)


def end_of(daq: Daq) -> dict:
    end = daq.end()
    daq.close()
    return end


def drop(scope: Oscilloscope, folder: Path, seed: int = 1) -> dict:
    daq = start(scope, folder, "acquire")
    daq.until("armed")
    scope.trigger(seed)
    return end_of(daq)


def exact(scope: Oscilloscope, store: Store, run: str) -> bool:
    kept = store.read(run).channels
    return all(np.array_equal(c.samples, m.astype(int) - 128) for c, m in zip(kept, scope.memory, strict=True))


def test_a_record_of_an_oscilloscope_becomes_a_run(scope: Oscilloscope, tmp_path: Path, data: Path) -> None:
    end = drop(scope, tmp_path)
    assert end["event"] == "done", end
    store = Store(data)
    assert exact(scope, store, end["run"])
    run = store.read(end["run"])
    # Volts as the preamble has them, newtons by the rig file.
    volts = (scope.memory[0].astype(float) - 127) * 0.04
    assert run.channels[0].calibrated() == pytest.approx(400 * volts)
    assert run.channels[1].calibrated().max() == pytest.approx(410 * (float(scope.memory[1].max()) - 127) * 0.04)
    assert run.channels[0].calibration.u["counts_to_unit"] == pytest.approx(0.04 * 2)
    assert (run.dt, run.pretrigger, run.points) == (pytest.approx(2e-6), 3000, 12_000)
    assert run.provenance["proven_by"] == "every chunk read twice"
    assert "rigol-ds1000z" in run.provenance["profile"]
    assert [c.faults for c in store.verify()] == [[]]


def test_a_chunk_that_two_readings_tell_differently_is_read_again(scope: Oscilloscope, tmp_path: Path, data: Path):
    daq = start(scope, tmp_path, "acquire")
    daq.until("armed")
    scope.spoil = 1
    scope.trigger()
    end = end_of(daq)
    assert exact(scope, Store(data), end["run"])


def test_a_record_whose_host_was_killed_is_not_armed_over_and_recovered(
    scope: Oscilloscope, tmp_path: Path, data: Path
):
    daq = start(scope, tmp_path, "acquire")
    run = daq.until("armed")["run"]
    daq.kill()
    daq.close()
    scope.trigger()
    again = end_of(start(scope, tmp_path, "acquire"))
    assert again["outcome"] == "held"
    assert "recover" in again["text"]
    assert scope.commands.count(":SING") == 1
    end = end_of(start(scope, tmp_path, "recover"))
    assert (end["event"], end["run"]) == ("done", run)
    assert exact(scope, Store(data), run)
    assert drop(scope, tmp_path, 2)["event"] == "done"
    assert len(Store(data).runs()) == 2


@pytest.mark.parametrize("step", ["triggered", "reading", "saved"])
def test_a_host_that_is_killed_later_leaves_one_run_too(scope: Oscilloscope, tmp_path: Path, data: Path, step: str):
    daq = start(scope, tmp_path, "acquire")
    daq.until("armed")
    threading.Timer(0.1, scope.trigger).start()
    for event in daq:
        # An oscilloscope that is quick goes from waiting to stopped, and nobody sees it measure.
        if event["event"] == step or (step == "triggered" and event["event"] == "reading"):
            daq.kill()
            break
    daq.close()
    end = end_of(start(scope, tmp_path, "recover"))
    assert end["event"] == "done"
    runs = Store(data).runs()
    assert len(runs) == 1
    assert exact(scope, Store(data), runs[0])
    assert drop(scope, tmp_path, 2)["event"] == "done"


def test_a_record_taken_by_hand_is_asked_about(scope: Oscilloscope, tmp_path: Path, data: Path) -> None:
    assert drop(scope, tmp_path)["event"] == "done"
    scope.capture(7)
    refused = end_of(start(scope, tmp_path, "acquire"))
    assert refused["outcome"] == "held"
    asked = end_of(start(scope, tmp_path, "recover"))
    assert "--test" in asked["text"]
    end = end_of(start(scope, tmp_path, "recover", "--test", str(write_test(tmp_path))))
    assert exact(scope, Store(data), end["run"])
    scope.capture(8)
    assert end_of(start(scope, tmp_path, "recover", "--give-up"))["event"] == "done"
    assert len(Store(data).runs()) == 2
    assert drop(scope, tmp_path, 9)["event"] == "done"


def test_no_trigger_is_told_and_the_oscilloscope_stopped(scope: Oscilloscope, tmp_path: Path) -> None:
    rig = write_rig(tmp_path, RIG.format(port=scope.port).replace("wait_s = 5", "wait_s = 0.3"))
    daq = Daq("acquire", rig, tmp_path / "data", "--test", str(write_test(tmp_path)))
    assert end_of(daq)["outcome"] == "no-trigger"
    assert scope.state == "STOP"


def test_a_setting_that_it_does_not_take_is_told(scope: Oscilloscope, tmp_path: Path) -> None:
    rig = write_rig(tmp_path, RIG.format(port=scope.port).replace("samples = 12000", "samples = 12001"))
    answer = scope.answer

    def rounded(line: str) -> bytes:
        return answer(":ACQ:MDEP 12000" if line == ":ACQ:MDEP 12001" else line)

    scope._server._answer = rounded
    end = end_of(Daq("acquire", rig, tmp_path / "data", "--test", str(write_test(tmp_path))))
    assert "points: asked 12001, got 12000" in end["text"]


def test_check_says_what_the_oscilloscope_cannot_do(scope: Oscilloscope, tmp_path: Path) -> None:
    daq = start(scope, tmp_path, "check")
    end = daq.end()
    daq.close()
    rows = {e["name"]: (e["ok"], e["text"]) for e in daq.events if e["event"] == "check"}
    assert end["event"] == "done", end
    assert "ledger" in rows["acknowledgement"][1]
    assert "twice" in rows["CRC"][1]
    assert "stand-in" in rows["profile"][1]
    assert ":SING" not in scope.commands, "nothing that is there is armed over"


def test_a_state_that_the_profile_does_not_know_is_named(scope: Oscilloscope, tmp_path: Path) -> None:
    scope.state = "ROLL"
    end = end_of(start(scope, tmp_path, "acquire"))
    assert "'ROLL'" in end["text"]
    assert "WAIT" in end["text"]


SIMULATED = """spec: "1.1"
devices:
  scope:
    eom:
      TCPIP INSTR: {q: "\\n", r: "\\n"}
    error: "ERROR"
    dialogues:
      - {q: "*IDN?", r: "SOMEBODY,ELSES,1,2"}
      - {q: "CURV?", r: "SAMPLES"}
    properties:
      state:
        default: READY
        getter: {q: "STATE?", r: "{}"}
        setter: {q: "STATE {}"}
      points:
        default: 2000
        getter: {q: "POIN?", r: "{}"}
        setter: {q: "POIN {}"}
        specs: {min: 100, max: 5000, type: int}
resources:
  TCPIP0::localhost::inst0::INSTR: {device: scope}
"""
OWN = """driver = "scpi"
tried_on = "pyvisa-sim"
configure = ["POIN {points}"]
arm = ["STATE ARMED"]
abort = ["STATE READY"]

[settings]
points = "POIN?"

[status]
query = "STATE?"
states = { READY = "idle", ARMED = "armed", DONE = "complete" }

[header]
query = "POIN?"
fields = ["points"]
bits = 14
interval_ns = 2000
first_ns = -1000000

[data]
query = "CURV?"
form = "ascii"
most = 5000
"""


def test_an_instrument_of_pyvisa_sim_is_driven_by_a_profile_of_ones_own(tmp_path: Path) -> None:
    """It answers with text alone and its memory in one piece; the wire is a socket in front of it."""
    samples = np.random.default_rng(3).integers(-8000, 8000, 2000)
    (tmp_path / "scope.yaml").write_text(SIMULATED.replace("SAMPLES", ",".join(map(str, samples))))
    (tmp_path / "own.toml").write_text(OWN)
    manager = pyvisa.ResourceManager(f"{tmp_path / 'scope.yaml'}@sim")
    scope = manager.open_resource("TCPIP0::localhost::inst0::INSTR", read_termination="\n", write_termination="\n")
    lock = threading.Lock()

    def answer(line: str) -> bytes:
        with lock:
            return scope.query(line).encode() + b"\n" if line.endswith("?") else bool(scope.write(line)) * b""

    server = LineServer(answer)
    rig = write_rig(
        tmp_path,
        f'[recorder]\ndriver = "scpi"\nprofile = "own.toml"\nport = "{server.port}"\nsample_rate_Hz = 500e3\n'
        f"samples = 2000\npretrigger = 500\ntrigger_level = 60\nwait_s = 5\n"
        f'[[recorder.channel]]\nname = "tup"\ncounts_to_unit = 0.39\n',
    )
    daq = Daq("acquire", rig, tmp_path / "data", "--test", str(write_test(tmp_path)))
    daq.until("armed")
    with lock:
        scope.write("STATE DONE")
    end = end_of(daq)
    assert end["event"] == "done", end
    run = Store(tmp_path / "data").read(end["run"])
    assert run.channels[0].samples.tolist() == samples.tolist()
    assert (run.dt, run.pretrigger) == (pytest.approx(2e-6), 500)
    server.close()
    scope.close()
    manager.close()
