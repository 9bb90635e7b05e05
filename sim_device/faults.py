"""The faults in force: set by name, struck at the few places that ask, counted, removed.

Lines ask with every reply that leaves and every chunk that arrives, the languages with every request, the device with
every event that could fail. A fault counts how often it has acted and ends when its ``count`` is used up.
"""

from __future__ import annotations

import random
from typing import Any

from sim_device.fault import Fault, Kind, Language, Pause, Pieces
from sim_device.fault_kinds import KINDS
from sim_device.settings import SettingError, nearest

WHOLE = ("bit", "value", "size", "by", "code", "missing", "at", "nth", "count", "skip", "seed")


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
        if command is not None and kind.where in ("in", "event"):
            raise SettingError(f"{name} belongs to no command: it strikes {_place(kind)}")
        limits = {"nth": (None, 1, 1e9), "count": (1, 1, 1e9), "skip": (0, 0, 1e9), "seed": (0, 0, 2**63)}
        limits |= kind.options
        values: dict[str, Any] = {key: limit[0] for key, limit in limits.items()}
        for key, value in settings.items():
            if key not in limits:
                raise SettingError(nearest(key, [*limits, "command"]))
            _, low, high = limits[key]
            if value is not None or key not in ("nth", "count"):
                if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
                    raise SettingError(f"{key} must be {low:g} to {high:g}, not {value!r}")
                if key in WHOLE and value != int(value):
                    raise SettingError(f"{key} must be a whole number, not {value!r}")
            values[key] = value
        options = {key: float(values[key]) for key in kind.options}
        rng = random.Random(values["seed"])
        fault = Fault(name, command, values["nth"], values["count"], values["skip"], rng, options)
        if kind.where != "byte" and fault.nth is None:
            fault.nth = 1
        self.active.append(fault)
        return fault

    def clear(self, name: str | None = None) -> int:
        """Remove all, or those of a name; how many.

        Raises
        ------
        SettingError
            No fault of that name is in force.
        """
        kept = [] if name is None else [fault for fault in self.active if fault.name != name]
        removed = len(self.active) - len(kept)
        if name is not None and not removed:
            raise SettingError(f"no fault {name!r} is in force: {', '.join(f.name for f in self.active) or 'none is'}")
        self.active[:] = kept
        return removed

    def _at(self, *where: str) -> list[tuple[Fault, Kind]]:
        return [(f, KINDS[f.name]) for f in self.active if KINDS[f.name].where in where and f.due()]

    def outgoing(self, command: str, reply: bytes, language: Language) -> Pieces:
        """What leaves the line instead of ``reply``, the answer to ``command``."""
        pieces: Pieces = [reply]
        for fault, kind in self._at("byte", "reply"):
            if kind.act is None or fault.command not in (None, command) or language not in kind.languages:
                continue
            fault.seen += 1
            if kind.where == "reply":
                if fault.seen >= (fault.nth or 1) + fault.skip:
                    fault.acted += 1
                    index = next(i for i, piece in enumerate(pieces) if isinstance(piece, bytes))
                    pieces[index : index + 1] = kind.act(fault, bytes(pieces[index]), 0, language)  # pyright: ignore[reportArgumentType]  next() found bytes
            elif fault.seen > fault.skip:
                _strike_byte(fault, kind, pieces, language)
        if language == "scpi" and (busy := self.strikes("busy", command)) is not None:
            pieces.insert(0, Pause(busy.options["seconds"]))
        return pieces

    def incoming(self, data: bytes) -> bytes:
        """What the device gets of ``data`` from the host."""
        for fault, kind in self._at("in"):
            act = kind.act
            at = (fault.nth or 1) - 1 - fault.seen
            fault.seen += len(data)
            while act is not None and fault.due() and 0 <= at < len(data):
                before = len(data)
                data = b"".join(piece for piece in act(fault, data, at, "scpi") if isinstance(piece, bytes))
                fault.acted += 1
                fault.nth = (fault.nth or 1) + 1
                at += 1 + len(data) - before
        return data

    def echo(self, data: bytes) -> bytes:
        """What of ``data`` from the host comes straight back to it."""
        for fault, _ in self._at("in"):
            if fault.name == "echo":
                first = max(0, (fault.nth or 1) - 1 - (fault.seen - len(data)))
                if first < len(data):
                    fault.acted += 1
                    return data[first:]
        return b""

    def strikes(self, name: str, command: str | None = None) -> Fault | None:
        """The fault ``name`` if it acts on the event that happens now."""
        for fault in self.active:
            if fault.name == name and fault.due() and fault.command in (None, command):
                fault.seen += 1
                if fault.seen >= (fault.nth or 1) + fault.skip:
                    fault.acted += 1
                    return fault
        return None

    def report(self) -> list[dict[str, Any]]:
        """Every fault set since the last clear, with how often it has acted."""
        return [
            {"name": f.name, "command": f.command, "nth": f.nth, "count": f.count, "acted": f.acted, **f.options}
            for f in self.active
        ]


def _strike_byte(fault: Fault, kind: Kind, pieces: Pieces, language: Language) -> None:
    assert kind.act is not None, "a fault of a byte says what it does to it"
    at = fault.place(sum(len(piece) for piece in pieces if isinstance(piece, bytes)))
    if at is None:
        return
    fault.acted += 1
    for index, piece in enumerate(pieces):
        if isinstance(piece, bytes):
            if at < len(piece):
                pieces[index : index + 1] = kind.act(fault, piece, at, language)
                return
            at -= len(piece)


def _place(kind: Kind) -> str:
    return "a byte from the host" if kind.where == "in" else "an event of the device"
