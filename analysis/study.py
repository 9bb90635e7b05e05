"""What drops say when they are held side by side: ratios, sameness, dependence, outliers, a transition."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from analysis.record import Array

_LEVEL = 0.975
_EQUIVALENT = 0.95
"""One-sided, so that two of them are a 90 % interval: the usual test of equivalence (Schuirmann 1987)."""
_FAR = 3.5
"""Of the modified z-score: Iglewicz and Hoaglin (1993)."""
_FEWEST = 6
_NEAR = 0.02
_FALLS = 0.8
"""Of the longer loads: what the shorter ones have to stay below for a transition."""


@dataclass(frozen=True)
class Interval:
    """A value, its 95 % interval, and the degrees of freedom behind it."""

    value: float
    lo: float
    hi: float
    freedom: float


@dataclass(frozen=True)
class Logs:
    """A positive quantity in logarithms: mean, standard error of it, degrees of freedom of that."""

    mean: float
    u: float
    freedom: float

    @classmethod
    def of(cls, values: Sequence[float]) -> Logs | None:
        """Of values that scatter; None of fewer than two, or of one that is not above 0."""
        if len(values) < 2 or min(values) <= 0:
            return None
        ln = np.log(values)
        return cls(float(ln.mean()), float(ln.std(ddof=1)) / math.sqrt(len(values)), len(values) - 1)

    @classmethod
    def between(cls, value: float, lo: float, hi: float) -> Logs:
        """Of a value with its 95 % interval."""
        return cls(math.log(value), math.log(hi / lo) / (2 * 1.96), math.inf)


def ratio(a: Logs, b: Logs, level: float = _LEVEL) -> Interval:
    """a over b with its interval: difference of means of logarithms, Welch's degrees of freedom."""
    u = math.hypot(a.u, b.u)
    parts = [s.u**4 / s.freedom for s in (a, b) if math.isfinite(s.freedom)]
    freedom = u**4 / sum(parts) if sum(parts) > 0 else math.inf
    reach = float(student.ppf(level, freedom) if math.isfinite(freedom) else 1.959964) * u
    middle = a.mean - b.mean
    return Interval(math.exp(middle), math.exp(middle - reach), math.exp(middle + reach), freedom)


def same(a: Logs, b: Logs, margin: float) -> tuple[Interval, bool]:
    """a over b with its 90 % interval, and whether that lies within 1 ± ``margin``: two one-sided tests at 5 %."""
    found = ratio(a, b, _EQUIVALENT)
    return found, found.lo > 1 / (1 + margin) and found.hi < 1 + margin


def mean(values: Sequence[float]) -> Interval | None:
    """Mean with its 95 % interval; None of fewer than two."""
    n = len(values)
    if n < 2:
        return None
    middle = math.fsum(values) / n
    reach = float(student.ppf(_LEVEL, n - 1)) * float(np.std(values, ddof=1)) / math.sqrt(n)
    return Interval(middle, middle - reach, middle + reach, n - 1)


def ratio_at(a: Sequence[float], at_a: Sequence[float], b: Sequence[float], at_b: Sequence[float]) -> Interval | None:
    """a over b at the same x, with its 95 % interval: ln y = group + n·ln x by least squares, one n for both.

    a, at_a : (n,), b, at_b : (k,), all above 0. None where the two ranges of x do not meet, or of fewer than two each.
    Where x does not vary by 2 % it is left out.
    """
    if min(len(a), len(b)) < 2 or min(*a, *b, *at_a, *at_b) <= 0:
        return None
    if min(max(at_a), max(at_b)) < (1 - _NEAR) * max(min(at_a), min(at_b)):
        return None
    x, y = (np.log(np.concatenate(parts)) for parts in ((at_a, at_b), (a, b)))
    of_a = np.arange(y.size) < len(a)
    columns = [np.ones(y.size), of_a.astype(np.float64)]
    if np.ptp(x) > math.log(1 + _NEAR):
        columns.append(x - x.mean())
    A = np.column_stack(columns)
    freedom = y.size - A.shape[1]
    if freedom < 1:
        return None
    p, *_ = np.linalg.lstsq(A, y, rcond=None)
    rest = y - A @ p
    u = math.sqrt(float(np.linalg.pinv(A.T @ A)[1, 1]) * float(rest @ rest) / freedom)
    reach = float(student.ppf(_LEVEL, freedom)) * u
    return Interval(math.exp(p[1]), math.exp(p[1] - reach), math.exp(p[1] + reach), freedom)


def exponents(y: Sequence[float], over: Mapping[str, Sequence[float]], group: Sequence[int]) -> dict[str, Interval]:
    """Exponents of y ∝ Π x^n over all that varies, each group with a factor of its own; 95 % intervals.

    y, group and each of ``over`` : (n,). What does not vary by 5 %, or only together with another, is left out; nothing
    is told of fewer than two drops beyond the unknowns.
    """
    found: dict[str, Array] = {}
    columns = [np.asarray(group) == g for g in sorted(set(group))]
    base = np.column_stack(columns).astype(np.float64)
    for name, values in over.items():
        x = np.log(np.asarray(values, dtype=np.float64))
        known = np.column_stack((base, *found.values()))
        rest = x - known @ np.linalg.lstsq(known, x, rcond=None)[0]
        if np.ptp(x) > math.log(1.05) and float(np.sqrt(np.mean(rest**2))) > 0.01:
            found[name] = x
    A = np.column_stack((base, *found.values()))
    freedom = A.shape[0] - A.shape[1]
    if not found or freedom < 2:
        return {}
    ln = np.log(np.asarray(y, dtype=np.float64))
    a, *_ = np.linalg.lstsq(A, ln, rcond=None)
    rest = ln - A @ a
    covariance = np.linalg.inv(A.T @ A) * float(rest @ rest) / freedom
    reach = float(student.ppf(_LEVEL, freedom))
    told: dict[str, Interval] = {}
    for k, name in enumerate(found, start=base.shape[1]):
        u = math.sqrt(float(covariance[k, k]))
        told[name] = Interval(float(a[k]), float(a[k]) - reach * u, float(a[k]) + reach * u, freedom)
    return told


def outliers(x: Sequence[float], y: Sequence[float]) -> list[int]:
    """Places in ``y`` (n,) that lie off the others, whose trend over ``x`` (n,) is taken out (Theil–Sen).

    Modified z-score above 3.5, 0.6745·(residual − median)/MAD; nothing is told of fewer than six.
    """
    if len(y) < _FEWEST:
        return []
    u, v = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    i, j = np.triu_indices(u.size, 1)
    apart = np.abs(u[j] - u[i]) > 0.02 * np.abs(u).max()
    slope = float(np.median((v[j] - v[i])[apart] / (u[j] - u[i])[apart])) if np.count_nonzero(apart) >= 3 else 0.0
    rest = v - slope * u
    rest = rest - np.median(rest)
    # Values closer together than 0.1 % are no measure of what scatters.
    spread = max(float(np.median(np.abs(rest))), 1e-3 * float(np.median(np.abs(v))))
    return [int(k) for k in np.flatnonzero(0.6745 * np.abs(rest) > _FAR * spread)]


@dataclass(frozen=True)
class Transition:
    """Between the speeds ``lo`` and ``hi`` (m/s) the load lasts ``ratio`` of what it lasted before."""

    lo: float
    hi: float
    before: float
    after: float

    @property
    def ratio(self) -> float:
        """Duration after over before."""
        return self.after / self.before


def transition(v0: Sequence[float], lasts: Sequence[float]) -> Transition | None:
    """Where the duration of load (s) falls as drops get faster: the split of the drops, ordered by v0, in two levels.

    P1 reads v0_fail off t_c against v0 so. None of fewer than four, or where the slower do not last longer by a fifth.
    """
    order = np.argsort(v0)
    x, y = np.asarray(v0, dtype=np.float64)[order], np.log(np.asarray(lasts, dtype=np.float64))[order]
    if x.size < 4:
        return None
    splits = range(1, x.size)
    left = [float(np.square(y[:k] - y[:k].mean()).sum() + np.square(y[k:] - y[k:].mean()).sum()) for k in splits]
    k = splits[int(np.argmin(left))]
    before, after = math.exp(float(y[:k].mean())), math.exp(float(y[k:].mean()))
    return Transition(float(x[k - 1]), float(x[k]), before, after) if after < _FALLS * before else None
