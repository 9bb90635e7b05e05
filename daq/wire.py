"""A byte stream to a device over pyserial: exact reads with deadlines from bytes and baud."""

import time

import serial

from daq.errors import LinkError, NoReply

PROGRESS_LIMIT_S = 1.0
"""How long a reply may stand still before it is given up."""
_QUIET_S = 0.05


class Wire:
    """An open serial line or raw TCP socket.

    Raises
    ------
    LinkError : the port is not there, is taken, or its address makes no sense.
    """

    def __init__(self, port: str, baud: int) -> None:
        self.port = port
        self._buffer = bytearray()
        try:
            self._serial = serial.serial_for_url(port, baudrate=baud, timeout=PROGRESS_LIMIT_S, write_timeout=5.0)
        except (serial.SerialException, ValueError, OSError) as e:
            raise LinkError(
                f"port {port} cannot be opened: {e}; check the cable and the port in the rig file"
            ) from None

    def write(self, data: bytes) -> None:
        try:
            self._serial.write(data)
        except (serial.SerialException, OSError) as e:
            raise LinkError(f"port {self.port} failed while writing: {e}") from None

    def read_exactly(self, size: int, first_byte_s: float = PROGRESS_LIMIT_S) -> bytes:
        """`size` bytes.

        Raises
        ------
        NoReply : nothing came for `first_byte_s` at the start, or for PROGRESS_LIMIT_S later; says how much did come.
        """
        while len(self._buffer) < size:
            self._fill(size - len(self._buffer), first_byte_s if not self._buffer else PROGRESS_LIMIT_S, size)
        taken = bytes(self._buffer[:size])
        del self._buffer[:size]
        return taken

    def read_line(self, first_byte_s: float = PROGRESS_LIMIT_S, limit: int = 4096) -> bytes:
        """Up to LF, which is left out with a CR before it. For text replies alone: data may hold an LF anywhere."""
        searched = 0
        while (end := self._buffer.find(b"\n", searched)) < 0:
            searched = len(self._buffer)
            if searched > limit:
                raise NoReply(f"port {self.port}: {searched} bytes without an end of line")
            self._fill(1, first_byte_s if not self._buffer else PROGRESS_LIMIT_S, searched + 1)
        line = bytes(self._buffer[:end])
        del self._buffer[: end + 1]
        return line.rstrip(b"\r")

    def _fill(self, wanted: int, patience_s: float, total: int) -> None:
        """One read: what is wanted or what has come, at least a byte."""
        try:
            waiting = self._serial.in_waiting
            self._serial.timeout = patience_s
            # An exact read of a large block is the fast way on a pty; what came before its time-out counts as progress.
            data = self._serial.read(max(waiting, min(wanted, 1 << 16)) if wanted > 1 else max(1, waiting))
        except (serial.SerialException, OSError, TypeError) as e:
            # pyserial raises TypeError when another thread or a vanished device has closed the descriptor.
            raise LinkError(f"port {self.port} failed while reading: {e}") from None
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
        try:
            self._serial.timeout = _QUIET_S
            while data := self._serial.read(4096):
                dropped += len(data)
                if time.monotonic() > end:
                    raise NoReply(f"port {self.port} does not fall silent: {dropped} bytes in {at_most_s:g} s")
        except (serial.SerialException, OSError) as e:
            raise LinkError(f"port {self.port} failed while reading: {e}") from None
        return dropped

    def close(self) -> None:
        self._serial.close()
