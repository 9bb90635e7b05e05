"""Many registers at the wire's own speed: requests in flight at once on TCP, back to back on RTU, every frame checked.

pymodbus keeps one request under way and, on a serial line, sleeps between polls; a long read is framed here
on the socket or line that its client has opened.
"""

import socket
import struct
import time

import numpy as np
import serial
from numpy.typing import NDArray
from pymodbus.framer.rtu import FramerRTU

from daq.errors import BadReply, DeviceError, LinkError, NoReply

PER_READ = 125
"""Registers a request may read (Modbus application protocol, functions 03 and 04)."""
EXCEPTIONS = {
    1: "function not known",
    2: "address not known",
    3: "value not allowed",
    4: "refused in this state",
    5: "still working on it",
    6: "busy",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target does not answer",
}
Registers = NDArray[np.uint16]


def exception_words(code: int) -> str:
    """What a Modbus exception code means."""
    return f"exception {code:02d}, {EXCEPTIONS.get(code, 'unknown')}"


def read_tcp(
    link: socket.socket, unit: int, function: int, address: int, count: int, at_once: int, per_read: int = PER_READ
) -> Registers:
    """`count` registers from `address`, `per_read` a request, at most `at_once` requests in flight.

    Raises
    ------
    NoReply : the replies stand still.
    BadReply : a reply is not the next one in order, or not of the length asked for.
    DeviceError : the device answered with an exception.
    """
    starts = range(address, address + count, per_read)
    sizes = [min(per_read, address + count - a) for a in starts]
    requests = [
        struct.pack(">HHHBBHH", t & 0xFFFF, 0, 6, unit, function, a, n)
        for t, (a, n) in enumerate(zip(starts, sizes, strict=True))
    ]
    out = np.empty(count, dtype=np.uint16)
    buffer = bytearray()
    sent = done = filled = 0
    try:
        while done < len(requests):
            if sent < min(done + at_once, len(requests)):
                upto = min(done + at_once, len(requests))
                link.sendall(b"".join(requests[sent:upto]))
                sent = upto
            data = link.recv(1 << 16)
            if not data:
                raise LinkError("the device closed the connection in the middle of a read")
            buffer += data
            done, filled = _take_replies(buffer, done, sent, sizes, unit, function, out, filled)
    except TimeoutError:
        raise NoReply(f"{done} of {len(requests)} replies came, then none") from None
    except OSError as e:
        raise LinkError(f"the connection failed: {e}") from None
    return out


def _take_replies(
    buffer: bytearray, done: int, sent: int, sizes: list[int], unit: int, function: int, out: Registers, filled: int
) -> tuple[int, int]:
    """Move whole replies from `buffer` to `out`; replies and registers that are done."""
    at = 0
    while done < sent and len(buffer) - at >= 9:
        n = sizes[done]
        transaction, protocol, length, from_unit, code, size = struct.unpack_from(">HHHBBB", buffer, at)
        if (transaction, protocol, from_unit) != (done & 0xFFFF, 0, unit):
            raise BadReply(f"reply {transaction} of unit {from_unit} came for request {done & 0xFFFF} to unit {unit}")
        if code == function | 0x80:
            raise DeviceError(exception_words(size))
        if (code, size, length) != (function, 2 * n, 2 * n + 3):
            raise BadReply(f"a reply to function {function} of {2 * n} bytes has function {code}, {size} bytes")
        if len(buffer) - at < 9 + size:
            break
        out[filled : filled + n] = np.frombuffer(buffer, dtype=">u2", count=n, offset=at + 9)
        at += 9 + size
        filled += n
        done += 1
    del buffer[:at]
    return done, filled


def read_rtu(
    line: serial.Serial, unit: int, function: int, address: int, count: int, per_read: int = PER_READ
) -> Registers:
    """`count` registers from `address`; the silence of 3.5 characters is kept between a reply and the next request.

    Raises
    ------
    NoReply, BadReply, DeviceError : as `read_tcp`; BadReply also for a CRC-16 that does not match.
    """
    characters = 11 / line.baudrate
    silence = 1.75e-3 if line.baudrate > 19200 else 3.5 * characters
    out = np.empty(count, dtype=np.uint16)
    for start in range(0, count, per_read):
        n = min(per_read, count - start)
        request = struct.pack(">BBHH", unit, function, address + start, n)
        reply = _exchange(line, request + FramerRTU.compute_CRC(request).to_bytes(2, "big"), 5 + 2 * n)
        ended = time.monotonic()
        if FramerRTU.compute_CRC(reply[:-2]).to_bytes(2, "big") != reply[-2:]:
            raise BadReply(f"the CRC-16 of a reply of {len(reply)} bytes does not match")
        if reply[0] != unit or reply[1] & 0x7F != function:
            raise BadReply(f"unit {reply[0]}, function {reply[1]} answered for unit {unit}, function {function}")
        if reply[1] & 0x80:
            raise DeviceError(exception_words(reply[2]))
        if reply[2] != 2 * n:
            raise BadReply(f"{reply[2]} bytes came for {2 * n}")
        out[start : start + n] = np.frombuffer(reply, dtype=">u2", count=n, offset=3)
        if start + n < count:
            time.sleep(max(0.0, silence - (time.monotonic() - ended)))
    return out


def _exchange(line: serial.Serial, request: bytes, size: int) -> bytes:
    """Send a request; a reply of `size` bytes, or of five if it is an exception."""
    try:
        line.write(request)
        reply = line.read(5)
        if len(reply) == 5 and not reply[1] & 0x80:
            reply += line.read(size - 5)
            if len(reply) < size:
                raise NoReply(f"{len(reply)} of {size} bytes of a reply came")
    except (serial.SerialException, OSError, TypeError) as e:
        raise LinkError(f"the line failed: {e}") from None
    if len(reply) < 5:
        raise NoReply(f"{len(reply)} bytes of a reply came")
    return reply
