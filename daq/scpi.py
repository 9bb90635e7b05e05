"""SCPI over a wire: text queries and definite-length blocks, every length checked."""

import math

from daq.errors import BadReply, DeviceError, LinkError
from daq.wire import Wire


class Scpi:
    """One instrument. Queries may be repeated; commands are sent once, then its error queue is read, if it has one."""

    def __init__(self, wire: Wire, errors: str | None = "SYST:ERR?") -> None:
        self.wire, self._errors_query = wire, errors

    def send(self, *lines: str) -> None:
        """Lines in one write: in several, TCP holds the later ones back for 40 ms."""
        self.wire.write("".join(f"{line}\n" for line in lines).encode("ascii"))

    def command(self, *commands: str) -> None:
        """Send commands, then read the error queue.

        Raises
        ------
        DeviceError : the instrument refused one; the message holds its own words.
        """
        if not commands:
            return
        if self._errors_query is None:
            self.send(*commands)
            return
        self.send(*commands, self._errors_query)
        if errors := self._errors(self.line(self._errors_query)):
            raise DeviceError(f"{self.wire.port}: {', '.join(commands)} was refused: {'; '.join(errors)}")

    def errors(self) -> list[str]:
        """The instrument's error queue, emptied, oldest first."""
        return [] if self._errors_query is None else self._errors(self.query(self._errors_query))

    def _errors(self, reply: str) -> list[str]:
        assert self._errors_query is not None, "who asks has it"
        found: list[str] = []
        for _ in range(64):
            code = reply.partition(",")[0]
            if not code.lstrip("+-").isdigit():
                raise BadReply(f"{self.wire.port}: {self._errors_query} answered {reply[:60]!r}")
            if int(code) == 0:
                return found
            found.append(reply)
            reply = self.query(self._errors_query)
        raise DeviceError(f"{self.wire.port}: the error queue does not empty: {found[-1]}")

    def query(self, text: str) -> str:
        """The reply to a query, one line of text.

        Raises
        ------
        NoReply : nothing came in time.
        BadReply : what came is not text.
        """
        self.send(text)
        return self.line(text)

    def line(self, text: str) -> str:
        """The line that answers a query that was sent."""
        line = self.wire.read_line()
        if not line.isascii():
            raise BadReply(f"{self.wire.port}: {text} was answered with bytes that are not text: {line[:20]!r}")
        return line.decode("ascii").strip()

    def numbers(self, text: str, count: int | None = None) -> list[int]:
        """The reply to a query as whole numbers; `count` of them, if given."""
        return self.whole_numbers(text, self.query(text), count)

    def whole_numbers(self, text: str, reply: str, count: int | None = None) -> list[int]:
        """A reply to the query `text` as whole numbers; `count` of them, if given."""
        try:
            values = [int(v) for v in reply.split(",")]
        except ValueError:
            raise BadReply(f"{self.wire.port}: {text} was answered {reply[:80]!r}, not with whole numbers") from None
        if count is not None and len(values) != count:
            raise BadReply(f"{self.wire.port}: {text} gave {len(values)} numbers for {count}: {reply[:80]!r}")
        return values

    def some_numbers(self, text: str) -> list[float]:
        """The reply to a query as numbers, whole ones exactly."""
        reply = self.query(text)
        try:
            values = [int(v) if v.strip().lstrip("+-").isdigit() else float(v) for v in reply.split(",")]
        except ValueError:
            values = [math.nan]
        if not all(math.isfinite(v) for v in values):
            raise BadReply(f"{self.wire.port}: {text} was answered {reply[:80]!r}, not with numbers")
        return values

    def ascii_numbers(self, text: str) -> list[int]:
        """The samples that answer a query that was sent, as text; a block's head before them is passed over."""
        line = self.wire.read_line(limit=1 << 26)
        if line[:1] == b"#" and line[1:2].isdigit():
            line = line[2 + int(line[1:2]) :]
        try:
            return [int(v) for v in line.decode("ascii").strip().strip(",").split(",")]
        except ValueError:
            raise BadReply(f"{self.wire.port}: {text} was answered {line[:60]!r}, not with whole numbers") from None

    def block(self, text: str, size: int) -> bytes:
        """The block that answers a query; `size` bytes. As `block_of`."""
        self.send(text)
        return self.block_of(text, size)

    def block_of(self, text: str, size: int) -> bytes:
        """The definite-length block (IEEE 488.2) that answers a query that was sent; `size` bytes.

        Raises
        ------
        NoReply : it stood still before its end.
        BadReply : its head, length or terminator is not as it has to be.
        """
        head = self.wire.read_exactly(2)
        if head[:1] != b"#" or not 1 <= (digits := head[1] - ord("0")) <= 9:
            raise BadReply(f"{self.wire.port}: {text}: a block starts with #1 to #9, not {head!r}")
        length = self.wire.read_exactly(digits)
        if not length.isdigit() or int(length) != size:
            refusal = f"; the device says {'; '.join(self._said())}" if length == b"0" else ""
            raise BadReply(
                f"{self.wire.port}: {text}: {size} bytes were asked for, the block announces {length!r}{refusal}"
            )
        data = self.wire.read_exactly(size)
        if (end := self.wire.read_exactly(1)) not in (b"\n", b"\r"):
            raise BadReply(
                f"{self.wire.port}: {text}: the block of {size} bytes is followed by {end!r}, not by its terminator"
            )
        if end == b"\r":
            self.wire.read_exactly(1)
        return data

    def _said(self) -> list[str]:
        try:
            self.wire.drain()
            return self.errors()
        except LinkError:
            return ["nothing"]
