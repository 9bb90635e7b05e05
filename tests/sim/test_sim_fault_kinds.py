"""Each fault of the catalogue happens as it is named; those of single bytes and of the mechanism are next door."""

from __future__ import annotations

import socket
import struct
import time
import zlib
from pathlib import Path

import numpy as np
import pytest
import serial
from clients import Modbus, ModbusError, Rtu, Scpi, Tcp, arm, crc16, header, record, take
from emulator import Emulator, address, until

from sim_device.fault_kinds import KINDS

IDENTITY = b"droptower,emulated tower,0001,0.1.0\n"


@pytest.fixture
def scpi(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_tcp"], timeout=3) as client:
        yield client


def raw(emulator: Emulator, data: bytes, seconds: float = 0.25, wire: str = "scpi_tcp") -> bytes:
    """What comes back within some time."""
    with socket.create_connection(address(emulator.endpoints[wire])) as link:
        link.sendall(data)
        link.settimeout(0.05)
        came, end = b"", time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                if not (more := link.recv(4096)):
                    break
                came += more
            except TimeoutError:
                continue
            except ConnectionResetError:
                break
        return came


@pytest.mark.parametrize(
    ("fault", "reply"),
    [
        ({"name": "duplicate_byte", "nth": 2}, b"drroptower"),
        ({"name": "insert_byte", "nth": 2, "value": 33}, b"d!roptower"),
        ({"name": "truncated", "nth": 5}, b"drop"),
        ({"name": "no_terminator"}, IDENTITY[:-1]),
        ({"name": "duplicate_reply"}, IDENTITY * 2),
        ({"name": "split", "size": 3, "seconds": 0.001}, IDENTITY),
        ({"name": "coalesce"}, IDENTITY),
        ({"name": "echo"}, b"*IDN?\n" + IDENTITY),
        ({"name": "duplicate_byte_in", "nth": 1}, b""),
        ({"name": "insert_byte_in", "nth": 5, "value": 10}, b""),
        ({"name": "flip_byte_in", "nth": 3, "bit": 0}, b""),
    ],
)
def test_the_line_spoils_a_reply(shared_emulator: Emulator, fault, reply):
    shared_emulator.do("fault", **fault)
    came = raw(shared_emulator, b"*IDN?\n")
    assert came == reply if len(reply) in (0, 4) or reply[-1:] == b"\n" else came.startswith(reply)
    assert shared_emulator.do("status")["faults"][0]["acted"] == 1
    assert raw(shared_emulator, b"*IDN?\n", 0.1) == IDENTITY, "once, as told"


def test_a_reply_can_be_too_long_and_noise_can_follow_it(shared_emulator: Emulator):
    for name, size in (("over_long", 3), ("noise", 8)):
        shared_emulator.do("fault", name=name, seed=5)
        came = raw(shared_emulator, b"*IDN?\n")
        assert came.startswith(IDENTITY)
        assert len(came) == len(IDENTITY) + size
        shared_emulator.do("clear")


@pytest.mark.parametrize("name", ["slow_reply", "late_reply", "busy", "coalesce"])
def test_a_reply_comes_late(shared_emulator: Emulator, scpi: Scpi, name: str):
    shared_emulator.do("fault", name=name, seconds=0.3)
    started = time.monotonic()
    assert scpi.ask("*OPC?") == "1"
    assert 0.28 < time.monotonic() - started < 2.5


def test_pieces_of_a_split_reply_come_apart_on_a_pty(shared_emulator: Emulator):
    with serial.Serial(shared_emulator.endpoints["scpi_pty"], timeout=1) as port:
        shared_emulator.do("fault", name="split", size=5, seconds=0.1)
        port.write(b"*IDN?\n")
        assert port.read(5) == IDENTITY[:5]
        port.timeout = 0.04
        assert port.read(1) == b""
        port.timeout = 2
        assert port.read(len(IDENTITY) - 5) == IDENTITY[5:]


def test_a_block_announces_another_length(shared_emulator: Emulator, scpi: Scpi):
    take(shared_emulator, scpi)
    shared_emulator.do("fault", name="wrong_length", by=-3)
    scpi.send("TRAC:DATA? CH1,0,100")
    assert scpi.port.read(5) == b"#3197"


def test_a_modbus_exchange_on_rtu_is_spoiled_as_named(shared_emulator: Emulator):
    line = Rtu(shared_emulator.endpoints["modbus_rtu"], timeout=2)
    request = bytes([1, 4, 0, 0, 0, 1])
    good = bytes([1, 4, 2, 1, 2])
    for name, body in (
        ("wrong_unit", bytes([2, 4, 2, 1, 2])),
        ("wrong_function", bytes([1, 5, 2, 1, 2])),
        ("wrong_length", bytes([1, 4, 3, 1, 2])),
    ):
        shared_emulator.do("fault", name=name)
        line.port.write(request + crc16(request))
        assert line.port.read(7) == body + crc16(body), name
    shared_emulator.do("fault", name="bad_crc")
    line.port.write(request + crc16(request))
    assert line.port.read(7) == good + bytes(255 - b for b in crc16(good))
    line.port.write(request + crc16(request))
    assert line.port.read(7) == good + crc16(good)
    line.close()


def test_a_modbus_exchange_on_tcp_is_spoiled_as_named(shared_emulator: Emulator):
    client = Tcp(shared_emulator.endpoints["modbus_tcp"])
    for name, head in (
        ("wrong_transaction", (8, 0, 5, 1, 4, 2)),
        ("wrong_unit", (7, 0, 5, 2, 4, 2)),
        ("wrong_function", (7, 0, 5, 1, 5, 2)),
        ("wrong_length", (7, 0, 5, 1, 4, 3)),
    ):
        shared_emulator.do("fault", name=name)
        client.socket.sendall(struct.pack(">HHHBBHH", 7, 0, 6, 1, 4, 0, 1))
        assert struct.unpack(">HHHBBB", client.file.read(11)[:9]) == head, name
    client.close()


def test_modbus_is_busy_and_then_ready(shared_emulator: Emulator):
    with Modbus(shared_emulator.endpoints["modbus_tcp"]) as modbus:
        shared_emulator.do("fault", name="busy", count=2)
        for _ in range(2):
            with pytest.raises(ModbusError) as refused:
                modbus.inputs(0, 1)
            assert refused.value.code == 6
        assert modbus.inputs(0, 1) == b"\1\2"


@pytest.mark.parametrize("code", [1, 2, 3, 4, 5, 6, 8, 10, 11])
def test_every_exception_can_be_played(shared_emulator: Emulator, code: int):
    with Modbus(shared_emulator.endpoints["modbus_rtu"]) as modbus:
        shared_emulator.do("fault", name="exception", code=code)
        with pytest.raises(ModbusError) as refused:
            modbus.inputs(0, 1)
        assert refused.value.code == code


def test_links_end_in_the_middle_of_a_reply(shared_emulator: Emulator):
    port = address(shared_emulator.endpoints["scpi_tcp"])
    for name, keys in (("disconnect", {}), ("reset_link", {}), ("second_client", {"seconds": 0.3})):
        shared_emulator.do("fault", name=name, nth=5, **keys)
        with socket.create_connection(port) as link:
            link.sendall(b"*IDN?\n")
            time.sleep(0.1)
            if name == "reset_link":
                with pytest.raises(ConnectionResetError):
                    [link.recv(100) for _ in range(2)]
            else:
                assert link.recv(100) + link.recv(100) == b"drop"
    assert raw(shared_emulator, b"*IDN?\n", 0.1) == b"", "another client has it"
    time.sleep(0.3)
    assert raw(shared_emulator, b"*IDN?\n", 0.1) == IDENTITY


def test_a_port_vanishes_and_returns(shared_emulator: Emulator):
    port = address(shared_emulator.endpoints["scpi_tcp"])
    shared_emulator.do("fault", name="vanish", nth=1, seconds=0.3)
    assert raw(shared_emulator, b"*IDN?\n", 0.1) == b""
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(port)

    def back() -> bool:
        try:
            socket.create_connection(port).close()
        except ConnectionRefusedError:
            return False
        return True

    until(back)
    assert raw(shared_emulator, b"*IDN?\n", 0.1) == IDENTITY


@pytest.mark.parametrize("name", ["disconnect", "reset_link", "vanish"])
def test_a_serial_port_vanishes_and_returns_under_its_name(shared_emulator: Emulator, name: str):
    path = shared_emulator.endpoints["scpi_pty"]
    with serial.Serial(path, timeout=1) as port:
        shared_emulator.do("fault", name=name, nth=5)
        port.write(b"*IDN?\n")
        with pytest.raises(serial.SerialException):
            port.read(100)

    def answers() -> bool:
        try:
            with serial.Serial(path, timeout=1) as port:
                port.write(b"*IDN?\n")
                return port.readline() == IDENTITY
        except serial.SerialException:
            return False

    until(answers)


def test_another_client_eats_what_is_left_of_a_reply_on_a_serial_line(shared_emulator: Emulator):
    with Scpi(shared_emulator.endpoints["scpi_pty"], timeout=0.3) as client:
        shared_emulator.do("fault", name="second_client", nth=5)
        client.send("*IDN?")
        assert client.port.read(100) == b"drop"
        assert client.ask("*OPC?") == "1"


def test_the_device_is_reset_instead_of_an_answer(shared_emulator: Emulator, scpi: Scpi):
    scpi.done("SWE:POIN 7000")
    boot = shared_emulator.do("status")["boot"]
    shared_emulator.do("fault", name="device_reset", command="*OPC?")
    assert raw(shared_emulator, b"*OPC?\n", 0.1) == b""
    assert shared_emulator.do("status")["boot"] == boot + 1
    assert raw(shared_emulator, b"SWE:POIN?\n", 0.1) == b"5000\n"


def test_power_fails_in_the_middle_of_a_record(shared_emulator: Emulator, scpi: Scpi):
    boot = shared_emulator.do("status")["boot"]
    shared_emulator.do("fault", name="brown_out")
    arm(scpi, "TRIG:LEV 100", "SWE:POIN 100000")
    shared_emulator.do("release")
    until(lambda: shared_emulator.do("status")["boot"] == boot + 1)
    status = shared_emulator.do("status")
    assert (status["state"], status["held"]) == ("idle", 0)


def test_a_setting_is_silently_clamped(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="clamped_settings")
    scpi.done("SWE:TINT 1e-6")
    assert float(scpi.ask("SWE:TINT?")) == 2e-6
    scpi.done("SWE:TINT 1e-6")
    assert float(scpi.ask("SWE:TINT?")) == 1e-6


def test_the_error_queue_overflows(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="error_overflow", command="*OPC?")
    assert scpi.ask("*OPC?") == "1"
    assert [scpi.error() for _ in range(17)] == [-222] * 15 + [-350, 0]


def crossing(samples) -> int:
    return int(np.argmax(samples >= 100))


def test_a_wrong_clock_puts_the_samples_further_apart(shared_emulator: Emulator, scpi: Scpi):
    take(shared_emulator, scpi)
    right = record(scpi)
    scpi.done(f"TRAC:ACK {header(scpi)[0]},{header(scpi)[9]}")
    until(lambda: not shared_emulator.do("status")["moving"])
    shared_emulator.do("fault", name="wrong_clock", factor=2)
    take(shared_emulator, scpi)
    slow = record(scpi)
    assert header(scpi)[4] == 1000
    width = [int((samples > 300).sum()) for samples in (right, slow)]
    assert width[0] / width[1] == pytest.approx(2, rel=0.02)
    assert [crossing(slow), crossing(right)] == pytest.approx([500, 500], abs=10), "noise may cross a sample later"


def test_triggers_come_without_a_drop_early_or_twice(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="spurious_trigger")
    scpi.done("TRIG:LEV 100")
    scpi.done("INIT")
    until(lambda: scpi.condition() == 256)
    assert np.abs(record(scpi)).max() < 100
    scpi.done(f"TRAC:ACK {header(scpi)[0]},{header(scpi)[9]}")
    for name, at in (("early_trigger", 500 + 1000), ("double_trigger", 0)):
        shared_emulator.do("clear")
        shared_emulator.do("fault", name=name, seconds=0.001)
        take(shared_emulator, scpi)
        assert crossing(record(scpi)) == at, "the comparator's own moment in the record"
        scpi.done(f"TRAC:ACK {header(scpi)[0]},{header(scpi)[9]}")
        until(lambda: not shared_emulator.do("status")["moving"])


def test_a_short_pretrigger_is_stated_in_the_header(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="short_pretrigger", missing=100)
    take(shared_emulator, scpi)
    assert header(scpi)[5] == -400_000
    assert crossing(record(scpi)) == 400


def test_a_stale_record_has_the_id_before_and_nothing_in_it(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="stale_record")
    take(shared_emulator, scpi)
    condition, _, held, last, _ = (int(field) for field in scpi.ask("TRAC:STAT?").split(","))
    assert (condition, held) == (256, last - 1)
    assert np.abs(record(scpi)).max() < 100


def test_records_are_saturated_and_miss_samples(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="saturation", share=0.05)
    shared_emulator.do("fault", name="dropped_samples", at=400, size=10)
    take(shared_emulator, scpi)
    samples = record(scpi)
    assert samples.max() == 8191
    assert not np.any((samples > 410) & (samples < 8191))
    assert crossing(samples) == 490


@pytest.mark.parametrize("wire", ["scpi_tcp", "modbus_tcp"])
def test_the_bytes_of_samples_are_swapped_and_a_crc_is_wrong(shared_emulator: Emulator, scpi: Scpi, wire: str):
    take(shared_emulator, scpi)
    whole = record(scpi)
    good = whole[400:500]
    crc = zlib.crc32(good.astype("<i2").tobytes())

    def read():
        if wire == "scpi_tcp":
            return np.frombuffer(scpi.block("TRAC:DATA? CH1,400,100"), ">i2"), int(scpi.ask("TRAC:CRC? CH1,400,100"))
        with Modbus(shared_emulator.endpoints[wire]) as modbus:
            modbus.write(36, "HII", 1, 400, 100)
            return modbus.samples(400, 100), modbus.number(168, "I")

    shared_emulator.do("fault", name="swapped_bytes")
    shared_emulator.do("fault", name="bad_crc32")
    samples, stated = read()
    assert np.array_equal(samples.byteswap(), good)
    assert stated == crc ^ 0xFFFFFFFF
    samples, stated = read()
    assert (samples.tolist(), stated) == (good.tolist(), crc)


def test_channels_are_swapped_in_a_reply(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("recorder", channels=4)
    take(shared_emulator, scpi)
    shared_emulator.do("recorder", channels=1)
    first, second = (scpi.block(f"TRAC:DATA? CH{n},0,5000") for n in (1, 2))
    assert header(scpi)[8] == 4
    assert first != second
    shared_emulator.do("fault", name="swapped_channels")
    assert scpi.block("TRAC:DATA? CH1,0,5000") == second
    assert scpi.block("TRAC:DATA? CH1,0,5000") == first


def test_a_held_record_is_overwritten(shared_emulator: Emulator, scpi: Scpi):
    take(shared_emulator, scpi)
    before = header(scpi)
    shared_emulator.do("fault", name="overwritten", command="TRAC:DATA?")
    scpi.block("TRAC:DATA? CH1,0,100")
    after = header(scpi)
    assert after[0] == before[0] + 1
    assert after[9] == zlib.crc32(record(scpi).astype("<i2").tobytes()) != before[9]


def test_a_gate_edge_is_absurd(shared_emulator: Emulator, scpi: Scpi):
    shared_emulator.do("fault", name="gate_absurd", seconds=-100)
    take(shared_emulator, scpi)
    edges = [int(field) for field in scpi.ask("GATE:DATA?").split(",")]
    assert -100.1e9 < edges[2] < -99.9e9
    assert -1e9 < edges[3] < 0


def test_every_fault_of_the_catalogue_is_named_in_a_test():
    texts = "".join(path.read_text(encoding="utf-8") for path in Path(__file__).parent.glob("*.py"))
    assert [name for name in KINDS if f'"{name}"' not in texts] == []
