"""Is a sudden loss of load a crack, a slip of the specimen, or neither?

By the model of the plate (P1 (8)–(13), with C_d left out) α = a·F^{2/3} + b·∫F dt + c·F all along: linear in what is
not known. A crack leaves the specimen softer for good: from then on F/(1 − l) stands for F. A slip leaves it as it was,
further away: α is a length more. Ringing, of the head or of a plate that shakes, does neither.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from analysis.conditions import Impact
from analysis.events import Events
from analysis.kinematics import Kinematics, integrate
from analysis.loss import Loss, find_loss
from analysis.record import Array

_POINTS = 400
_LOW = 0.08
"""Of F_M: forces below it say little about the stiffness."""
_BESIDE = 15e-6
"""s around the loss that are left out."""
_FOR_GOOD = 0.35
"""Mean logarithm by which what is left has to shrink: cracks and slips come to 0.6 at the least, intact to 0.24."""
_SHARES = np.arange(0.02, 0.6, 0.01)
_SLIPS = (1e-5, 4e-5, 1e-4)
"""s, in which a specimen comes to rest again."""
_TOGETHER = 8.0
"""Points that err together: ringing and the law's own lack are no white noise."""


@dataclass(frozen=True)
class Partial:
    """A loss of part of the load.

    loss : when and where, its share that of the stiffness; cracked : else it has slipped
    confidence : 0.5 to 1, that it is the one and not the other
    """

    loss: Loss
    cracked: bool
    confidence: float


@dataclass(frozen=True)
class Doubt:
    """A loss that nothing came of: the record rings or shakes so that a crack need not show."""

    loss: Loss


def partial_failure(events: Events, impact: Impact, v0: float, until: float | None = None) -> Partial | Doubt | None:
    """What became of part of the load up to ``until`` (s on the record's axis; None: the end of contact)."""
    end = until if until is not None else None if events.end is None else events.end.t
    if events.start is None or end is None:
        return None
    loss = find_loss(events.t, events.force, events.start.t, end, events.noise)
    if loss is None:
        return None
    motion = integrate(events.t, events.force, events.start.t, end, impact.mass, v0, impact.g)
    since = loss.t - events.start.t
    intact, slipped, cracked, share, n = _laws(motion, since)
    if n < 40 or math.log(intact / min(slipped, cracked)) < _FOR_GOOD:
        return Doubt(loss)
    odds = 0.5 * n / _TOGETHER * abs(math.log(slipped / cracked))
    confidence = 1 / (1 + math.exp(-min(odds, 50.0)))
    if slipped < cracked:
        return Partial(loss, False, confidence)
    return Partial(replace(loss, share=share, u_share=max(0.015, loss.u_share / 4)), True, confidence)


def _laws(motion: Kinematics, since: float) -> tuple[float, float, float, float, int]:
    """Sum of squares left when intact, slipped and cracked ``since`` s after contact, the crack's share, the points."""
    block = max(1, motion.t.size // _POINTS)
    t, force, alpha = (
        a[: a.size // block * block].reshape(-1, block).mean(axis=1) for a in (motion.t, motion.force, motion.alpha)
    )
    F = np.maximum(force, 0.0)
    impulse = np.cumsum(F) * float(t[1] - t[0])
    kept = (_LOW * float(F.max()) < F) & (np.abs(t - since) > _BESIDE)
    after = t > since
    tiny = 1e-30

    def left(*columns: Array) -> float:
        A = np.column_stack(columns)[kept]
        scale = np.maximum(np.linalg.norm(A, axis=0), tiny)
        x, *_ = np.linalg.lstsq(A / scale, alpha[kept], rcond=None)
        rest = alpha[kept] - A / scale @ x
        return float(rest @ rest) + tiny

    def softer(share: float) -> float:
        whole = F / np.where(after, 1 - share, 1.0)
        return left(whole ** (2 / 3), impulse, whole)

    slipped = min(
        left(F ** (2 / 3), impulse, F, np.where(after, -np.expm1(-(t - since).clip(0) / slow), 0.0)) for slow in _SLIPS
    )
    cracked, share = min((softer(float(each)), float(each)) for each in _SHARES)
    return left(F ** (2 / 3), impulse, F), slipped, cracked, share, int(np.count_nonzero(kept))
