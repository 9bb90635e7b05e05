"""First contact, end of contact, peak and second contact."""

from __future__ import annotations

import time

import drops
import numpy as np
import pytest

from analysis import Record, analyze
from analysis.findings import Findings

SHAPES = drops.shapes()


def number(found: Findings, symbol: str) -> float:
    value = found.values[symbol].value
    assert value is not None, (symbol, found.warnings)
    return float(value)


def uncertainty(found: Findings, symbol: str) -> float:
    u = found.values[symbol].u
    assert u is not None
    return u


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("dt", [1e-6, 2e-6])
def test_ends_of_contact_are_known_to_a_tenth_of_a_sample_without_noise(name: str, dt: float) -> None:
    drop, rng = SHAPES[name], np.random.default_rng(7)
    for _ in range(5):
        record, t0 = drops.record(drop, drops.Recorder(dt=dt), rng)
        found = analyze(record, drops.impact(drop))
        assert abs(number(found, "t_contact") - t0) < 0.1 * dt
        assert abs(number(found, "t_c") - drop.t_c) < 0.1 * dt
        assert abs(number(found, "F_M") - drop.F_M) < 1e-4 * drop.F_M
        assert found.warnings == []


def test_noise_free_half_sine_peaks_at_its_amplitude() -> None:
    drop = drops.half_sine(1050.0)
    record, _ = drops.record(drop, drops.Recorder(), np.random.default_rng(0))
    assert number(analyze(record, drops.impact(drop)), "F_M") == pytest.approx(1050, abs=0.05)


@pytest.mark.parametrize("noise", [0.005, 0.02])
def test_peak_is_free_of_white_noise_bias(noise: float) -> None:
    drop, rng = drops.half_sine(), np.random.default_rng(11)
    peaks, raws = [], []
    for _ in range(20):
        record, _ = drops.record(drop, drops.Recorder(noise=noise), rng)
        found = analyze(record, drops.impact(drop))
        peaks.append(number(found, "F_M") - drop.F_M)
        raws.append(number(found, "F_M_raw") - drop.F_M)
    sigma = noise * drop.F_M
    assert abs(np.mean(peaks)) < 0.1 * sigma, "the estimate's bias stays below a tenth of the noise"
    assert np.mean(raws) > sigma, "the largest sample's does not, so the test can tell"


def test_ringing_is_left_in_the_peak() -> None:
    drop, rng = SHAPES["flexed C_d=0"], np.random.default_rng(3)
    recorder = drops.Recorder(noise=0.002, ringing=(0.05, 6e3, 1e-3))
    fine = np.arange(0, drop.t_c, 1e-7)
    top = float(np.max(drop.force(fine) + drops.ring(drop, recorder, fine)))
    assert top - drop.F_M > 3
    record, _ = drops.record(drop, recorder, rng)
    found = analyze(record, drops.impact(drop))
    assert number(found, "F_M") == pytest.approx(top, abs=2)
    assert number(found, "ringing_Hz") == pytest.approx(6e3, rel=0.01)


def bouncing(
    drop: drops.Drop, dt: float, flight: float, rng: np.random.Generator, **more: float
) -> tuple[Record, float]:
    """A record of a drop and two further contacts, `flight` apart and weaker; and the second's onset."""
    n = int((3 * flight + 0.01) / dt)
    t0 = 2e-3 + float(rng.uniform()) * dt
    t = np.arange(n) * dt
    force = drop.force(t - t0)
    second = t0 + drop.t_c + flight
    force += 0.6 * drop.force(t - second) + 0.4 * drop.force(t - second - drop.t_c - 0.5 * flight)
    ring = drops.Recorder(ringing=(0.05, 4e3, 1e-3))
    force += drops.ring(drop, ring, t - t0) + 0.6 * drops.ring(drop, ring, t - second)
    force += rng.normal(0, more.get("noise", 0.005) * drop.F_M, n)
    return Record(force, dt), second


def test_second_contact_is_found_past_ringing_and_gives_restitution_by_flight_time() -> None:
    drop, rng = SHAPES["flexed C_d=5"], np.random.default_rng(5)
    flight = 2 * drop.eps * drop.v0 / drops.G
    record, second = bouncing(drop, 2e-6, flight, rng)
    found = analyze(record, drops.impact(drop))
    assert abs(number(found, "t_second") - second) < 3 * uncertainty(found, "t_second") + 2e-6
    assert number(found, "eps_flight") == pytest.approx(drop.eps, abs=1e-3)
    assert analyze(record, drops.impact(drop, catcher=True)).values["eps_flight"].value is None


def test_ringing_alone_is_no_second_contact() -> None:
    drop, rng = SHAPES["flexed C_d=5"], np.random.default_rng(6)
    for frequency in (2e3, 4e3, 1e4):
        record, _ = drops.record(
            drop, drops.Recorder(noise=0.005, ringing=(0.05, frequency, 2e-3), after=0.05, dt=2e-6), rng
        )
        assert analyze(record, drops.impact(drop)).values["t_second"].value is None


def test_a_million_samples_take_under_half_a_second() -> None:
    drop = SHAPES["flexed C_d=5"]
    record, _ = drops.record(drop, drops.Recorder(noise=0.005, before=0.1, after=0.897), np.random.default_rng(0))
    assert record.force.size > 990_000
    took = []
    for _ in range(3):
        begun = time.perf_counter()
        analyze(record, drops.impact(drop))
        took.append(time.perf_counter() - begun)
    assert min(took) < 0.5
