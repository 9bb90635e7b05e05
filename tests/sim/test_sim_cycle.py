"""The whole cycle on every wire: configure, arm, release, read, check, acknowledge."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from clients import Modbus, ModbusError, Scpi, arm, header, record, take
from emulator import Emulator, until


def crc(samples: np.ndarray) -> int:
    return zlib.crc32(samples.astype("<i2").tobytes())


@pytest.mark.parametrize("wire", ["scpi_tcp", "scpi_pty"])
def test_a_record_is_taken_read_and_let_go_by_scpi(shared_emulator: Emulator, wire):
    with Scpi(shared_emulator.endpoints[wire]) as scpi:
        assert scpi.condition() == 0
        truth = take(shared_emulator, scpi, "SENS:SWE:POIN 6000", "SENS:SWE:OFFS:POIN -1000", "TRIG:LEV 150")
        condition, boot, held, last, settings = map(int, scpi.ask("TRAC:STAT?").split(","))
        assert (condition, held) == (256, last)
        assert settings == zlib.crc32(b"1000,6000,1000,INT,150,POS,0")
        fields = header(scpi)
        assert fields[:6] == [held, boot, settings, 6000, 1000, -1_000_000]
        assert fields[7:9] == [14, 1]
        samples = record(scpi)
        assert len(samples) == 6000
        assert samples[999] < 150 <= samples[1000]
        assert crc(samples) == fields[9]
        assert float(samples.max()) * 3200 / 8192 == pytest.approx(truth["F_M"], rel=0.03)
        part = np.frombuffer(scpi.block("TRAC:DATA? CH1,990,500"), ">i2")
        assert np.array_equal(part, samples[990:1490])
        assert int(scpi.ask("TRAC:CRC? CH1,990,500")) == crc(part)
        scpi.done(f"TRAC:ACK {fields[0]},{fields[9]}")
        assert scpi.ask("TRAC:HEAD?") == "0,0,0,0,0,0,0,0,0,0"
        assert scpi.condition() == 0


@pytest.mark.parametrize("wire", ["modbus_tcp", "modbus_rtu"])
def test_a_record_is_taken_read_and_let_go_by_modbus(shared_emulator: Emulator, wire):
    with Modbus(shared_emulator.endpoints[wire]) as modbus:
        modbus.write(0, "IIIHhHI", 2000, 3000, 400, 0, 150, 0, 0)
        modbus.write_one(16, 1)
        until(lambda: modbus.number(64, "H") == 40)
        truth = shared_emulator.do("release")["truth"]
        until(lambda: modbus.number(64, "H") == 256)
        head = struct.unpack(">IIIIIqQHH4I", modbus.inputs(96, 28))
        assert head[0] == modbus.number(67, "I") == modbus.number(69, "I")
        assert head[1] == modbus.number(65, "I")
        assert head[2] == modbus.number(71, "I") == zlib.crc32(b"2000,3000,400,INT,150,POS,0")
        assert (head[3], head[4], head[5], head[7], head[8]) == (3000, 2000, -800_000, 14, 1)
        samples = modbus.samples(0, 3000)
        assert samples[399] < 150 <= samples[400]
        assert crc(samples) == head[9]
        assert head[10:] == (0, 0, 0)
        assert float(samples.max()) * 3200 / 8192 == pytest.approx(truth["F_M"], rel=0.03)
        assert np.array_equal(modbus.samples(1234, 200), samples[1234:1434])
        modbus.write(36, "HII", 1, 1000, 250)
        assert modbus.number(168, "I") == crc(samples[1000:1250])
        gate_id, count = struct.unpack(">IH", modbus.inputs(128, 3))
        edges = struct.unpack(">8q", modbus.inputs(132, 32))
        assert gate_id == head[0]
        assert all(edges[:count])
        assert not any(edges[count:])
        modbus.write(18, "II", head[0], head[9])
        modbus.write_one(16, 3)
        assert modbus.number(64, "H") == 0
        assert not any(modbus.inputs(96, 28))


def test_the_same_record_comes_out_of_every_wire(shared_emulator: Emulator):
    ends = shared_emulator.endpoints
    with Scpi(ends["scpi_tcp"]) as one, Scpi(ends["scpi_pty"]) as two:
        take(shared_emulator, one)
        expected = record(one)
        assert np.array_equal(record(two), expected)
    for wire in ("modbus_tcp", "modbus_rtu"):
        with Modbus(ends[wire]) as modbus:
            assert np.array_equal(modbus.samples(0, 5000), expected)


def test_a_held_record_refuses_init_on_both_languages(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi, Modbus(shared_emulator.endpoints["modbus_tcp"]) as modbus:
        take(shared_emulator, scpi)
        before = header(scpi)
        scpi.send("INIT")
        assert scpi.ask("SYST:ERR?") == '-213,"Init ignored"'
        with pytest.raises(ModbusError) as refused:
            modbus.write_one(16, 1)
        assert refused.value.code == 4
        assert modbus.number(86, "h") == -213
        assert modbus.number(87, "H") == 1
        modbus.write_one(16, 4)
        assert modbus.number(86, "h") == 0
        assert header(scpi) == before


def test_a_wrong_acknowledgement_changes_nothing(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi, Modbus(shared_emulator.endpoints["modbus_tcp"]) as modbus:
        take(shared_emulator, scpi)
        fields = header(scpi)
        for number, check in ((fields[0], fields[9] ^ 1), (fields[0] + 1, fields[9])):
            scpi.send(f"TRAC:ACK {number},{check}")
            assert scpi.error() == -230
            with pytest.raises(ModbusError):
                modbus.write(16, "HHII", 3, 0, number, check)
            assert modbus.number(86, "h") == -230
            assert scpi.error() == -230
        assert header(scpi) == fields
        modbus.write(16, "HHII", 3, 0, fields[0], fields[9])
        assert scpi.condition() == 0
        scpi.send(f"TRAC:ACK {fields[0]},{fields[9]}")
        assert scpi.error() == -230


def test_settings_are_fixed_while_an_acquisition_runs(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi, Modbus(shared_emulator.endpoints["modbus_tcp"]) as modbus:
        arm(scpi, "TRIG:LEV 300")
        scpi.send("TRIG:LEV 400")
        assert scpi.error() == -221
        with pytest.raises(ModbusError) as refused:
            modbus.write_one(7, 400)
        assert refused.value.code == 4
        assert scpi.error() == -221
        assert scpi.ask("TRIG:LEV?") == "300"
        scpi.done("ABOR")
        scpi.done("TRIG:LEV 400")
        assert modbus.holding(7, 1) == b"\x01\x90"


def test_reset_stops_an_acquisition_and_keeps_a_held_record(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi:
        arm(scpi, "TRIG:LEV 300")
        scpi.done("*RST")
        assert scpi.condition() == 0
        assert scpi.ask("TRIG:LEV?") == "1000"
        take(shared_emulator, scpi)
        fields = header(scpi)
        scpi.done("*RST")
        assert scpi.condition() == 256
        assert header(scpi) == fields


def test_ids_count_every_init_even_one_that_leads_to_nothing(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi:
        last = int(scpi.ask("TRAC:STAT?").split(",")[3])
        for n in range(1, 4):
            scpi.done("INIT")
            assert int(scpi.ask("TRAC:STAT?").split(",")[3]) == last + n
            scpi.done("ABOR")


@pytest.mark.parametrize("command", ["ABOR", "*RST"])
def test_a_record_whose_trigger_has_come_goes_on_to_its_end(shared_emulator: Emulator, command: str):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi:
        arm(scpi, "SENS:SWE:POIN 500000", "TRIG:LEV 150")
        shared_emulator.do("release")
        until(lambda: scpi.condition() == 24)
        scpi.done(command)
        assert scpi.condition() == 24
        until(lambda: scpi.condition() == 256)
        assert header(scpi)[3] == 500_000
