"""Programs that nobody here wrote read the device as well."""

from __future__ import annotations

import re
import subprocess

import numpy as np
import pytest
import pyvisa
from clients import Scpi, record, take
from emulator import Emulator, address
from records import need


def polled(arguments: list[str]) -> list[int]:
    """Values that mbpoll prints, in order."""
    run = subprocess.run(
        [need("mbpoll"), "-1", "-q", "-0", "-a", "1", *arguments], capture_output=True, text=True, timeout=20
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return [int(value) for value in re.findall(r"^\[\d+\]:\s+(-?\d+)", run.stdout, re.MULTILINE)]


def test_mbpoll_reads_sentinels_over_tcp(shared_emulator: Emulator):
    host, port = address(shared_emulator.endpoints["modbus_tcp"])
    assert polled(["-m", "tcp", "-p", str(port), "-t", "3", "-r", "0", "-c", "5", host]) == [258, 258, 772, 1, 16]
    long_words = polled(["-m", "tcp", "-p", str(port), "-t", "3:int", "-B", "-r", "1", "-c", "1", host])
    assert long_words == [0x01020304]


def test_mbpoll_reads_sentinels_over_rtu(shared_emulator: Emulator):
    path = shared_emulator.endpoints["modbus_rtu"]
    line = ["-m", "rtu", "-b", "115200", "-P", "none", "-t", "3"]
    assert polled([*line, "-r", "0", "-c", "5", path]) == [258, 258, 772, 1, 16]
    assert polled([*line[:-1], "4", "-r", "0", "-c", "4", path]) == [0, 1000, 0, 5000]


@pytest.mark.parametrize("wire", ["tcp", "pty"])
def test_pyvisa_identifies_the_device_and_reads_a_block(shared_emulator: Emulator, wire):
    ends = shared_emulator.endpoints
    with Scpi(ends["scpi_tcp"]) as scpi:
        take(shared_emulator, scpi)
        expected = record(scpi)
        host, port = address(ends["scpi_tcp"])
        name = f"TCPIP::{host}::{port}::SOCKET" if wire == "tcp" else f"ASRL{ends['scpi_pty']}::INSTR"
        manager = pyvisa.ResourceManager("@py")
        with manager.open_resource(name) as instrument:
            instrument.read_termination = instrument.write_termination = "\n"
            instrument.timeout = 10_000
            assert instrument.query("*IDN?") == scpi.ask("*IDN?")
            got = instrument.query_binary_values("TRAC:DATA? CH1,0,2000", datatype="h", is_big_endian=True)
            assert np.array_equal(got, expected[:2000])
            assert instrument.query("*OPC?") == "1"
        manager.close()
