"""The up-and-down method against sums done by hand and against specimens of a known limit."""

import numpy as np
import pytest

from analysis.staircase import staircase


def test_dixon_and_mood_by_hand():
    # 10 up to 12, failures at 12, 11, 12, 11, 10: i = 2, 1, 2, 1, 0 above 10
    levels = [10, 11, 12, 11, 10, 11, 12, 11, 10, 9, 10]
    failed = [False, False, True, True, False, False, True, True, True, False, False]
    found = staircase([float(v) for v in levels], failed)
    assert found is not None
    n, a, b = 5, 6, 10
    assert found.mean == pytest.approx(10 + a / n - 0.5)
    assert found.deviation == pytest.approx(1.62 * ((n * b - a * a) / n**2 + 0.029))
    assert found.following == 11
    assert found.step == 1


def test_no_ladder_is_none():
    assert staircase([1.0, 2.0, 3.5], [False, False, True]) is None
    assert staircase([1.0, 2.0, 3.0], [False, True, True]) is None, "after a failure one goes down"
    assert staircase([1.0, 2.0], [False, True]) is None


def test_the_next_level_is_told_from_the_start():
    found = staircase([1.0, 2.0, 3.0], [False, False, False])
    assert found is not None
    assert found.mean is None
    assert found.following == 4.0


def test_the_mean_is_that_of_the_specimens():
    rng = np.random.default_rng(3)
    means, deviations = [], []
    for _ in range(300):
        level, levels, failed = 9.0 + rng.uniform(), list[float](), list[bool]()
        for _ in range(30):
            levels.append(level)
            failed.append(bool(level > 10 + 1.0 * rng.standard_normal()))
            level += -1.0 if failed[-1] else 1.0
        found = staircase(levels, failed)
        assert found is not None
        assert found.mean is not None
        means.append(found.mean)
        deviations.append(found.deviation or 0.0)
    assert np.mean(means) == pytest.approx(10, abs=0.06)
    assert np.std(means) == pytest.approx(np.median(deviations) / np.sqrt(14), rel=0.4)
