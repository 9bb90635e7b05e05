"""The up-and-down method (ISO 6603-1, ASTM D5420): one step up after a survivor, one down after a failure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

_EVEN = 0.02
"""Of a step: how far a level may be from its place in the ladder."""
_ROUGH = 0.3
"""Dixon and Mood's variance formula holds above it; below, the deviation is only said to be small."""


@dataclass(frozen=True)
class Staircase:
    """mean : level at which half fail; deviation : standard deviation between specimens, None where the ladder is too
    coarse to tell; u : standard error of the mean; following : level of the next drop; step : of the ladder; all in the
    unit of the levels
    """

    mean: float | None
    deviation: float | None
    u: float | None
    following: float
    step: float
    drops: int


def staircase(levels: Sequence[float], failed: Sequence[bool]) -> Staircase | None:
    """What drops in their order say; None if they are no ladder.

    Dixon and Mood (1948): of the rarer outcome, N = Σn_i, A = Σi·n_i, B = Σi²·n_i over the steps i above the lowest
    level h₀ where it occurs; mean = h₀ + d·(A/N ∓ ½), − for failures; s = 1.62·d·((N·B − A²)/N² + 0.029).
    """
    if len(levels) < 3:
        return None
    moves = [b - a for a, b in pairwise(levels)]
    step = sum(abs(m) for m in moves) / len(moves)
    if not step > 0:
        return None
    for move, lost in zip(moves, failed[:-1], strict=True):
        if abs(move - (-step if lost else step)) > _EVEN * step:
            return None
    following = levels[-1] + (-step if failed[-1] else step)
    losses = sum(bool(f) for f in failed)
    if losses in (0, len(failed)):
        return Staircase(None, None, None, following, step, len(levels))
    rarer = losses <= len(failed) - losses
    chosen = [level for level, lost in zip(levels, failed, strict=True) if bool(lost) is rarer]
    lowest = min(chosen)
    places = [round((level - lowest) / step) for level in chosen]
    n, a, b = len(places), sum(places), sum(i * i for i in places)
    mean = lowest + step * (a / n + (-0.5 if rarer else 0.5))
    variance = (n * b - a * a) / n**2
    if variance <= _ROUGH:
        return Staircase(mean, None, None, following, step, len(levels))
    deviation = 1.62 * step * (variance + 0.029)
    return Staircase(mean, deviation, deviation / math.sqrt(n), following, step, len(levels))
