"""What outlives a power cut, and what does not."""

from __future__ import annotations

import socket

import numpy as np
import pytest
from clients import Scpi, arm, header, record, take
from emulator import Emulator, address, until


def test_a_held_record_survives_kill_9_with_its_edges_id_and_boot(tmp_path):
    state = tmp_path / "memory"
    with Emulator("--state", state) as first:
        first.do("catcher", on=True)
        with Scpi(first.endpoints["scpi_tcp"]) as scpi:
            take(first, scpi)
            fields, samples = header(scpi), record(scpi)
            until(lambda: scpi.ask("GATE:DATA?").split(",")[1] == "4")
            edges = scpi.ask("GATE:DATA?")
        first.kill()
    with Emulator("--state", state) as second, Scpi(second.endpoints["scpi_tcp"]) as scpi:
        assert scpi.condition() == 256
        assert header(scpi) == fields
        assert np.array_equal(record(scpi), samples)
        assert scpi.ask("GATE:DATA?") == edges
        assert scpi.ask("SYST:BOOT?") == "2"
        assert scpi.ask("SWE:POIN?;:TRIG:LEV?") == "5000;1000"
        scpi.send("INIT")
        assert scpi.error() == -213
        scpi.done(f"TRAC:ACK {fields[0]},{fields[9]}")
        scpi.done("INIT")
        assert int(scpi.ask("TRAC:STAT?").split(",")[3]) == fields[0] + 1
        second.kill()
    with Emulator("--state", state) as third, Scpi(third.endpoints["scpi_tcp"]) as scpi:
        assert scpi.ask("TRAC:STAT?").split(",")[:4] == ["0", "3", "0", str(fields[0] + 1)]


def test_an_acknowledged_record_does_not_come_back(tmp_path):
    with Emulator("--state", tmp_path / "m") as first, Scpi(first.endpoints["scpi_tcp"]) as scpi:
        take(first, scpi)
        fields = header(scpi)
        scpi.done(f"TRAC:ACK {fields[0]},{fields[9]}")
        first.kill()
    with Emulator("--state", tmp_path / "m") as second, Scpi(second.endpoints["scpi_tcp"]) as scpi:
        assert header(scpi) == [0] * 10


@pytest.mark.parametrize("damage", ["flipped", "cut", "foreign", "empty"])
def test_a_damaged_state_file_is_refused_and_left_alone(tmp_path, damage):
    state = tmp_path / "memory"
    with Emulator("--state", state):
        pass
    data = bytearray(state.read_bytes())
    if damage == "flipped":
        data[5] ^= 1
    data = {"flipped": bytes(data), "cut": bytes(data[:-1]), "foreign": b"hello, world", "empty": b""}[damage]
    state.write_bytes(data)
    with pytest.raises(AssertionError, match=r"state file .*memory cannot be used"):
        Emulator("--state", state)
    assert state.read_bytes() == data


def test_power_off_and_on_keeps_the_record_and_loses_the_rest(shared_emulator: Emulator):
    url = shared_emulator.endpoints["scpi_tcp"]
    with Scpi(url) as scpi:
        scpi.done("FORM:BORD SWAP")
        take(shared_emulator, scpi)
        fields = header(scpi)
        boot = shared_emulator.do("reset")["boot"]
        assert scpi.port.read(1) == b""
    assert boot == fields[1] + 1
    with Scpi(url) as scpi:
        assert header(scpi) == fields
        assert scpi.ask("SYST:BOOT?;:TRIG:LEV?;:FORM:BORD?;*ESR?") == f"{boot};1000;NORM;128"


def test_power_loss_ends_an_acquisition_and_what_was_on_the_line(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_pty"]) as scpi:
        arm(scpi, "TRIG:LEV 300")
        scpi.port.write(b"TRIG:LEV 4")
        until(lambda: scpi.port.out_waiting == 0)
        with socket.create_connection(address(shared_emulator.endpoints["modbus_tcp"]), timeout=10) as other:
            other.sendall(bytes.fromhex("000100000006010400000001"))
            assert len(other.recv(100)) == 11, "the device has taken the connection"
            shared_emulator.do("reset")
            assert other.recv(1) == b""
        scpi.port.write(b"44\n")
        assert scpi.ask("TRIG:LEV?;:STAT:OPER:COND?") == "1000;0"
        assert scpi.error() == -102


def test_trigger_time_counts_from_the_start_of_the_device(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_pty"]) as scpi:
        take(shared_emulator, scpi)
        assert 0 < header(scpi)[6] < 600e6
