"""At what speed, load, stress and energy a material fails, from a series of drops of one specimen each (P1).

v0_fail is the speed at which half of the specimens fail. Where the slowest that failed was faster than the fastest that
survived, a likelihood alone puts no bound on how sharp the limit is; a prior on the scatter between specimens does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

_SCATTER, _TIMES = 0.06, 2.0
"""Of ln v0: what specimens of one material scatter by, give or take a factor (lognormal, one standard deviation)."""
_POINTS = 400
_LEVEL = 0.95


@dataclass(frozen=True)
class Limit:
    """A value with its 95 % interval; None at a side that the drops leave open."""

    value: float
    lo: float | None
    hi: float | None


def failure_speed(v0: Sequence[float], failed: Sequence[bool]) -> Limit | None:
    """The speed at which half of the specimens fail, m/s; None where all survived or all failed.

    ln v0_fail is flat before the drops, the scatter lognormal around 6 %; the interval holds 95 % of what is left.
    """
    speed, lost = np.asarray(v0, dtype=np.float64), np.asarray(failed, dtype=bool)
    if lost.all() or not lost.any():
        return None
    x = np.log(speed)
    centre = np.linspace(x.min() - 0.3, x.max() + 0.3, _POINTS)
    scatter = _SCATTER * _TIMES ** np.linspace(-3, 3, 61)
    z = (x[None, None, :] - centre[:, None, None]) / scatter[None, :, None]
    told = np.where(lost, log_ndtr(z), log_ndtr(-z)).sum(axis=2)
    told -= 0.5 * np.linspace(-3, 3, 61)[None, :] ** 2
    weight = np.exp(told - told.max()).sum(axis=1)
    total = np.cumsum(weight) / weight.sum()
    at = [float(np.exp(np.interp(p, total, centre))) for p in (0.5, 0.5 - _LEVEL / 2, 0.5 + _LEVEL / 2)]
    return Limit(at[0], at[1], at[2])


def plate_stress(F: float, thickness: float, support_radius: float, nu: float, *, as_published: bool = False) -> float:
    """σ in Pa on the face away from the dart, P1 (15): F/d²·[(1 + ν)(0.485·ln(R/d) + 0.52) + 0.48].

    The logarithm is natural (Timoshenko, Roark). P1's own table comes out with log₁₀ alone: `as_published`.
    """
    log = math.log10 if as_published else math.log
    return F / thickness**2 * ((1 + nu) * (0.485 * log(support_radius / thickness) + 0.52) + 0.48)


def mean_of(values: Sequence[float]) -> tuple[float, float | None, float | None]:
    """Mean, standard deviation of the values, and standard error of the mean; None of one value alone."""
    n = len(values)
    mean = math.fsum(values) / n
    if n < 2:
        return mean, None, None
    spread = math.sqrt(math.fsum((v - mean) ** 2 for v in values) / (n - 1))
    return mean, spread, spread / math.sqrt(n)
