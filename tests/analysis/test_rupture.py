"""Failure speed, stress and means of a series, against P1 and against drops with a known limit."""

import numpy as np
import pytest

from analysis.rupture import failure_speed, mean_of, plate_stress


def test_stress_is_P1s_with_either_logarithm():
    natural = plate_stress(1800, 4.6e-3, 30e-3, 0.30)
    published = plate_stress(1800, 4.6e-3, 30e-3, 0.30, as_published=True)
    assert natural == pytest.approx(198.9e6, abs=0.1e6)
    assert published == pytest.approx(142.0e6, abs=0.1e6)


def test_energy_at_P1s_failure_speed():
    E_a = 0.5 * 0.503 * 3.6**2
    assert E_a == pytest.approx(3.26, abs=5e-3)  # the paper prints 3.1 J, which is 3.51 m/s


@pytest.mark.parametrize("scatter", [0.03, 0.06, 0.1])
def test_the_interval_holds_the_limit(scatter: float):
    rng = np.random.default_rng(5)
    held = 0
    for _ in range(400):
        truth = rng.uniform(2.5, 4)
        v0 = truth * np.exp(rng.uniform(-0.3, 0.3, 12))
        failed = v0 > truth * np.exp(scatter * rng.standard_normal(12))
        found = failure_speed(v0.tolist(), failed.tolist())
        if found is None:
            held += 1
            continue
        assert found.lo is not None
        assert found.hi is not None
        assert found.lo < found.value < found.hi
        held += found.lo <= truth <= found.hi
    assert 0.91 < held / 400 < 0.996  # the prior takes more scatter than the sharpest of these have


def test_clean_groups_have_an_interval_between_and_about_them():
    found = failure_speed([2.0, 2.5, 3.0, 3.4, 3.8, 4.2], [False, False, False, True, True, True])
    assert found is not None
    assert 3.0 < found.value < 3.4
    assert found.lo is not None
    assert found.hi is not None
    assert 2.6 < found.lo < 3.1
    assert 3.3 < found.hi < 3.9


@pytest.mark.parametrize("failed", [[True] * 4, [False] * 4])
def test_no_limit_where_there_is_one_group(failed: list[bool]):
    assert failure_speed([1.0, 2.0, 3.0, 4.0], failed) is None


def test_a_mean_has_its_spread():
    assert mean_of([2.0, 4.0]) == (3.0, pytest.approx(2**0.5), pytest.approx(1.0))
    assert mean_of([2.0]) == (2.0, None, None)
