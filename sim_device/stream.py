"""The converter's stream of counts, evaluated only where somebody looks: the comparator or the record memory."""

from __future__ import annotations

import math
import time
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sim_device import sensors
from sim_device.fall import Motion
from sim_device.settings import Rig

Counts = NDArray[np.int16]

FIRST_CHUNK, LONGEST_CHUNK = 1 << 14, 1 << 20


class Comparator(Protocol):
    """What the trigger compares with."""

    @property
    def level(self) -> int: ...
    @property
    def slope(self) -> str: ...
    @property
    def interval_ns(self) -> int: ...


def quiet(rig: Rig, key: tuple[int, ...], first: int, n: int, channel: int = 0) -> Counts:
    """Counts ``first`` to ``first + n`` of a channel while nothing falls: resting value, offset and noise (n,)."""
    scale = sensors.Scale.of(rig, channel)
    noise = sensors.white((*key, channel) if channel else key, first, n)
    return scale.counts(sensors.at_rest(rig, channel) + scale.offset + scale.noise * noise)


def within_noise(rig: Rig, level: int) -> bool:
    """Whether noise alone can reach the level (six standard deviations and a half count)."""
    scale = sensors.Scale.of(rig, 0)
    return abs(level - scale.offset * scale.per_unit) <= 6 * scale.noise * scale.per_unit + 0.5


def first_crossing(counts: Counts, comparator: Comparator) -> int | None:
    """Index of the first sample at or past the level whose forerunner is not."""
    above = counts >= comparator.level if comparator.slope == "POS" else counts <= comparator.level
    crossing = np.flatnonzero(above[1:] & ~above[:-1])
    return int(crossing[0]) + 1 if len(crossing) else None


class Drop:
    """A drop as the recorder sees it.

    Samples are counted from the one at or before first contact, which stands ``phase`` of an interval before it: so the
    same seed and drop give the same samples, whenever the dart was let go.
    """

    def __init__(self, number: int, rig: Rig, motion: Motion, release: float, phase: float, seed: int) -> None:
        """Contact a fall time after ``release`` (ns of the monotonic clock)."""
        self.number, self.rig, self.motion, self.phase = number, rig, motion, phase
        self.release = release
        self.contact = release + motion.t_fall * 1e9
        self._key = (seed, 2 if number >= 0 else 4, abs(number))

    def snap(self, origin: float, interval_ns: int) -> None:
        """Move the contact, by less than an interval, to its phase on a grid that runs already."""
        self.contact = origin + (math.ceil((self.contact - origin) / interval_ns) + self.phase) * interval_ns

    def on_grid(self, origin: float, interval_ns: int) -> float:
        """A grid's origin, moved by less than an interval so that the contact has its phase on it."""
        return self.contact - (self.index(origin, interval_ns) + self.phase) * interval_ns

    def index(self, origin: float, interval_ns: int) -> int:
        """Grid index of the sample counted as 0."""
        return round((self.contact - origin) / interval_ns - self.phase)

    def since_contact(self, index: int, interval_ns: int) -> float:
        """Time of a sample after first contact, ns."""
        return index * interval_ns - self.phase * interval_ns

    def moving_at(self, at: float) -> bool:
        """Whether the dart is not yet at rest at ``at`` (ns of the monotonic clock)."""
        return at < self.contact + self.motion.over * 1e9

    def moving(self) -> bool:
        """Whether the dart moves now."""
        return self.moving_at(time.monotonic_ns())

    def counts(self, first_ns: float, interval_ns: float, n: int, channel: int = 0) -> Counts:
        """Counts (n,) of a channel from ``first_ns`` after first contact on."""
        scale = sensors.Scale.of(self.rig, channel)
        value = sensors.signal(self.rig, self.motion, channel, first_ns * 1e-9, interval_ns * 1e-9, n)
        key = (*self._key, channel) if channel else self._key
        noise = sensors.white(key, round(first_ns / interval_ns + self.phase), n)
        return scale.counts(value + scale.offset + scale.noise * noise)

    def crossing(self, comparator: Comparator, index: int) -> int | None:
        """The first sample from ``index`` on that fires the comparator while the dart moves, None if none does."""
        h = comparator.interval_ns
        if not within_noise(self.rig, comparator.level):
            index = max(index, -1)
        length = FIRST_CHUNK
        while self.since_contact(index, h) * 1e-9 < self.motion.over:
            counts = self.counts(self.since_contact(index - 1, h), h, length + 1)
            if (found := first_crossing(counts, comparator)) is not None:
                return index - 1 + found
            index, length = index + length, min(2 * length, LONGEST_CHUNK)
        return None


def quiet_crossing(rig: Rig, key: tuple[int, ...], comparator: Comparator, index: int, n: int) -> int | None:
    """The first sample of ``index`` to ``index + n`` at which noise alone fires the comparator."""
    found = first_crossing(quiet(rig, key, index - 1, n + 1), comparator)
    return None if found is None else index - 1 + found
