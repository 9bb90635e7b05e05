"""One fit of many drops: E, or its law over v0, and the dampers that the drops share; all else stays each drop's own.

Every drop keeps its start of contact, zero level, v0 and ringing. They are eliminated drop by drop (Schur complement),
so that the work grows with the number of drops. What the drops lack of agreeing widens the intervals (Birge 1932).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2 as chi_square

from analysis.fit import Fit, NotFitted
from analysis.fit_intervals import DETERMINED, LEVEL_95, LOWER, UPPER, Parameter
from analysis.fit_problem import DAMPER, FLOW, LN_E, V0
from analysis.record import Array

_MOST, _DONE = 30, 1e-4
_LONGEST, _FAR = 0.2, 3.0
"""Of ln E: a step at the most, and how far from where it began it makes no sense."""
_UNLIKE = 0.05
"""Probability below which the drops are said to disagree."""
SLOPE = -1
"""Where the exponent of E over v0 stands among the shared parameters, behind those of x."""


@dataclass(frozen=True)
class Joint:
    """parameters : E at ``v_ref`` (m/s), the exponent n of E = E_ref·(v0/v_ref)^n where it was asked for, and dampers
    chi2, freedom : what sharing adds to the sum of squares, and over how many degrees of freedom; widened : by it
    drops : how many; agree : whether the drops could share these values
    """

    parameters: dict[str, Parameter]
    v_ref: float
    chi2: float
    freedom: int
    widened: float
    drops: int
    agree: bool


@np.errstate(over="ignore", invalid="ignore")  # what runs away is told by `NotFitted`
def fit_jointly(fits: Sequence[Fit], law: bool) -> Joint:
    """Fit drops that were fitted singly: one C_i and C_d (or C), and one E, or with ``law`` a power of v0.

    Raises
    ------
    NotFitted : fewer than two drops (three with a law), or of different models.
    """
    least = 3 if law else 2
    if len(fits) < least:
        raise NotFitted(f"no joint fit: it takes {least} fitted drops, there are {len(fits)}")
    kinds = {fit.problem.kind for fit in fits}
    if len(kinds) > 1:
        raise NotFitted(f"no joint fit: the drops have different models ({', '.join(sorted(kinds))})")
    free = fits[0].problem.free
    shared = [LN_E] + [k for k in (FLOW, DAMPER) if free[k]] + ([SLOPE] if law else [])
    speeds = np.array([float(fit.best.x[V0]) for fit in fits])
    v_ref = float(np.exp(np.log(speeds).mean()))
    if law and float(np.ptp(speeds)) < 0.05 * v_ref:
        raise NotFitted("no joint fit: E over v0 takes drops at different speeds; these are within 5 % of each other")
    away = np.log(speeds / v_ref)
    x, common = [fit.best.x.copy() for fit in fits], _begin(fits, shared, away)
    best, normal, begun = math.inf, np.eye(len(shared)), float(common[0])
    for _ in range(_MOST):
        _share(x, common, shared, away)
        parts = [fit.problem.residuals(own) for fit, own in zip(fits, x, strict=True)]
        best = sum(float(r @ r) for r, _ in parts)
        normal, step = _stepped(fits, x, parts, common, shared, away)
        common = common + step
        for k, at in enumerate(shared):
            if at in (FLOW, DAMPER):
                common[k] = max(common[k], 0.0)
        if float(step @ normal @ step) < _DONE:
            break
        if not (math.isfinite(best) and np.isfinite(common).all() and abs(common[0] - begun) < _FAR):
            raise NotFitted("no joint fit: the drops have no E in common; `groups` has E of each")
    else:
        raise NotFitted("no joint fit: the drops disagree so far that no common values are found; see `groups`")
    separate = sum(fit.best.chi2 for fit in fits)
    freedom = len(fits) * sum(at != SLOPE for at in shared) - len(shared)
    lost = max(best - separate, 0.0)
    widened = max(1.0, math.sqrt(lost / freedom)) if freedom else 1.0
    agree = freedom == 0 or float(chi_square.sf(lost, freedom)) > _UNLIKE
    found = _parameters(fits[0], common, np.asarray(np.linalg.inv(normal) * widened**2, dtype=np.float64), shared)
    return Joint(found, v_ref, lost, freedom, widened, len(fits), agree)


def _begin(fits: Sequence[Fit], shared: list[int], away: Array) -> Array:
    """Weighted means of the single fits; of E a weighted line over ln v0 where a law is asked for."""
    common: list[float] = []
    for at in shared:
        if at == SLOPE:
            common.append(float(np.polyfit(away, [fit.best.x[LN_E] for fit in fits], 1)[0]))
            continue
        weight = np.array([1e-12 + fit.best.N[at, at] for fit in fits])
        values = np.array([fit.best.x[at] for fit in fits])
        common.append(float((weight @ values) / weight.sum()))
    return np.array(common)


def _share(x: list[Array], common: Array, shared: list[int], away: Array) -> None:
    """Put the shared values into every drop's own."""
    for own, distance in zip(x, away, strict=True):
        for k, at in enumerate(shared):
            if at != SLOPE:
                own[at] = common[k]
        if SLOPE in shared:
            own[LN_E] += common[shared.index(SLOPE)] * distance


def _stepped(
    fits: Sequence[Fit],
    x: list[Array],
    parts: list[tuple[Array, Array]],
    common: Array,
    shared: list[int],
    away: Array,
) -> tuple[Array, Array]:
    """Normal matrix of the shared values, all others eliminated, and their step; x of each drop follows."""
    own_of = [np.flatnonzero(fit.problem.free & ~np.isin(np.arange(fit.problem.free.size), shared)) for fit in fits]
    normal, pull = np.zeros((len(shared), len(shared))), np.zeros(len(shared))
    kept: list[tuple[Array, Array, Array]] = []
    for (r, J), own, distance in zip(parts, own_of, away, strict=True):
        S = np.stack([J[LN_E] * distance if at == SLOPE else J[at] for at in shared])
        apart = J[own]
        scale = 1 / np.sqrt(np.maximum((apart * apart).sum(axis=1), 1e-300))
        scaled = apart * scale[:, None]
        inverse = np.linalg.inv(scaled @ scaled.T + 1e-12 * np.eye(len(own))) * scale * scale[:, None]
        across, g = apart @ S.T, apart @ r
        kept.append((inverse, across, g))
        normal += S @ S.T - across.T @ inverse @ across
        pull += S @ r - across.T @ inverse @ g
    on = np.array([not (at in (FLOW, DAMPER) and common[k] <= 0 and pull[k] > 0) for k, at in enumerate(shared)])
    step = np.zeros(len(shared))
    step[on] = -np.linalg.solve(normal[np.ix_(on, on)], pull[on])
    step *= min(1.0, _LONGEST / max(float(np.abs(step[0])), 1e-12))
    for fit, mine, own, (inverse, across, g) in zip(fits, x, own_of, kept, strict=True):
        low, high = fit.problem.bounds()
        mine[own] = np.clip(mine[own] - inverse @ (g + across @ step), low[own], high[own])
    return normal, step


def _parameters(fit: Fit, common: Array, C: Array, shared: list[int]) -> dict[str, Parameter]:
    kind = fit.problem.kind
    names = {
        LN_E: "E", SLOPE: "n", FLOW: "C" if kind == "series" else "C_i", DAMPER: "C" if kind == "parallel" else "C_d"
    }  # fmt: skip
    found: dict[str, Parameter] = {}
    for k, at in enumerate(shared):
        value, u = float(common[k]), math.sqrt(float(C[k, k]))
        lo, hi = value - LEVEL_95 * u, value + LEVEL_95 * u
        if at == LN_E:
            E = math.exp(value)
            found["E"] = Parameter(E, "Pa", E * u, math.exp(lo), math.exp(hi))
        elif at == SLOPE:
            found["n"] = Parameter(value, "1", u, lo, hi)
        elif at == FLOW:
            found[names[at]] = Parameter(
                1 / value if value > 0 else None, "kg/s", u / value**2 if value > 0 else None, 1 / hi,
                1 / lo if lo > 0 else None, DETERMINED if lo > 0 else LOWER,
            )  # fmt: skip
        else:
            verdict = DETERMINED if lo > 0 else UPPER
            found[names[at]] = Parameter(value, "kg/s", u, lo if lo > 0 else None, hi, verdict)
    return found
