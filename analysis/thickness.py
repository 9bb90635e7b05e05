"""From which thickness on a thicker specimen gives the same F(t) (P2), by a stated test."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.study import Interval, Logs, same

MARGIN = 0.03
"""Two F(t) are the same where F_M and t_c are surely within it (two one-sided tests at 5 %)."""
_SPEEDS = 0.1
"""By which the drops may differ in v0; they are carried to one speed by Hertz: F_M ∝ v0^{6/5}, times ∝ v0^{−1/5}."""
POWERS = {"F_M": 1.2, "t_c": -0.2}


@dataclass(frozen=True)
class Compared:
    """A thickness against the thickest, m: ratios of F_M and t_c with their 90 % intervals."""

    thickness: float
    ratios: dict[str, Interval]
    same: bool


@dataclass(frozen=True)
class Threshold:
    """thickness : m, from which on F(t) stays the same; None: even the second thickest differs, or cannot be told."""

    thickness: float | None
    thickest: float
    rows: list[Compared]


def curves_same(
    one: Sequence[Mapping[str, float]], other: Sequence[Mapping[str, float]]
) -> tuple[dict[str, Interval], bool] | None:
    """Ratios of F_M and t_c of two groups of drops (v0, F_M, t_c each), and whether they are the same.

    None where there are fewer than two drops in either, or their speeds are more than a tenth apart.
    """
    speeds = [drop["v0"] for drop in (*one, *other)]
    if min(len(one), len(other)) < 2 or max(speeds) > (1 + _SPEEDS) * min(speeds):
        return None
    at = math.exp(float(np.mean(np.log(speeds))))
    ratios: dict[str, Interval] = {}
    every = True
    for symbol, power in POWERS.items():
        a, b = (Logs.of([d[symbol] * (at / d["v0"]) ** power for d in drops]) for drops in (one, other))
        if a is None or b is None:
            return None
        ratios[symbol], agrees = same(a, b, MARGIN)
        every &= agrees
    return ratios, every


def thickness_threshold(groups: Mapping[float, Sequence[Mapping[str, float]]]) -> Threshold | None:
    """The threshold from drops by thickness (m); None of fewer than three thicknesses that can be compared.

    "The same F(t)" is necessary for a half-space, not sufficient: E may still read high (`finite-thickness`).
    """
    thickest = max(groups, default=0.0)
    rows: list[Compared] = []
    for thickness in sorted(groups)[:-1]:
        found = curves_same(groups[thickness], groups[thickest])
        if found is not None:
            rows.append(Compared(thickness, *found))
    if len(rows) < 2:
        return None
    reached: float | None = None
    for row in reversed(rows):
        if not row.same:
            break
        reached = row.thickness
    return Threshold(reached, thickest, rows)
