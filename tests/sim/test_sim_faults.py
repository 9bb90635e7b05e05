"""What every fault promises: it acts where, when and as often as it is told, and goes when it is removed."""

from __future__ import annotations

import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from clients import Modbus, ModbusError, Scpi, Tcp, arm, record, take
from emulator import ROOT, Emulator, until


@pytest.fixture
def scpi(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as client:
        yield client


def acted(emulator: Emulator) -> list[int]:
    return [fault["acted"] for fault in emulator.do("status")["faults"]]


def test_a_byte_is_flipped_in_the_reply_to_one_command_as_often_as_told(shared_emulator: Emulator, scpi: Scpi):
    take(shared_emulator, scpi)
    good = scpi.block("TRAC:DATA? CH1,0,200")
    shared_emulator.do("fault", name="flip_byte", command="TRACe:DATA?", nth=100, bit=7, count=2)
    for _ in range(2):
        assert scpi.ask("*OPC?") == "1"
        bad = scpi.block("TRAC:DATA? CH1,0,200")
        # The head "#3400" is five bytes.
        assert [k for k in range(400) if bad[k] != good[k]] == [94]
        assert bad[94] == good[94] ^ 0x80
    assert scpi.block("TRAC:DATA? CH1,0,200") == good
    assert acted(shared_emulator) == [2]


def test_a_byte_is_lost_where_the_seed_says(shared_emulator: Emulator, scpi: Scpi):
    whole = scpi.ask("*IDN?")
    replies = []
    for _ in range(2):
        shared_emulator.do("fault", name="drop_byte", command="*IDN?", seed=4)
        scpi.send("*IDN?")
        replies.append(scpi.port.read(len(whole)))
        shared_emulator.do("clear")
    assert replies[0] == replies[1] != whole.encode() + b"\n"
    assert scpi.ask("*IDN?") == whole


def test_the_line_stalls_before_a_byte_and_then_goes_on(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="stall", command="*IDN?", nth=6, seconds=0.3)
    started = time.monotonic()
    scpi.send("*IDN?")
    scpi.port.read(5)
    assert time.monotonic() - started < 0.25
    scpi.port.read(1)
    assert 0.28 < time.monotonic() - started < 5.0


def test_a_stall_holds_on_a_pty_too(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_pty"]) as scpi:
        shared_emulator.do("fault", name="stall", nth=1, seconds=0.3)
        started = time.monotonic()
        assert scpi.ask("*OPC?") == "1"
        assert 0.28 < time.monotonic() - started < 5.0


def test_a_byte_from_the_host_is_lost(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="drop_byte_in", nth=3)
    scpi.send("*IDN?;*OPC?")
    assert scpi.error() == -113
    assert scpi.ask("*OPC?") == "1"


@pytest.mark.parametrize("wire", ["modbus_tcp", "modbus_rtu"])
def test_a_modbus_exception_answers_the_nth_request_of_a_function(shared_emulator: Emulator, wire):
    with Modbus(shared_emulator.endpoints[wire]) as modbus:
        shared_emulator.do("fault", name="exception", command="FC04", nth=2, code=6)
        modbus.holding(0, 1)
        modbus.inputs(0, 1)
        with pytest.raises(ModbusError) as refused:
            modbus.inputs(0, 1)
        assert refused.value.code == 6
        modbus.inputs(0, 1)
    assert acted(shared_emulator) == [1]


def test_a_flipped_modbus_byte_reaches_the_client(shared_emulator: Emulator):
    client = Tcp(shared_emulator.endpoints["modbus_tcp"])
    shared_emulator.do("fault", name="flip_byte", command="FC04", nth=10)
    assert client.exchange(struct.pack(">BHH", 4, 0, 1)) == b"\4\2\0\2"
    client.close()


def test_a_trigger_that_is_not_seen_leaves_the_recorder_armed(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="missing_trigger")
    arm(scpi, "TRIG:LEV 300")
    shared_emulator.do("release")
    until(lambda: not shared_emulator.do("status")["moving"])
    assert scpi.condition() == 40
    assert acted(shared_emulator) == [1]
    shared_emulator.do("release")
    until(lambda: scpi.condition() == 256)


def test_gate_edges_go_missing_one_by_one(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="gate_missing", nth=2)
    take(shared_emulator, scpi)
    until(lambda: not shared_emulator.do("status")["moving"])
    edges = [int(field) for field in scpi.ask("GATE:DATA?").split(",")]
    assert edges[1] == 3
    assert edges[2] < 0 < edges[3]


def test_a_stuck_bit_sits_in_one_record(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="stuck_bit", bit=4, at=0)
    take(shared_emulator, scpi)
    assert not np.any(record(scpi) & 16)


def test_faults_that_are_removed_act_no_more(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="drop_byte", nth=1, count=None)
    scpi.send("*OPC?")
    assert scpi.port.read(1) == b"\n"
    shared_emulator.do("clear")
    assert scpi.ask("*OPC?") == "1"
    assert acted(shared_emulator) == []


def test_a_fault_is_removed_by_its_name(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="drop_byte", nth=1, count=None)
    shared_emulator.do("fault", name="slow_reply", seconds=0.0, count=None)
    assert shared_emulator.do("clear", name="drop_byte")["removed"] == 1
    assert scpi.ask("*OPC?") == "1"
    assert [fault["name"] for fault in shared_emulator.do("status")["faults"]] == ["slow_reply"]
    answer = shared_emulator.control(do="clear", name="drop_byte")
    assert not answer["ok"]
    assert "slow_reply" in answer["error"]


def test_replies_are_let_pass_before_a_fault_strikes(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="flip_byte", command="*OPC?", nth=1, bit=0, skip=2)
    assert [scpi.ask("*OPC?") for _ in range(4)] == ["1", "1", "0", "1"]


def test_a_scenario_file_sets_faults(tmp_path: Path):
    scenario = tmp_path / "rig.toml"
    scenario.write_text(
        '[recorder]\nchannels = 2\n[[fault]]\nname = "flip_byte"\ncommand = "*OPC?"\nnth = 1\nbit = 0\n'
    )
    with Emulator("--scenario", scenario) as emulator, Scpi(emulator.endpoints["scpi_tcp"]) as scpi:
        assert scpi.ask("*OPC?") == "0"
        assert scpi.ask("TRAC:CAT?") == '"CH1,CH2"'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[[fault]]\nname = "flip_bite"\n', ["flip_bite", "flip_byte"]),
        ('[fault]\nname = "flip_byte"\n', ["[[fault]]"]),
        ('[[fault]]\nname = "missing_trigger"\ncommand = "INIT"\n', ["missing_trigger", "no command"]),
    ],
)
def test_a_wrong_fault_in_a_scenario_is_told(tmp_path: Path, text: str, words: list[str]):
    scenario = tmp_path / "rig.toml"
    scenario.write_text(text)
    done = subprocess.run(
        [sys.executable, "-m", "sim_device", "--scenario", scenario],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 1
    assert all(word in done.stderr for word in words), done.stderr
    assert "Traceback" not in done.stderr


def test_the_manual_has_the_catalogue_as_the_emulator_prints_it():
    done = subprocess.run(
        [sys.executable, "-m", "sim_device", "--list-faults"], cwd=ROOT, capture_output=True, text=True
    )
    assert done.stdout in (ROOT / "docs" / "device-protocol.md").read_text(encoding="utf-8")
