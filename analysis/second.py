"""The second contact: where the dart comes down again after its first flight."""

from __future__ import annotations

import numpy as np

from analysis.baseline import Level
from analysis.contact import Contact, find_contact
from analysis.kinematics import running
from analysis.record import Array

_BLOCKS_PER_CONTACT = 8
_LEAST_IMPULSE = 0.03  # of the first contact's


def find_second(
    force: Array, dt: float, first: Contact, impulse: float, floor: float, time_constant: float | None
) -> tuple[int, Array, Contact, int] | None:
    """Second contact in `force` (n,) N after `first` of `impulse` N·s: offset, samples from there on, contact in them,
    and how many contacts follow the first in all.

    Means over an eighth of the first contact cancel ringing and rebound vibration; half a contact's length of them must
    carry 3 % of the first impulse.
    """
    if first.end is None or first.start is None:
        return None
    length = first.end - first.start
    begin = first.end + max(length // 4, 4)
    block = max(1, length // _BLOCKS_PER_CONTACT)
    count = (force.size - begin) // block
    if count < _BLOCKS_PER_CONTACT:
        return None
    means = force[begin : begin + count * block].reshape(count, block).mean(axis=1) - first.level.value
    if time_constant is not None and time_constant > 0:
        means += (impulse + running(means, np.arange(count, dtype=np.float64) * (block * dt))) / time_constant
    pushed = np.convolve(means, np.ones(_BLOCKS_PER_CONTACT // 2), mode="valid") * block * dt
    least = max(_LEAST_IMPULSE * impulse, 8 * _spread(means, first.level) * block * dt)
    hits = np.flatnonzero(pushed > least)
    if hits.size == 0:
        return None
    low = max(begin, begin + int(hits[0]) * block - 3 * length)
    high = min(force.size, begin + int(hits[0]) * block + 4 * length)
    piece = force[low:high]
    found = find_contact(piece, dt, floor)
    bounces = 1 + int(np.count_nonzero(np.diff(hits) > _BLOCKS_PER_CONTACT))
    return None if found is None or found.start is None else (low, piece, found, bounces)


def _spread(means: Array, level: Level) -> float:
    """Scatter of block means where nothing happens, N."""
    quiet = 1.4826 * float(np.median(np.abs(np.diff(means)))) / np.sqrt(2)
    return max(quiet, 1e-12 * abs(level.value))
