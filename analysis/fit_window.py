"""The part of a record that a model is fitted to: means of a few samples each, before, in and after the contact."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.events import Events
from analysis.record import Array, Record
from analysis.speed import Speed

POINTS = 1000
"""Of a contact, at the least, where it has as many samples."""
_BEFORE, _AFTER = 0.03, 0.5
"""Of the contact's length; what lies further before has said its word as the zero level."""
_RINGS_FOR = 1e-3
"""s after contact, at the least, so that ringing is told from the model's own shape."""
_NEAR_RAIL = 3
"""Samples beside one at the end of the range that are left out with it."""


@dataclass(frozen=True)
class Window:
    """t, force : (n,) s on the record's axis and N (zero level, droop and tip mass corrected), means of ``block``
    samples, evenly spaced every ``step`` s; noise : N, of such a mean
    level, u_level : N, zero level that was taken off (of the sensor), and what it may be off
    kept : (n,) bool, points that are valid; start : s, first contact as found; length : s, of the contact
    v0 : speed at contact; left_out : why points are not valid, in words, or None
    """

    t: Array
    force: Array
    kept: NDArray[np.bool_]
    step: float
    block: int
    noise: float
    level: float
    u_level: float
    start: float
    length: float
    whole: bool
    v0: Speed
    left_out: str | None

    @property
    def reach(self) -> float:
        """s on the record's axis: the last point that is valid. What the model says after it has not been seen."""
        return float(self.t[np.flatnonzero(self.kept)[-1]])


def window_of(record: Record, events: Events, v0: Speed) -> Window:
    """The window around the first contact; what the range cuts off and what follows the record's end is left out."""
    assert events.start is not None, "the caller has seen to it"
    t, force, dt = events.t, events.force, record.dt
    whole = events.end is not None
    end = events.end.t if events.end is not None else float(t[-1])
    start, length = events.start.t, max(end - events.start.t, 8 * dt)
    last = end + max(_AFTER * length, _RINGS_FOR)
    if events.second is not None:
        last = min(last, events.second.t - 5 * dt)
    first, stop = np.searchsorted(t, [start - _BEFORE * length, last])
    block = max(1, int(length / dt) // POINTS)
    n = (stop - first) // block
    part = slice(first, first + n * block)
    railed: NDArray[np.bool_] = np.any(_railed(record, events)[part].reshape(n, block), axis=1)
    left_out = f"{int(railed.sum()) * block} samples at the end of the range were left out" if railed.any() else None
    return Window(
        t=t[part].reshape(n, block).mean(axis=1),
        force=force[part].reshape(n, block).mean(axis=1),
        kept=~railed,
        step=block * dt,
        block=block,
        noise=events.noise / np.sqrt(block),
        level=events.contact.level.value,
        u_level=max(events.u_level, 1e-9),
        start=start,
        length=length,
        whole=whole,
        v0=v0,
        left_out=left_out,
    )


def until(window: Window, broken: float) -> Window:
    """The window without what follows a failure, a crack or a slip (s on the record's axis)."""
    kept = window.kept & (window.t < broken - 2 * window.step)
    why = "what follows the failure of the specimen, its crack or its slip was left out"
    return replace(window, kept=kept, left_out=why if window.left_out is None else f"{window.left_out}, and {why}")


def _railed(record: Record, events: Events) -> NDArray[np.bool_]:
    """(n,) of the samples of ``events``: at an end of the range, or beside one."""
    raw = record.force[events.first : events.first + events.force.size]
    if record.rails is None:
        return np.zeros(raw.size, dtype=bool)
    half = 0.5 * (record.lsb or 0.0) + 1e-9 * abs(record.rails[1] - record.rails[0])
    at = (raw >= max(record.rails) - half) | (raw <= min(record.rails) + half)
    return np.convolve(at, np.ones(2 * _NEAR_RAIL + 1), mode="same") > 0.5 if at.any() else at
