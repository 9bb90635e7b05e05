"""Faults that the emulator plays on request: declared by name here, struck at the few places that ask.

Lines ask with every reply that leaves and every chunk that arrives, the Modbus server with every reply it builds, the
device with every event that could fail. A fault counts how often it has acted and ends when its ``count`` is used up.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from sim_device.settings import SettingError, nearest


@dataclass(frozen=True)
class Pause:
    """Silence on a line."""

    seconds: float


Pieces = list[bytes | Pause]
"""What leaves a line: bytes, and pauses between them."""

FOREVER = 1e9
"""s, a pause that ends only when the fault is removed or the link is closed."""


@dataclass
class Fault:
    """A fault in force. ``command`` None: any; ``nth`` None: drawn by ``seed``; ``count`` None: until removed."""

    name: str
    command: str | None
    nth: int | None
    count: int | None
    rng: random.Random
    options: dict[str, float]
    seen: int = 0
    acted: int = 0

    def due(self) -> bool:
        """Whether it may still act."""
        return self.count is None or self.acted < self.count

    def place(self, length: int) -> int | None:
        """Index into something of ``length`` bytes where it acts, None if that is too short."""
        if length == 0:
            return None
        nth = self.rng.randint(1, length) if self.nth is None else self.nth
        return nth - 1 if nth <= length else None


@dataclass(frozen=True)
class Kind:
    """A declared fault: where it acts, its options as name → (default, low, high), and what it does to bytes."""

    where: str
    does: str
    options: dict[str, tuple[float, float, float]] = field(default_factory=dict[str, tuple[float, float, float]])
    bytes_out: Callable[[Fault, bytes, int], Pieces] | None = None


def _drop(fault: Fault, data: bytes, at: int) -> Pieces:
    return [data[:at] + data[at + 1 :]]


def _flip(fault: Fault, data: bytes, at: int) -> Pieces:
    return [data[:at] + bytes([data[at] ^ 1 << int(fault.options["bit"])]) + data[at + 1 :]]


def _stall(fault: Fault, data: bytes, at: int) -> Pieces:
    return [data[:at], Pause(fault.options["seconds"]), data[at:]]


KINDS = {
    "drop_byte": Kind("out", "the nth byte of a reply is lost", bytes_out=_drop),
    "flip_byte": Kind("out", "a bit of the nth byte of a reply is inverted", {"bit": (0, 0, 7)}, _flip),
    "stall": Kind("out", "the line falls silent before the nth byte of a reply", {"seconds": (1, 0, FOREVER)}, _stall),
    "drop_byte_in": Kind("in", "the nth byte from the host, counted from now, is lost", bytes_out=_drop),
    "exception": Kind("reply", "the nth Modbus request is answered with an exception", {"code": (6, 1, 255)}),
    "missing_trigger": Kind("event", "the nth trigger is not seen"),
    "gate_missing": Kind("event", "the nth gate edge is not stamped"),
    "stuck_bit": Kind(
        "event", "a bit of every sample of the nth record is stuck", {"bit": (3, 0, 15), "at": (1, 0, 1)}
    ),
}


class Faults:
    """The faults in force, in the order in which they were set."""

    def __init__(self) -> None:
        """None."""
        self.active: list[Fault] = []

    def add(self, name: object, settings: dict[str, Any]) -> Fault:
        """Set a fault; ``command``, when given, is the name under which replies are announced.

        Raises
        ------
        SettingError
            Unknown fault or option, or a value beyond its limits.
        """
        if not isinstance(name, str) or name not in KINDS:
            raise SettingError(f"fault {nearest(str(name), list(KINDS))}; faults are {', '.join(KINDS)}")
        kind = KINDS[name]
        command = settings.pop("command", None)
        limits = {"nth": (None, 1, 1e9), "count": (1, 1, 1e9), "seed": (0, 0, 2**63), **kind.options}
        values: dict[str, Any] = {key: limit[0] for key, limit in limits.items()}
        for key, value in settings.items():
            if key not in limits:
                raise SettingError(nearest(key, [*limits, "command"]))
            _, low, high = limits[key]
            if value is not None or key not in ("nth", "count"):
                if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
                    raise SettingError(f"{key} must be {low:g} to {high:g}, not {value!r}")
                if key != "seconds" and value != int(value):
                    raise SettingError(f"{key} must be a whole number, not {value!r}")
            values[key] = value
        options = {key: float(values[key]) for key in kind.options}
        fault = Fault(name, command, values["nth"], values["count"], random.Random(values["seed"]), options)
        if kind.where != "out" and fault.nth is None:
            fault.nth = 1
        self.active.append(fault)
        return fault

    def clear(self) -> None:
        """Remove all."""
        self.active.clear()

    def _at(self, where: str) -> list[Fault]:
        return [fault for fault in self.active if KINDS[fault.name].where == where and fault.due()]

    def outgoing(self, command: str, reply: bytes) -> Pieces:
        """What leaves the line instead of ``reply``, the answer to ``command``."""
        pieces: Pieces = [reply]
        for fault in self._at("out"):
            act = KINDS[fault.name].bytes_out
            whole = b"".join(piece for piece in pieces if isinstance(piece, bytes))
            if act is None or fault.command not in (None, command) or (at := fault.place(len(whole))) is None:
                continue
            fault.acted += 1
            for index, piece in enumerate(pieces):
                if isinstance(piece, bytes):
                    if at < len(piece):
                        pieces[index : index + 1] = act(fault, piece, at)
                        break
                    at -= len(piece)
        return pieces

    def incoming(self, data: bytes) -> bytes:
        """What the device gets of ``data`` from the host."""
        for fault in self._at("in"):
            act = KINDS[fault.name].bytes_out
            at = (fault.nth or 1) - 1 - fault.seen
            fault.seen += len(data)
            while act is not None and fault.due() and 0 <= at < len(data):
                data = b"".join(piece for piece in act(fault, data, at) if isinstance(piece, bytes))
                fault.acted += 1
                fault.nth = (fault.nth or 1) + 1
        return data

    def strikes(self, name: str, command: str | None = None) -> Fault | None:
        """The fault ``name`` if it acts on the event that happens now."""
        for fault in self.active:
            if fault.name == name and fault.due() and fault.command in (None, command):
                fault.seen += 1
                if fault.seen >= (fault.nth or 1):
                    fault.acted += 1
                    return fault
        return None

    def report(self) -> list[dict[str, Any]]:
        """Every fault set since the last clear, with how often it has acted."""
        return [
            {"name": f.name, "command": f.command, "nth": f.nth, "count": f.count, "acted": f.acted, **f.options}
            for f in self.active
        ]
