"""Plain clients, written from docs/device-protocol.md alone."""

from __future__ import annotations

import socket
import struct
from typing import Protocol

import numpy as np
import serial
from emulator import Emulator, address, until
from numpy.typing import NDArray


class ModbusError(Exception):
    """An exception reply."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}")
        self.code = code


class Stream:
    """A socket that reads like a serial port; pyserial's own waits 0.3 s at each close and has Nagle's algorithm on."""

    def __init__(self, url: str, timeout: float) -> None:
        self.socket = socket.create_connection(address(url), timeout=timeout)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.file = self.socket.makefile("rb")

    def write(self, data: bytes) -> None:
        self.socket.sendall(data)

    def read(self, count: int) -> bytes:
        return self.file.read(count)

    def read_until(self, end: bytes) -> bytes:
        assert end == b"\n"
        return self.file.readline()

    def close(self) -> None:
        self.file.close()
        self.socket.close()


class Scpi:
    """SCPI over a pty or a socket; a context manager."""

    def __init__(self, url: str, timeout: float = 10.0) -> None:
        self.port = Stream(url, timeout) if url.startswith("socket://") else serial.Serial(url, timeout=timeout)

    def __enter__(self) -> Scpi:
        return self

    def __exit__(self, *exception: object) -> None:
        self.port.close()

    def send(self, line: str) -> None:
        self.port.write(line.encode("latin-1") + b"\n")

    def ask(self, line: str) -> str:
        self.send(line)
        reply = self.port.read_until(b"\n")
        assert reply.endswith(b"\n"), f"{line}: {reply!r}"
        return reply[:-1].decode("ascii")

    def block(self, line: str) -> bytes:
        self.send(line)
        head = self.port.read(2)
        assert head[:1] == b"#", head
        data = self.port.read(int(self.port.read(int(head[1:]))))
        assert self.port.read(1) == b"\n"
        return data

    def error(self) -> int:
        return int(self.ask("SYST:ERR?").split(",")[0])

    def done(self, line: str) -> None:
        self.send(line)
        assert self.ask("SYST:ERR?") == '0,"No error"', line

    def condition(self) -> int:
        return int(self.ask("STAT:OPER:COND?"))


def crc16(data: bytes) -> bytes:
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return struct.pack("<H", crc)


class Transport(Protocol):
    def exchange(self, pdu: bytes) -> bytes: ...


class Rtu:
    def __init__(self, path: str, timeout: float = 10.0) -> None:
        self.port = serial.Serial(path, timeout=timeout)

    def close(self) -> None:
        self.port.close()

    def exchange(self, pdu: bytes) -> bytes:
        frame = bytes([1]) + pdu
        self.port.write(frame + crc16(frame))
        return self.reply()

    def reply(self) -> bytes:
        head = self.port.read(3)
        assert len(head) == 3, head
        rest = 2 if head[1] & 0x80 else 5 if head[1] in (6, 16) else head[2] + 2
        frame = head + self.port.read(rest)
        assert frame[0] == 1
        assert frame[-2:] == crc16(frame[:-2])
        return frame[1:-2]


class Tcp:
    def __init__(self, url: str, timeout: float = 10.0) -> None:
        self.socket = socket.create_connection(address(url), timeout=timeout)
        self.file = self.socket.makefile("rb")
        self.transaction = 0

    def close(self) -> None:
        self.file.close()
        self.socket.close()

    def frame(self, pdu: bytes) -> bytes:
        self.transaction = self.transaction + 1 & 0xFFFF
        return struct.pack(">HHHB", self.transaction, 0, len(pdu) + 1, 1) + pdu

    def reply(self) -> tuple[int, bytes]:
        transaction, protocol, length, unit = struct.unpack(">HHHB", self.file.read(7))
        assert (protocol, unit) == (0, 1)
        return transaction, self.file.read(length - 1)

    def exchange(self, pdu: bytes) -> bytes:
        self.socket.sendall(self.frame(pdu))
        transaction, reply = self.reply()
        assert transaction == self.transaction
        return reply


class Modbus:
    """The register map over either transport; a context manager."""

    def __init__(self, url: str) -> None:
        self.wire: Rtu | Tcp = Tcp(url) if url.startswith("tcp://") else Rtu(url)

    def __enter__(self) -> Modbus:
        return self

    def __exit__(self, *exception: object) -> None:
        self.wire.close()

    def request(self, pdu: bytes) -> bytes:
        reply = self.wire.exchange(pdu)
        if reply[0] & 0x80:
            raise ModbusError(reply[1])
        assert reply[0] == pdu[0]
        return reply

    def inputs(self, at: int, count: int) -> bytes:
        return self.request(struct.pack(">BHH", 4, at, count))[2:]

    def holding(self, at: int, count: int) -> bytes:
        return self.request(struct.pack(">BHH", 3, at, count))[2:]

    def write(self, at: int, form: str, *values: int) -> None:
        data = struct.pack(">" + form, *values)
        self.request(struct.pack(">BHHB", 16, at, len(data) // 2, len(data)) + data)

    def write_one(self, at: int, value: int) -> None:
        self.request(struct.pack(">BHH", 6, at, value))

    def number(self, at: int, form: str) -> int:
        return struct.unpack(">" + form, self.inputs(at, struct.calcsize(">" + form) // 2))[0]

    def samples(self, start: int, count: int, points_at: int = 0x1000) -> NDArray[np.int16]:
        """Samples through the window, paged by 125."""
        self.write(33, "I", start)
        parts = [self.inputs(points_at + k, min(125, count - k)) for k in range(0, count, 125)]
        return np.frombuffer(b"".join(parts), ">i2").astype(np.int16)


def arm(scpi: Scpi, *settings: str) -> None:
    """Settings, INIT, and wait until armed."""
    for line in settings:
        scpi.done(line)
    scpi.done("INIT")
    until(lambda: scpi.condition() == 40, what="armed")


def take(emulator: Emulator, scpi: Scpi, *settings: str) -> dict[str, float]:
    """Arm, release and wait until the record is held; answers with the drop's truth."""
    arm(scpi, *(settings or ("TRIG:LEV 100",)))
    truth = emulator.do("release")["truth"]
    until(lambda: scpi.condition() == 256, what="held")
    return truth


def record(scpi: Scpi) -> NDArray[np.int16]:
    """All samples of the held record."""
    return np.frombuffer(scpi.block("FETC?"), ">i2").astype(np.int16)


def header(scpi: Scpi) -> list[int]:
    """The held record's header."""
    return [int(field) for field in scpi.ask("TRAC:HEAD?").split(",")]
