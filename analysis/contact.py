"""Where in a record the contact lies, to the sample: what the sub-sample estimates start from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.baseline import Level, difference_noise, level_before, typical_level
from analysis.record import Array

_RUN_LEVEL = 0.25  # of the largest excursion: what counts as a pulse
_LEAST_SAMPLES = 4
_LEVEL_TIME = 5e-3  # s before contact that the zero level is taken from, at the least


@dataclass(frozen=True)
class Contact:
    """The first contact, in samples.

    start, end : first and one past the last sample in contact (end None: still in contact where the record ends,
    start None: already in contact where it begins); peak : largest sample; level : zero level;
    real_level : it comes from samples before contact; rise : samples from 25 % to 60 % of the peak.
    """

    start: int | None
    peak: int
    end: int | None
    level: Level
    real_level: bool
    rise: int


def find_contact(force: Array, dt: float, floor: float, pretrigger: int | None = None) -> Contact | None:
    """First contact in `force` (n,) N, or None. `floor` : N, least noise that the record can have."""
    if force.size < _LEAST_SAMPLES + 1:
        return None
    zero = typical_level(force, pretrigger)
    noise = max(difference_noise(force), floor)
    highest = float(force.max()) - zero
    if not highest > max(8 * noise, 1e-9 * abs(zero)):
        return None
    run = _first_run(force, zero, highest, dt)
    if run is None:
        return None
    first, last = run
    peak = first + int(np.argmax(force[first : last + 1]))
    above = float(force[peak]) - zero
    if not above > 8 * noise:
        return None
    first = first + int(np.argmax(force[first : peak + 1] >= zero + _RUN_LEVEL * above))
    to_60 = int(np.argmax(force[first : peak + 1] >= zero + 0.6 * above))
    rise = max(to_60, 1)
    # The rise from 25 % to 60 % carried back to zero; a Hertz contact begins another 0.55 of it earlier.
    zero_at = first - int(rise * _RUN_LEVEL / 0.35) - 3
    quiet_end = max(0, zero_at - rise if zero_at - rise >= 64 else zero_at - int(0.6 * rise))
    if pretrigger is not None:
        # A level trigger comes a little after the onset; half of what precedes it is surely quiet.
        quiet_end = max(quiet_end, min(pretrigger, first) // 2)
    length = max(2 * (last - first + 1), 64, int(_LEVEL_TIME / dt))
    level = level_before(force[max(0, quiet_end - length) : quiet_end], floor)
    real = level is not None
    if level is None:
        level = _level_without_pretrigger(force, last, length, zero, noise, floor)
    run = last - first + 1
    search = max(0, first - 2 * run)
    away = force[search : last + 4 * run + 64] - level.value
    above = float(force[peak]) - level.value
    limit = max(4.5 * level.noise, 1.5 * floor, 1e-4 * above)
    loud = np.abs(away[: first - search + 1]) > limit
    start = _first_sustained(loud, 6)
    start_at: int | None = search + (loud.size - 1 if start is None else start)
    if first == 0 or (quiet_end < _LEAST_SAMPLES and bool(loud[0])):
        start_at = None  # the onset itself may lie before the record
    end_at: int | None = None
    after = away[last - search :]
    for share in (0.004, 0.02, 0.06):
        low = after < max(4.5 * level.noise, 1.5 * floor, share * above)
        hold = max(6, run // 30)
        found = _first_sustained(low, hold, complete=True)
        if found is not None:
            end_at = last + found
            break
    return Contact(start_at, peak, end_at, level, real, rise)


def _first_run(force: Array, zero: float, highest: float, dt: float) -> tuple[int, int] | None:
    """First and last sample of the first pulse that carries at least a tenth of the largest pulse's impulse."""
    over = np.flatnonzero(force > zero + _RUN_LEVEL * highest)
    breaks = np.flatnonzero(np.diff(over) > max(8, int(1e-4 / dt)))
    starts = np.concatenate(([0], breaks + 1))
    ends = np.concatenate((breaks, [over.size - 1]))
    impulse = np.add.reduceat(force[over] - zero, starts)
    impulse[ends - starts + 1 < _LEAST_SAMPLES] = 0.0
    if not impulse.max() > 0:
        return None
    first = int(np.flatnonzero(impulse >= 0.1 * impulse.max())[0])
    return int(over[starts[first]]), int(over[ends[first]])


def _first_sustained(flags: np.ndarray, hold: int, complete: bool = False) -> int | None:
    """First index that is set and followed by `hold` samples of which most (`complete`: nine tenths) are set."""
    if flags.size == 0:
        return None
    total = np.concatenate(([0], np.cumsum(flags)))
    last = np.minimum(np.arange(flags.size) + hold, flags.size)
    count = total[last] - total[:-1]
    share = 0.9 if complete else 0.5
    wanted = count >= share * (hold if complete else last - np.arange(flags.size))
    found = np.flatnonzero(flags & wanted)
    return int(found[0]) if found.size else None


def _level_without_pretrigger(force: Array, last: int, length: int, zero: float, noise: float, floor: float) -> Level:
    """Best level to be had: after contact, or the level the record stays at longest."""
    after = force[min(force.size, last + length) :][: 4 * length]
    level = level_before(after, floor)
    if level is not None and abs(level.value - zero) < 0.05 * (float(force.max()) - zero):
        return level
    return Level(zero, max(noise, floor), max(noise, floor), 0)
