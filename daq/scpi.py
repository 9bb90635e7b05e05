"""SCPI over a wire: text queries and definite-length blocks, every length checked."""

from daq.errors import BadReply, DeviceError, LinkError
from daq.wire import Wire


class Scpi:
    """One instrument. Queries may be repeated; commands are sent once and then checked by `SYST:ERR?`."""

    def __init__(self, wire: Wire) -> None:
        self.wire = wire

    def command(self, *commands: str) -> None:
        """Send commands, then read the error queue.

        Raises
        ------
        DeviceError : the instrument refused one; the message holds its own words.
        """
        # Commands and the first query go out in one write: in two, TCP holds the second back for 40 ms.
        self.wire.write("".join(f"{c}\n" for c in (*commands, "SYST:ERR?")).encode("ascii"))
        if errors := self._errors(self._line("SYST:ERR?")):
            raise DeviceError(f"{self.wire.port}: {', '.join(commands)} was refused: {'; '.join(errors)}")

    def errors(self) -> list[str]:
        """The instrument's error queue, emptied, oldest first."""
        return self._errors(self.query("SYST:ERR?"))

    def _errors(self, reply: str) -> list[str]:
        found: list[str] = []
        for _ in range(64):
            code = reply.partition(",")[0]
            if not code.lstrip("+-").isdigit():
                raise BadReply(f"{self.wire.port}: SYST:ERR? answered {reply[:60]!r}")
            if int(code) == 0:
                return found
            found.append(reply)
            reply = self.query("SYST:ERR?")
        raise DeviceError(f"{self.wire.port}: the error queue does not empty: {found[-1]}")

    def query(self, text: str) -> str:
        """The reply to a query, one line of text.

        Raises
        ------
        NoReply : nothing came in time.
        BadReply : what came is not text.
        """
        self.wire.write(text.encode("ascii") + b"\n")
        return self._line(text)

    def _line(self, text: str) -> str:
        line = self.wire.read_line()
        if not line.isascii():
            raise BadReply(f"{self.wire.port}: {text} was answered with bytes that are not text: {line[:20]!r}")
        return line.decode("ascii").strip()

    def numbers(self, text: str, count: int | None = None) -> list[int]:
        """The reply to a query as whole numbers; `count` of them, if given."""
        reply = self.query(text)
        try:
            values = [int(v) for v in reply.split(",")]
        except ValueError:
            raise BadReply(f"{self.wire.port}: {text} was answered {reply[:80]!r}, not with whole numbers") from None
        if count is not None and len(values) != count:
            raise BadReply(f"{self.wire.port}: {text} gave {len(values)} numbers for {count}: {reply[:80]!r}")
        return values

    def number(self, text: str) -> float:
        reply = self.query(text)
        try:
            return float(reply)
        except ValueError:
            raise BadReply(f"{self.wire.port}: {text} was answered {reply[:60]!r}, not with a number") from None

    def block(self, text: str, size: int) -> bytes:
        """The definite-length block (IEEE 488.2) that answers a query; `size` bytes.

        Raises
        ------
        NoReply : it stood still before its end.
        BadReply : its head, length or terminator is not as it has to be.
        """
        self.wire.write(text.encode("ascii") + b"\n")
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
