"""What the Modbus language promises, on both of its wires."""

from __future__ import annotations

import struct

import pytest
from clients import Modbus, ModbusError, Rtu, Scpi, Tcp, crc16, take
from emulator import Emulator


@pytest.fixture(params=["modbus_tcp", "modbus_rtu"])
def modbus(shared_emulator: Emulator, request):
    with Modbus(shared_emulator.endpoints[request.param]) as client:
        yield client


def test_the_sentinels_settle_byte_and_word_order(modbus: Modbus):
    assert struct.unpack(">HIHH", modbus.inputs(0, 5)) == (0x0102, 0x01020304, 1, 16)


def test_the_identity_is_that_of_scpi(shared_emulator: Emulator, modbus: Modbus):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi:
        assert modbus.inputs(8, 32).rstrip(b"\0").decode() == scpi.ask("*IDN?")


def test_settings_are_those_of_scpi(shared_emulator: Emulator, modbus: Modbus):
    assert struct.unpack(">IIIHhHI", modbus.holding(0, 11)) == (1000, 5000, 500, 0, 1000, 0, 0)
    modbus.write(0, "IIIHhHI", 1500, 2000, 1999, 2, -7, 1, 1_000_000)
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi:
        assert scpi.ask("SWE:POIN?;OFFS:POIN?;:TRIG:SOUR?;LEV?;SLOP?") == "2000;-1999;EXT;-7;NEG"
        assert int(scpi.ask("TRAC:STAT?").split(",")[4]) == modbus.number(71, "I")


@pytest.mark.parametrize(
    ("at", "form", "values"),
    [
        (0, "I", (999,)),
        (2, "I", (500,)),
        (2, "II", (1000, 1000)),
        (4, "I", (5000,)),
        (6, "H", (3,)),
        (8, "H", (2,)),
        (9, "I", (2_000_000_000,)),
        (1, "H", (5,)),
        (2, "H", (5,)),
        (3, "HI", (5, 5)),
        (11, "H", (1,)),
        (16, "H", (6,)),
        (32, "H", (0,)),
        (36, "H", (5,)),
        (8, "HIH", (0, 0, 1)),
    ],
)
def test_what_is_out_of_range_or_half_a_value_is_exception_3_and_changes_nothing(modbus: Modbus, at, form, values):
    before = modbus.holding(0, 48)
    with pytest.raises(ModbusError) as refused:
        modbus.write(at, form, *values)
    assert refused.value.code == 3
    assert modbus.holding(0, 48) == before


def test_settings_of_one_request_are_taken_together(modbus: Modbus):
    modbus.write(2, "II", 1000, 999)
    modbus.write(2, "II", 100_000, 50_000)
    with pytest.raises(ModbusError):
        modbus.write(2, "I", 40_000)
    with pytest.raises(ModbusError):
        modbus.write(0, "IIIHh", 1500, 2000, 100, 9, 5)
    assert struct.unpack(">III", modbus.holding(0, 6)) == (1000, 100_000, 50_000)


def test_registers_between_the_values_read_zero_and_take_zero(modbus: Modbus):
    modbus.write(11, "HHHHH", 0, 0, 0, 0, 0)
    assert modbus.holding(11, 7) == bytes(14)
    assert modbus.inputs(164, 4) == bytes(8)


def test_a_single_register_can_be_written_by_function_6(modbus: Modbus):
    modbus.write_one(7, 0x10000 - 300)
    assert struct.unpack(">h", modbus.holding(7, 1)) == (-300,)
    with pytest.raises(ModbusError) as refused:
        modbus.write_one(0, 1)
    assert refused.value.code == 3


@pytest.mark.parametrize(
    ("pdu", "code"),
    [
        (struct.pack(">BHH", 4, 0, 0), 3),
        (struct.pack(">BHH", 4, 0, 126), 3),
        (struct.pack(">BHH", 4, 170, 7), 2),
        (struct.pack(">BHH", 4, 176, 1), 2),
        (struct.pack(">BHH", 4, 0xFFF, 2), 2),
        (struct.pack(">BHH", 4, 0x1000, 1), 2),
        (struct.pack(">BHH", 4, 0xFFFF, 2), 2),
        (struct.pack(">BHH", 3, 40, 9), 2),
        (struct.pack(">BHH", 3, 48, 1), 2),
        (struct.pack(">BHH", 6, 48, 0), 2),
        (struct.pack(">BHHBH", 16, 48, 1, 2, 0), 2),
        (struct.pack(">BHHBH", 16, 7, 2, 2, 0), 3),
        (struct.pack(">BHH", 1, 0, 1), 1),
        (bytes([7]), 1),
        (bytes([0x2B, 14, 1, 0]), 1),
    ],
)
def test_wrong_requests_are_answered_with_their_exception(modbus: Modbus, pdu, code):
    with pytest.raises(ModbusError) as refused:
        modbus.request(pdu)
    assert refused.value.code == code
    assert modbus.number(0, "H") == 0x0102


def test_the_window_pages_through_the_record_and_ends_with_it(shared_emulator: Emulator, modbus: Modbus):
    with Scpi(shared_emulator.endpoints["scpi_tcp"]) as scpi:
        take(shared_emulator, scpi, "TRIG:LEV 100", "SENS:SWE:POIN 70000")
        whole = struct.unpack(">70000h", scpi.block("FETC?"))
    modbus.write(32, "HI", 1, 0)
    last = struct.unpack(">125h", modbus.inputs(0x10000 - 125, 125))
    assert last == whole[61_440 - 125 : 61_440]
    modbus.write(33, "I", 69_900)
    assert struct.unpack(">100h", modbus.inputs(0x1000, 100)) == whole[-100:]
    for at, count in ((0x1000, 101), (0x1000 + 100, 1)):
        with pytest.raises(ModbusError) as refused:
            modbus.inputs(at, count)
        assert refused.value.code == 2
    modbus.write_one(32, 2)
    with pytest.raises(ModbusError):
        modbus.inputs(0x1000, 1)
    modbus.write(36, "HII", 1, 69_950, 100)
    assert modbus.number(168, "I") == 0


def test_sixteen_pipelined_requests_are_answered_in_order(shared_emulator: Emulator):
    client = Tcp(shared_emulator.endpoints["modbus_tcp"])
    frames = [client.frame(struct.pack(">BHH", 4, at, 1)) for at in (0, 3, 4, 64) * 4]
    client.socket.sendall(b"".join(frames))
    replies = [client.reply() for _ in frames]
    assert [transaction for transaction, _ in replies] == list(range(1, 17))
    assert [reply[2:] for _, reply in replies] == [b"\1\2", b"\0\1", b"\0\x10", b"\0\0"] * 4
    client.close()


def test_a_request_in_pieces_is_one_request(shared_emulator: Emulator):
    client = Tcp(shared_emulator.endpoints["modbus_tcp"])
    client.socket.setsockopt(6, 1, 1)
    for byte in client.frame(struct.pack(">BHH", 4, 0, 1)):
        client.socket.sendall(bytes([byte]))
    assert client.reply()[1] == b"\4\2\1\2"
    client.close()


def test_a_stream_that_is_not_modbus_is_closed(shared_emulator: Emulator):
    client = Tcp(shared_emulator.endpoints["modbus_tcp"])
    client.socket.sendall(b"GET / HTTP/1.1\r\n\r\n")
    with pytest.raises((ConnectionError, struct.error)):
        client.reply()
    client.close()


@pytest.mark.parametrize("damage", ["crc", "unit", "short", "noise"])
def test_rtu_frames_that_are_damaged_or_for_others_are_not_answered(shared_emulator: Emulator, damage):
    line = Rtu(shared_emulator.endpoints["modbus_rtu"], timeout=0.15)
    body = bytes([2 if damage == "unit" else 1]) + struct.pack(">BHH", 4, 0, 1)
    frame = body + crc16(body)
    frame = {"crc": frame[:-1] + b"\x55", "unit": frame, "short": frame[:-3], "noise": b"\xff" * 40}[damage]
    line.port.write(frame)
    assert line.port.read(1) == b""
    line.port.timeout = 5
    assert line.exchange(struct.pack(">BHH", 4, 0, 1)) == b"\4\2\1\2"
    line.close()
