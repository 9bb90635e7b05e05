"""What is wrong with a record is said, and no number looks right that is not."""

from __future__ import annotations

from dataclasses import replace

import drops
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis import Impact, Record, analyze, kinematics
from analysis.findings import Findings

DROP = drops.shapes()["flexed C_d=5"]
IMPACT = drops.impact(DROP)


def noisy(**more: float) -> Record:
    return drops.record(DROP, drops.Recorder(noise=0.003, **more), np.random.default_rng(2))[0]


def codes(found: Findings) -> set[str]:
    return {w.code for w in found.warnings}


def known(found: Findings) -> set[str]:
    return {s for s, f in found.values.items() if f.value is not None}


def test_a_good_record_has_no_cautions() -> None:
    assert codes(analyze(noisy(), IMPACT)) == set()


@pytest.mark.parametrize("force", [np.zeros(0), np.ones(1), np.zeros(5000), np.full(5000, 3.7),
                                   np.random.default_rng(0).normal(0, 5, 200_000)])  # fmt: skip
def test_no_contact_is_said_and_nothing_given(force: np.ndarray) -> None:
    found = analyze(Record(force, 1e-6), IMPACT)
    assert codes(found) == {"no-contact"}
    assert known(found) == set()
    assert kinematics(Record(force, 1e-6), IMPACT).t.size == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_samples_that_are_no_numbers_are_said_and_nothing_given(bad: float) -> None:
    record = noisy()
    record.force[700] = bad
    found = analyze(record, IMPACT)
    assert codes(found) == {"not-finite"}
    assert known(found) == set()


def test_reversed_polarity_is_named() -> None:
    record = noisy()
    found = analyze(replace(record, force=-record.force), IMPACT)
    assert codes(found) == {"reversed-polarity"}
    assert known(found) == set()


@pytest.mark.parametrize("rails_known", [True, False])
def test_a_saturated_peak_is_never_given_as_the_peak(rails_known: bool) -> None:
    record = noisy()
    limit = 0.8 * DROP.F_M
    clipped = replace(record, force=np.minimum(record.force, limit), rails=(-limit, limit) if rails_known else None)
    found = analyze(clipped, IMPACT)
    assert codes(found) == {"saturated"}
    assert found.values["F_M_raw"].value == pytest.approx(limit, rel=0.01)
    assert not known(found) & {"F_M", "J", "eps_exact", "v1", "E_diss", "alpha_M", "t_M"}
    assert "t_contact" in known(found)


@pytest.mark.parametrize("bits", [8, 12])
@pytest.mark.parametrize("noise", [0.0, 0.002])
def test_a_quantised_top_is_not_called_saturated(bits: int, noise: float) -> None:
    record, _ = drops.record(DROP, drops.Recorder(bits=bits, noise=noise), np.random.default_rng(4))
    assert "saturated" not in codes(analyze(record, IMPACT))
    assert "saturated" not in codes(analyze(replace(record, lsb=None), IMPACT))


def test_a_record_that_ends_in_contact_gives_no_contact_time_or_restitution() -> None:
    record = noisy()
    found = analyze(replace(record, force=record.force[:3500]), IMPACT)
    assert "contact-cut-off" in codes(found)
    assert not known(found) & {"t_c", "J", "eps_exact", "eps_published", "v1", "E_diss", "alpha_r"}
    assert {"t_contact", "F_M"} <= known(found)


def test_a_record_that_begins_in_contact_says_so() -> None:
    record = noisy()
    found = analyze(replace(record, force=record.force[2000:]), IMPACT)
    assert {"contact-cut-off", "no-pretrigger"} <= codes(found)
    assert not known(found) & {"t_contact", "t_c", "J", "eps_exact", "eps_published", "v1", "E_diss", "alpha_r"}


def test_missing_speed_is_said_and_what_needs_none_is_given() -> None:
    found = analyze(noisy(), drops.impact(DROP, v0=None))
    assert codes(found) == {"no-v0"}
    assert {"F_M", "J", "t_c"} <= known(found)
    assert not known(found) & {"eps_exact", "alpha_M", "v1", "E_diss"}


@pytest.mark.parametrize(("factor", "word"), [(1e-3, "kN"), (1e3, "too large"), (0.4, "mass")])
def test_impossible_restitution_is_said_with_a_reason(factor: float, word: str) -> None:
    record = noisy()
    found = analyze(replace(record, force=record.force * factor), IMPACT)
    said = [w.text for w in found.warnings if w.code == "restitution-impossible"]
    assert len(said) == 1
    assert word in said[0]


def test_a_moved_zero_level_is_said() -> None:
    record = noisy()
    record.force[3000:] += 0.03 * DROP.F_M
    assert "baseline-moved" in codes(analyze(record, IMPACT))


def test_energy_that_does_not_close_is_said() -> None:
    flight = 2 * DROP.eps * DROP.v0 / drops.G
    dt, t0 = 2e-6, 2.0003e-3
    t = np.arange(int((flight + 0.012) / dt)) * dt
    force = DROP.force(t - t0) + 0.7 * DROP.force(t - t0 - DROP.t_c - flight)
    force += np.random.default_rng(0).normal(0, 0.003 * DROP.F_M, t.size)
    assert codes(analyze(Record(force, dt), IMPACT)) == {"second-hit"}
    assert "energy-does-not-close" in codes(analyze(Record(1.03 * force, dt), IMPACT))


@pytest.mark.parametrize(
    ("record", "impact", "word"),
    [
        (Record(np.zeros(9), 0.0), IMPACT, "dt"),
        (Record(np.zeros(9), np.nan), IMPACT, "dt"),
        (Record(np.zeros((3, 3)), 1e-6), IMPACT, "dimension"),
        (Record(np.zeros(9), 1e-6), replace(IMPACT, mass=0.0), "mass"),
        (Record(np.zeros(9), 1e-6), replace(IMPACT, tip_mass=1.0), "tip_mass"),
    ],
)
def test_broken_arguments_are_refused_by_name(record: Record, impact: Impact, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        analyze(record, impact)


def garbage(kind: str, n: int, seed: int, scale: float) -> np.ndarray:
    rng = np.random.default_rng(seed)
    if kind == "noise":
        return rng.normal(0, scale, n)
    if kind == "steps":
        return np.repeat(rng.normal(0, scale, n // 7 + 1), 7)[:n]
    if kind == "walk":
        return np.cumsum(rng.normal(0, scale, n))
    if kind == "spikes":
        return np.where(rng.uniform(size=n) < 0.01, scale, 0.0)
    if kind == "sine":
        return scale * np.sin(np.arange(n) / (1 + seed % 50))
    return rng.choice([np.nan, np.inf, 0.0, scale, 1e308], n)


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(["noise", "steps", "walk", "spikes", "sine", "wild"]),
    st.integers(0, 3000),
    st.integers(0, 10_000),
    st.sampled_from([1e-9, 1.0, 1e4, 1e200]),
    st.sampled_from([1e-9, 1e-6, 1.0]),
)
def test_garbage_never_raises_and_is_never_clean(kind: str, n: int, seed: int, scale: float, dt: float) -> None:
    found = analyze(Record(garbage(kind, n, seed, scale), dt), IMPACT)
    assert found.to_json()
    assert found.warnings, "garbage is never passed without a word"


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(width=64), max_size=40))
def test_any_short_list_of_numbers_is_survived(samples: list[float]) -> None:
    assert analyze(Record(np.array(samples, dtype=np.float64), 1e-5), IMPACT).to_json()


def test_a_record_that_is_nearly_all_contact_is_still_read() -> None:
    for before, after in ((3e-5, 3e-4), (2e-4, 5e-5)):
        record, t0 = drops.record(
            DROP, drops.Recorder(noise=0.005, before=before, after=after), np.random.default_rng(8)
        )
        found = analyze(record, IMPACT)
        assert found.values["t_contact"].value == pytest.approx(t0, abs=2e-5)
        assert found.values["eps_exact"].value == pytest.approx(DROP.eps, abs=0.02)


def test_a_pretrigger_count_finds_the_zero_level_of_a_record_cut_off_early() -> None:
    record = noisy(before=2e-4)
    cut = replace(record, force=record.force[:2400], pretrigger=190)
    found = analyze(cut, IMPACT)
    assert codes(found) == {"contact-cut-off"}
    assert found.values["t_contact"].value == pytest.approx(2e-4, abs=2e-5)


@pytest.mark.parametrize("noise", [0.0, 5.0, 20.0])
def test_peak_before_a_sudden_drop_is_not_smoothed_away(noise: float) -> None:
    t = np.arange(6000) * 1e-6 - 1.2e-3
    force = np.where((t > 0) & (t < 1.5e-3), 1800 * np.clip(t / 1.5e-3, 0, 1) ** 1.2, 0.0)
    force += np.where(t >= 1.5e-3, 150 * np.exp(-(t - 1.5e-3) / 2e-4), 0.0)
    force += np.random.default_rng(1).normal(0, noise, t.size) if noise else 0.0
    peak = analyze(Record(force, 1e-6), IMPACT).values["F_M"]
    assert peak.value == pytest.approx(1800, abs=2 * noise + 1)
    assert peak.u is not None
    assert peak.u < 25
