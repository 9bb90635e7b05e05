"""Modbus as a language: requests and replies (PDU), and their frames on a serial line and over TCP."""

from __future__ import annotations

import struct
from collections.abc import Iterator

from sim_device import modbus_registers as registers
from sim_device.checksum import crc16
from sim_device.device import Device
from sim_device.fault import Language
from sim_device.modbus_registers import Exceptional

UNIT = 1
READ_HOLDING, READ_INPUT, WRITE_ONE, WRITE_MANY = 3, 4, 6, 16
MOST_READ, MOST_WRITTEN = 125, 123
LONGEST_RTU, LONGEST_TCP = 256, 254


def answer(device: Device, request: bytes) -> tuple[str, bytes | None]:
    """The reply to a request (both function code and data), with the name of its command, "FC04"; None: no reply."""
    function = request[0]
    name = f"FC{function:02d}"
    if device.struck(name):
        return name, None
    if device.faults.strikes("busy", name) is not None:
        return name, bytes([function | 0x80, registers.BUSY])
    if (fault := device.faults.strikes("exception", name)) is not None:
        return name, bytes([function | 0x80, int(fault.options["code"])])
    try:
        return name, _reply(device, function, request)
    except Exceptional as error:
        return name, bytes([function | 0x80, error.code])


def _reply(device: Device, function: int, request: bytes) -> bytes:
    if function not in (READ_HOLDING, READ_INPUT, WRITE_ONE, WRITE_MANY):
        raise Exceptional(registers.ILLEGAL_FUNCTION)
    if len(request) < 5:
        raise Exceptional(registers.ILLEGAL_VALUE)
    address, value = struct.unpack_from(">HH", request, 1)
    if function == WRITE_ONE:
        if len(request) != 5:
            raise Exceptional(registers.ILLEGAL_VALUE)
        registers.write(device, address, request[3:5])
        return request
    if function == WRITE_MANY:
        if not 1 <= value <= MOST_WRITTEN or len(request) != 6 + 2 * value or request[5] != 2 * value:
            raise Exceptional(registers.ILLEGAL_VALUE)
        registers.write(device, address, request[6:])
        return request[:5]
    if not 1 <= value <= MOST_READ or len(request) != 5:
        raise Exceptional(registers.ILLEGAL_VALUE)
    read = registers.input_registers if function == READ_INPUT else registers.holding_registers
    data = read(device, address, value)
    return bytes([function, len(data)]) + data


class RtuSession:
    """One serial line. Frames end by the length their function implies; silence throws away what is unfinished."""

    language: Language = "rtu"

    def __init__(self, device: Device) -> None:
        """Serve ``device``."""
        self._device = device
        self._pending = bytearray()

    def feed(self, data: bytes) -> Iterator[tuple[str, bytes]]:
        """Take bytes in; yields replies as frames, each with the name of its command."""
        self._pending += data
        while (length := self._length()) is not None and len(self._pending) >= length:
            frame = bytes(self._pending[:length])
            if frame[-2:] != crc16(frame[:-2]):
                self._pending.clear()
                return
            del self._pending[:length]
            yield from self._frame(frame)
        if len(self._pending) > LONGEST_RTU:
            self._pending.clear()

    def silence(self) -> Iterator[tuple[str, bytes]]:
        """The line has been silent: what is left is a whole frame of an unknown function, or garbage."""
        frame = bytes(self._pending)
        self._pending.clear()
        if 4 <= len(frame) <= LONGEST_RTU and frame[-2:] == crc16(frame[:-2]):
            yield from self._frame(frame)

    def _length(self) -> int | None:
        if len(self._pending) < 2:
            return None
        if 1 <= self._pending[1] <= 6:
            return 8
        if self._pending[1] in (15, 16):
            return 9 + self._pending[6] if len(self._pending) > 6 else None
        return None

    def _frame(self, frame: bytes) -> Iterator[tuple[str, bytes]]:
        if frame[0] == UNIT:
            name, reply = answer(self._device, frame[1:-2])
            if reply is not None:
                body = frame[:1] + reply
                yield name, body + crc16(body)


class TcpSession:
    """One TCP connection; requests are answered in the order in which they came."""

    language: Language = "tcp"

    def __init__(self, device: Device) -> None:
        """Serve ``device``."""
        self._device = device
        self._pending = bytearray()
        self.broken = False

    def feed(self, data: bytes) -> Iterator[tuple[str, bytes]]:
        """Take bytes in; yields replies as frames. ``broken`` is set when the stream is no Modbus."""
        self._pending += data
        while len(self._pending) >= 8 and not self.broken:
            transaction, protocol, length = struct.unpack_from(">HHH", self._pending)
            if protocol != 0 or not 2 <= length <= LONGEST_TCP:
                self.broken = True
                return
            if len(self._pending) < 6 + length:
                return
            unit, request = self._pending[6], bytes(self._pending[7 : 6 + length])
            del self._pending[: 6 + length]
            if unit == UNIT:
                name, reply = answer(self._device, request)
                if reply is not None:
                    yield name, struct.pack(">HHHB", transaction, 0, len(reply) + 1, unit) + reply
