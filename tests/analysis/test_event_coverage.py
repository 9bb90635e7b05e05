"""The 95 % intervals cover: a seeded small draw of the study in bench/coverage_events.py."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from scipy.stats import binom

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "bench"))

import coverage_events

DROPS = 8  # a case, 160 drops in all


@pytest.fixture(scope="module")
def result() -> dict[str, dict[str, coverage_events.np.ndarray]]:
    return coverage_events.study(DROPS, seed=2024, show=False)


@pytest.mark.parametrize("symbol", coverage_events.SYMBOLS)
def test_intervals_cover_as_often_as_they_say(symbol: str, result: dict) -> None:
    hits = sum(int(coverage_events.covered(case[symbol]).sum()) for case in result.values())
    drops = DROPS * len(result)
    # Below this a true coverage of 93 % would fall once in a thousand draws.
    assert hits >= binom.ppf(1e-3, drops, 0.93)


def test_intervals_are_not_absurdly_wide(result: dict) -> None:
    for name, case in result.items():
        assert coverage_events.np.median(case["t_contact"][:, 1]) < 12e-6, name
