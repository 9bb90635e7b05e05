"""Release of the dart, from the acceleration channel."""

from __future__ import annotations

import numpy as np

from analysis.record import Record

_BLOCK = 5e-4  # s, over which the channel is averaged
_STEP = (0.5, 1.3)  # of g: what letting go changes, guide friction and scale errors allowed for


def fall_time(record: Record, t_contact: float, g: float) -> tuple[float, float] | None:
    """Time from release to contact and its standard uncertainty, s, or None.

    Release is the one step of about g in the block means before contact, placed where it splits them best.
    """
    channel = record.acceleration
    if channel is None or channel.ndim != 1:
        return None
    block = max(1, int(_BLOCK / record.dt))
    # A foot of the contact, or the precursor of a guide, must not draw the step to the end.
    count = min(int((t_contact - 4 * _BLOCK) / record.dt), channel.size) // block
    if count < 12:
        return None
    means = channel[: count * block].reshape(count, block).mean(axis=1)
    if not np.isfinite(means).all():
        return None
    n = np.arange(1, count)
    total = np.cumsum(means)[:-1]
    rest, falling = total / n, (means.sum() - total) / (count - n)
    split = int(np.argmax((falling - rest) ** 2 * n * (count - n))) + 1
    if split < 4 or count - split < 4:
        return None
    step = float(falling[split - 1] - rest[split - 1])
    scatter = max(float(means[:split].std()), float(means[split:].std()))
    if not _STEP[0] * g < abs(step) < _STEP[1] * g or scatter > 0.25 * abs(step):
        return None
    return t_contact - split * block * record.dt, block * record.dt / np.sqrt(3)
