"""SCPI as a language: bytes to lines, lines to commands, headers in all their spellings, replies with their ends."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

from sim_device.device import Device
from sim_device.errors import DeviceError
from sim_device.fault import Language

LONGEST_LINE = 1 << 16
HEADER = re.compile(r"[*:]?[A-Za-z][A-Za-z0-9_]*(?::[A-Za-z][A-Za-z0-9_]*)*\??")
NODE = re.compile(r"(\[?)(:?)([*A-Za-z]+)(:?)(\]?)")


@dataclass(frozen=True)
class Command:
    """A header as the protocol writes it, what it takes and what it does.

    ``answer`` gets the parameters as text and returns the reply without its end, or None. ``data`` marks a query whose
    failure is answered with the empty block.
    """

    header: str
    parameters: int
    answer: Callable[[Device, list[str]], bytes | None]
    data: bool = False

    @property
    def name(self) -> str:
        """The shortest spelling, by which faults and logs know the command."""
        return "".join(c for c in re.sub(r"\[[^]]*\]", "", self.header) if not c.islower())


def spelling(header: str) -> re.Pattern[str]:
    """All spellings of a header: short or long nodes, optional ones left out, either case."""
    query = header.endswith("?")
    pattern = ""
    for opened, before, word, after, _ in NODE.findall(header.rstrip("?")):
        short = re.match(r"[*A-Z]+", word)
        start = short.group() if short else ""
        node = re.escape(start) + (f"(?:{word[len(start) :]})?" if len(word) > len(start) else "")
        node = before + node + after
        pattern += f"(?:{node})?" if opened else node
    return re.compile(pattern + (r"\?" if query else ""), re.IGNORECASE)


class Interface:
    """The commands of a device by header."""

    def __init__(self, commands: list[Command]) -> None:
        """Serve these commands."""
        self._commands = [(spelling(command.header), command) for command in commands]

    def find(self, header: str) -> Command | None:
        """The command of a full header, None if there is none."""
        return next((command for pattern, command in self._commands if pattern.fullmatch(header)), None)


class Session:
    """One client's line: keeps what has arrived of an unfinished command."""

    language: Language = "scpi"

    def __init__(self, device: Device, interface: Interface) -> None:
        """Serve ``device``."""
        self._device, self._interface = device, interface
        self._pending = bytearray()
        self._skipping = False

    def feed(self, data: bytes) -> Iterator[tuple[str, bytes]]:
        """Take bytes in; yields the replies they cause, each with the name of its command."""
        self._pending += data
        while (end := self._pending.find(b"\n")) >= 0:
            line = bytes(self._pending[:end])
            del self._pending[: end + 1]
            if self._skipping:
                self._skipping = False
            elif len(line) > LONGEST_LINE:
                self._device.status.report(-102)
            else:
                yield from self._line(line.rstrip(b"\r"))
        if len(self._pending) > LONGEST_LINE:
            self._pending.clear()
            if not self._skipping:
                self._device.status.report(-102)
            self._skipping = True

    def _line(self, line: bytes) -> Iterator[tuple[str, bytes]]:
        replies: list[tuple[str, bytes]] = []
        path = ""
        try:
            text = line.decode("ascii")
        except UnicodeDecodeError:
            self._device.status.report(-102)
            return
        for unit in text.split(";"):
            if not (unit := unit.strip()):
                continue
            header, _, rest = unit.partition(" ") if "\t" not in unit else re.split(r"([ \t])", unit, maxsplit=1)
            try:
                command, path = self._resolve(header, path)
            except DeviceError as error:
                self._device.status.report(error.code)
                break
            reply = self._run(command, rest.strip())
            if reply is not None:
                replies.append((command.name, reply))
        for index, (name, reply) in enumerate(replies):
            yield name, reply + (b"\n" if index == len(replies) - 1 else b";")

    def _resolve(self, header: str, path: str) -> tuple[Command, str]:
        """The command of a header after one at ``path``: from there first, then from the root."""
        if not HEADER.fullmatch(header):
            raise DeviceError(-102)
        if header.startswith("*"):
            full = [header]
        elif header.startswith(":"):
            full = [header[1:]]
        else:
            full = [path + header, header]
        for candidate in full:
            if (command := self._interface.find(candidate)) is not None:
                return command, path if header.startswith("*") else candidate.rpartition(":")[0] + ":" * (
                    ":" in candidate
                )
        raise DeviceError(-113)

    def _run(self, command: Command, rest: str) -> bytes | None:
        parameters = [parameter.strip() for parameter in rest.split(",")] if rest else []
        try:
            if "" in parameters:
                raise DeviceError(-102)
            if len(parameters) != command.parameters:
                raise DeviceError(-109 if len(parameters) < command.parameters else -108)
            return None if self._device.struck(command.name) else command.answer(self._device, parameters)
        except DeviceError as error:
            self._device.status.report(error.code)
            return block(b"") if command.data else None


def block(data: bytes) -> bytes:
    """A definite-length block of IEEE 488.2."""
    length = str(len(data)) if data else "0"
    return f"#{len(length)}{length}".encode() + data


def decimal(text: str) -> Decimal:
    """A decimal number, or DeviceError −104."""
    try:
        value = Decimal(text)
    except InvalidOperation:
        raise DeviceError(-104) from None
    if not value.is_finite() or abs(value.adjusted()) > 60:
        raise DeviceError(-104 if not value.is_finite() else -222)
    return value


def integer(text: str) -> int:
    """A number rounded to a whole one (IEEE 488.2), or DeviceError −104."""
    return round(decimal(text))


def word(text: str, *choices: str) -> str:
    """The short form of the choice that ``text`` spells, or DeviceError −224."""
    for choice in choices:
        if spelling(choice).fullmatch(text):
            return "".join(c for c in choice if c.isupper())
    raise DeviceError(-224 if re.fullmatch(r"[A-Za-z]\w*", text) else -104)
