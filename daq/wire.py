"""A byte stream to a device, a serial line by pyserial or a TCP socket: exact reads that end where nothing comes."""

import contextlib
import os
import select
import socket
import time
from typing import Protocol

import serial

from daq.errors import LinkError, NoReply

PROGRESS_LIMIT_S = 1.0
"""How long a reply may stand still before it is given up."""
_QUIET_S = 0.05
_MOST = 1 << 18


class Stream(Protocol):
    """Where bytes come from. Every call raises OSError or serial.SerialException when the link is gone."""

    def write(self, data: bytes) -> None: ...
    def read(self, wanted: int, patience_s: float) -> bytes:
        """What has come, at least a byte, more if `wanted` allows; empty if nothing came in time."""
        ...

    def close(self) -> None: ...


class _Line:
    """A serial line, or what pyserial makes look like one."""

    def __init__(self, port: str, baud: int) -> None:
        self._serial = serial.serial_for_url(port, baudrate=baud, timeout=PROGRESS_LIMIT_S, write_timeout=5.0)
        # A line of the system's own, opened not to block; `rfc2217://` has none.
        self._fd: int | None = None if "://" in port else self._serial.fileno()

    def write(self, data: bytes) -> None:
        self._serial.write(data)

    def read(self, wanted: int, patience_s: float) -> bytes:
        if self._fd is None:
            self._serial.timeout = patience_s
            return self._serial.read(max(1, min(wanted, self._serial.in_waiting)))
        # pyserial asks the system whether there is something before each read; here only after one that gave nothing.
        if data := os.read(self._fd, _MOST):
            return data
        if not select.select([self._fd], [], [], patience_s)[0]:
            return b""
        if data := os.read(self._fd, _MOST):
            return data
        raise OSError("the device is gone")

    def close(self) -> None:
        with contextlib.suppress(OSError, serial.SerialException):
            self._serial.close()


class _Socket:
    """Raw TCP; pyserial's own asks the system three times for each piece."""

    def __init__(self, port: str) -> None:
        host, _, number = port.removeprefix("socket://").rpartition(":")
        if not host or not number.isdigit():
            raise ValueError("it is not socket://host:port")
        self._socket = socket.create_connection((host, int(number)), timeout=5.0)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def write(self, data: bytes) -> None:
        self._socket.settimeout(5.0)
        self._socket.sendall(data)

    def read(self, wanted: int, patience_s: float) -> bytes:
        self._socket.settimeout(patience_s)
        try:
            data = self._socket.recv(_MOST)
        except TimeoutError:
            return b""
        if not data:
            raise OSError("the device closed the connection")
        return data

    def close(self) -> None:
        self._socket.close()


class Wire:
    """An open serial line (`rfc2217://` too) or raw TCP socket (`socket://host:port`).

    patience_s : how long a reply's first byte is waited for

    Raises
    ------
    LinkError : the port is not there, is taken, or its address makes no sense.
    """

    def __init__(self, port: str, baud: int, patience_s: float = PROGRESS_LIMIT_S) -> None:
        self.port, self._baud, self._patience_s = port, baud, patience_s
        self._buffer = bytearray()
        self._stream: Stream | None = None
        self._open()

    def _open(self) -> Stream:
        if self._stream is None:
            try:
                is_socket = self.port.startswith("socket://")
                self._stream = _Socket(self.port) if is_socket else _Line(self.port, self._baud)
            except (serial.SerialException, ValueError, OSError) as e:
                raise LinkError(
                    f"port {self.port} cannot be opened: {e}; check the cable and the port in the rig file"
                ) from None
        return self._stream

    def _lost(self, doing: str, error: Exception) -> LinkError:
        """The link is gone: the next use opens it anew."""
        self.close()
        return LinkError(f"port {self.port} failed while {doing}: {error}")

    def write(self, data: bytes) -> None:
        stream = self._open()
        try:
            stream.write(data)
        except (serial.SerialException, OSError) as e:
            raise self._lost("writing", e) from None

    def read_exactly(self, size: int) -> bytes:
        """`size` bytes.

        Raises
        ------
        NoReply : nothing came for `patience_s` at the start, or for PROGRESS_LIMIT_S later; says how much did come.
        """
        while len(self._buffer) < size:
            self._fill(size - len(self._buffer), self._patience_s if not self._buffer else PROGRESS_LIMIT_S, size)
        taken = bytes(memoryview(self._buffer)[:size])
        del self._buffer[:size]
        return taken

    def read_line(self, limit: int = 4096) -> bytes:
        """Up to LF, which is left out with a CR before it. For text replies alone: data may hold an LF anywhere."""
        searched = 0
        while (end := self._buffer.find(b"\n", searched)) < 0:
            searched = len(self._buffer)
            if searched > limit:
                raise NoReply(f"port {self.port}: {searched} bytes without an end of line")
            self._fill(1, self._patience_s if not self._buffer else PROGRESS_LIMIT_S, searched + 1)
        line = bytes(self._buffer[:end])
        del self._buffer[: end + 1]
        return line.rstrip(b"\r")

    def _fill(self, wanted: int, patience_s: float, total: int) -> None:
        """One read: what is wanted or what has come, at least a byte."""
        stream = self._open()
        try:
            data = stream.read(wanted, patience_s)
        except (serial.SerialException, OSError, TypeError) as e:
            # pyserial raises TypeError when another thread or a vanished device has closed the descriptor.
            raise self._lost("reading", e) from None
        if not data:
            raise NoReply(
                f"port {self.port}: no reply for {patience_s:g} s, {len(self._buffer)} of {total} bytes had come"
            )
        self._buffer += data

    def drain(self, at_most_s: float = 5.0) -> int:
        """Throw away what comes until the line is silent; the number of bytes thrown away.

        Raises
        ------
        NoReply : the line does not fall silent.
        """
        dropped = len(self._buffer)
        self._buffer.clear()
        end = time.monotonic() + at_most_s
        stream = self._open()
        try:
            while data := stream.read(4096, _QUIET_S):
                dropped += len(data)
                if time.monotonic() > end:
                    raise NoReply(f"port {self.port} does not fall silent: {dropped} bytes in {at_most_s:g} s")
        except (serial.SerialException, OSError, TypeError) as e:
            raise self._lost("reading", e) from None
        return dropped

    def close(self) -> None:
        self._buffer.clear()
        if self._stream is not None:
            self._stream.close()
            self._stream = None
