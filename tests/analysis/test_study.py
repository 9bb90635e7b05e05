"""What drops say side by side, against scipy, simulation and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import stats

from analysis.study import Logs, exponents, mean, outliers, ratio, ratio_at, same, transition
from analysis.thickness import thickness_threshold


def test_a_ratio_is_welchs():
    rng = np.random.default_rng(3)
    a, b = np.exp(0.4 + 0.1 * rng.standard_normal(7)), np.exp(0.05 * rng.standard_normal(9))
    one, other = Logs.of(a.tolist()), Logs.of(b.tolist())
    assert one is not None
    assert other is not None
    found = ratio(one, other)
    theirs = stats.ttest_ind(np.log(a), np.log(b), equal_var=False).confidence_interval(0.95)
    assert (found.lo, found.hi) == pytest.approx((math.exp(theirs.low), math.exp(theirs.high)), rel=1e-9)


def test_fifty_four_percent_larger_has_an_interval_that_holds():
    rng = np.random.default_rng(4)
    held = 0
    for _ in range(1000):
        logs = [Logs.of(np.exp(m + 0.08 * rng.standard_normal(6)).tolist()) for m in (math.log(1.54), 0.0)]
        found = ratio(*(one for one in logs if one is not None))
        held += found.lo < 1.54 < found.hi
    assert 930 <= held <= 970


def test_a_ratio_at_the_same_speed_is_not_that_of_the_means():
    v_a, v_b = np.linspace(1, 2, 6), np.linspace(1.5, 3, 6)
    rng = np.random.default_rng(5)
    a, b = (k * v**1.2 * np.exp(0.01 * rng.standard_normal(6)) for k, v in ((1.1, v_a), (1.0, v_b)))
    found = ratio_at(a.tolist(), v_a.tolist(), b.tolist(), v_b.tolist())
    assert found is not None
    assert found.lo < 1.1 < found.hi
    assert found.value == pytest.approx(1.1, rel=0.03)
    assert ratio_at([1, 2], [1, 1.1], [1, 2], [2, 2.2]) is None, "speeds that do not meet"


def test_same_means_surely_within_the_margin():
    close, loose = Logs(0.005, 0.004, 8), Logs(0.005, 0.03, 8)
    reference = Logs(0.0, 0.004, 8)
    assert same(close, reference, 0.03)[1]
    assert not same(loose, reference, 0.03)[1], "not told apart is not the same"
    assert not same(Logs(0.06, 0.004, 8), reference, 0.03)[1]


def test_exponents_of_what_varies_alone():
    rng = np.random.default_rng(16)
    n = 40
    v0, mass, tip = rng.uniform(1, 3, n), rng.choice([0.743, 1.043, 1.343], n), np.full(n, 6.35e-3)
    material = rng.integers(0, 2, n)
    E = 2e9 * np.where(material, 1.5, 1.0) * v0**0.08 * np.exp(0.005 * rng.standard_normal(n))
    found = exponents(E.tolist(), {"v0": v0.tolist(), "mass": mass.tolist(), "tip": tip.tolist()}, material.tolist())
    assert set(found) == {"v0", "mass"}
    assert found["v0"].lo < 0.08 < found["v0"].hi
    assert found["v0"].lo > 0.05
    assert found["mass"].lo < 0 < found["mass"].hi


def test_outliers_are_told_and_a_trend_is_none():
    rng = np.random.default_rng(7)
    v0 = np.linspace(1, 3, 12)
    y = 500 * v0 + 4 * rng.standard_normal(12)
    assert outliers(v0.tolist(), y.tolist()) == []
    y[4] *= 0.9
    assert outliers(v0.tolist(), y.tolist()) == [4]
    assert outliers([1.0, 1.0], [1.0, 9.0]) == [], "two cannot tell which"


def test_the_transition_is_where_the_load_gets_short():
    v0 = [2.0, 2.5, 3.0, 3.4, 3.6, 3.9, 4.2]
    found = transition(v0, [2.9e-3, 2.88e-3, 2.85e-3, 2.86e-3, 1.2e-3, 1.0e-3, 0.9e-3])
    assert found is not None
    assert (found.lo, found.hi) == (3.4, 3.6)
    assert transition(v0, [2.9e-3 * v**-0.2 for v in v0]) is None


def test_the_threshold_needs_every_thicker_one_to_be_the_same():
    rng = np.random.default_rng(8)

    def drops(k: float) -> list[dict[str, float]]:
        v = 1.5 * (1 + 0.005 * rng.standard_normal(6))
        return [{"v0": u, "F_M": 3000 * k * u**1.2 * (1 + 0.003 * rng.standard_normal()),
                 "t_c": 1.1e-3 / k * u**-0.2 * (1 + 0.003 * rng.standard_normal())} for u in v]  # fmt: skip

    found = thickness_threshold({1.5: drops(1.4), 3: drops(1.18), 5: drops(1.07), 8: drops(1.01), 10: drops(1.0)})
    assert found is not None
    assert (found.thickness, found.thickest) == (8, 10)
    assert [row.same for row in found.rows] == [False, False, False, True]
    assert thickness_threshold({3: drops(1.2), 5: drops(1.0)}) is None


def test_a_mean_has_students_interval():
    found = mean([1.0, 1.2, 0.9, 1.1])
    assert found is not None
    low, high = stats.t.interval(0.95, 3, 1.05, stats.sem([1.0, 1.2, 0.9, 1.1]))
    assert (found.lo, found.hi) == pytest.approx((low, high))
    assert mean([1.0]) is None
