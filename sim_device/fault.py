"""What a fault is while it is in force, and what it makes of a reply."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

FOREVER = 1e9
"""s, a pause that ends only when the fault is removed or the link is closed."""

Language = Literal["scpi", "rtu", "tcp"]


@dataclass(frozen=True)
class Pause:
    """Silence on a line."""

    seconds: float


@dataclass(frozen=True)
class Cut:
    """The end of a link: closed in order, reset, gone for some time, or taken by another client."""

    how: Literal["close", "reset", "vanish", "taken"]
    seconds: float = 0.0


Piece = bytes | Pause | Cut
Pieces = list[Piece]
"""What leaves a line: bytes, pauses between them, and what ends it."""


@dataclass
class Fault:
    """A fault in force. ``nth`` None: drawn by ``seed``; ``count`` None: until removed; ``skip``: replies let pass."""

    name: str
    command: str | None
    nth: int | None
    count: int | None
    skip: int
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


Act = Callable[[Fault, bytes, int, Language], Pieces]
"""act(fault, reply, index of the byte it strikes, language): what leaves instead."""

Options = dict[str, tuple[float, float, float]]


@dataclass(frozen=True)
class Kind:
    """A declared fault.

    ``where`` it strikes: the nth "byte" of a reply, the nth "reply", the nth byte "in" from the host, the nth "request"
    of a command, the nth "event" of its sort. ``options`` are name → (default, low, high).
    """

    where: Literal["byte", "reply", "in", "request", "event"]
    does: str
    options: Options = field(default_factory=Options)
    act: Act | None = None
    languages: tuple[Language, ...] = ("scpi", "rtu", "tcp")
