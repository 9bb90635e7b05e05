"""Zero level and noise of a force channel."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from analysis.record import Array

_BLOCKS = 16
_ENOUGH = 8  # samples below which a level is not worth the name


@dataclass(frozen=True)
class Level:
    """Zero level at the moment of contact, N, its standard uncertainty, N, and the white noise, N, around it."""

    value: float
    u: float
    noise: float
    samples: int


def typical_level(force: Array, pretrigger: int | None = None) -> float:
    """Rough zero level, N: of the pre-trigger samples where their number is known, else where the record stays longest.

    A record that is nearly all contact stays longest near its peak; there the two ends agree on another level.
    """
    if pretrigger is not None and _ENOUGH <= pretrigger <= force.size:
        return float(np.median(force[: pretrigger : max(1, pretrigger // 8192)]))
    mode = _mode(force)
    first, last = float(np.median(force[:_ENOUGH])), float(np.median(force[-_ENOUGH:]))
    reach = float(force.max()) - float(force.min())
    if abs(first - last) < 0.15 * reach and abs(first - mode) > 0.3 * reach:
        return first
    return mode


def _mode(force: Array) -> float:
    """Half-sample mode of at most 8192 samples, N."""
    some = np.sort(force[:: max(1, force.size // 8192)])
    while some.size > 3:
        half = (some.size + 1) // 2
        widths = some[half - 1 :] - some[: some.size - half + 1]
        narrowest = int(np.argmin(widths))
        # A noise-free or coarsely quantised record has many equal widths: its level is the middle of them.
        wider = np.flatnonzero(widths[narrowest:] > widths[narrowest])
        last = narrowest + int(wider[0]) - 1 if wider.size else widths.size - 1
        middle = (narrowest + last) // 2
        some = some[middle : middle + half]
        if widths[narrowest] == 0:
            break
    return float(np.median(some))


def difference_noise(force: Array) -> float:
    """White noise from the differences of neighbours, N: blind to anything slow."""
    step = max(2, force.size // 20000)
    first = force[:-1:step]
    differences = force[1::step][: first.size] - first
    if differences.size == 0:
        return 0.0
    return float(1.4826 * np.median(np.abs(differences)) / np.sqrt(2))


def level_before(quiet: Array, floor: float) -> Level | None:
    """Level at the end of `quiet`, the samples just before contact.

    Blocks that lie off the line through the others (a foot before the contact, a spike) are left out. A trend is
    carried to the end where it stands out (4 standard errors); otherwise the mean is the level. `u` comes from block
    means, so that slow noise counts. `floor` : N, least noise (quantisation).
    """
    if quiet.size < _ENOUGH:
        return None
    edges = np.linspace(0, quiet.size, min(_BLOCKS, quiet.size // 2) + 1).astype(int)
    means = np.array([quiet[a:b].mean() for a, b in pairwise(edges)])
    middles = (edges[1:] + edges[:-1]) / 2
    i, j = np.triu_indices(means.size, 1)
    line = means - float(np.median((means[j] - means[i]) / (middles[j] - middles[i]))) * middles
    line -= np.median(line)
    white = difference_noise(quiet) / np.sqrt(quiet.size / means.size)
    limit = 5 * max(1.4826 * float(np.median(np.abs(line))), white, floor)
    sound = np.abs(line) <= limit
    kept = np.repeat(sound | (2 * np.count_nonzero(sound) < sound.size), np.diff(edges))
    n = int(np.count_nonzero(kept))
    position = np.flatnonzero(kept) / quiet.size - 1
    values = quiet[kept]
    mean = float(values.mean())
    centred = position - position.mean()
    slope = float(centred @ (values - mean) / (centred @ centred))
    rest = values - mean - slope * centred
    noise = max(float(np.sqrt(rest @ rest / max(n - 2, 1))), floor)
    blocks = [float(b.mean()) for b in np.array_split(rest, min(_BLOCKS, n))]
    u_mean = max(noise / np.sqrt(n), float(np.std(blocks, ddof=1)) / np.sqrt(len(blocks)))
    u_slope = u_mean * np.sqrt(n / float(centred @ centred))
    if abs(slope) > 4 * u_slope and abs(slope) > 1e-9 * (abs(mean) + noise):
        return Level(mean - slope * float(position.mean()), float(np.hypot(u_mean, u_slope / 2)), noise, n)
    return Level(mean, float(u_mean), noise, n)
