"""What the sensor chain and the converter promise."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_device import sensors
from sim_device.fall import Motion
from sim_device.flaws import saturated, with_stuck_bit, without
from sim_device.settings import Accelerometer, Dart, Displacement, Hang, Rig, Sensor, Specimen
from sim_device.stream import Drop, first_crossing, quiet, quiet_crossing, within_noise

CLEAN = Sensor(noise_N=0, offset_N=0, ringing=0)
CAUGHT = Hang(v0=1.39, catcher=True)


def counts(sensor: Sensor, *, dart: Dart | None = None, specimen: Specimen | None = None, number=1, seed=0, n=5000):
    rig = Rig(sensor=sensor, dart=dart or Dart(), specimen=specimen or Specimen(), drop=CAUGHT)
    drop = Drop(number, rig, Motion(rig), 0.0, 0.25, seed)
    return drop, drop.counts(-500_250.0, 1000, n)


def chain(sensor: Sensor, drop: Drop, first: float, interval: float, n: int):
    """The force channel of a drop as another sensor would see it."""
    return sensors.signal(Rig(sensor=sensor), drop.motion, 0, first, interval, n)


def test_counts_are_the_contact_force_in_steps_of_the_range():
    drop, taken = counts(CLEAN)
    t = -500.25e-6 + np.arange(5000) * 1e-6
    assert np.abs(taken * (3200 / 2**13) - drop.motion.force(t)).max() <= 0.5 * 3200 / 2**13 + 1e-9


@pytest.mark.parametrize("bits", [12, 16])
def test_the_converter_ends_at_its_rails(bits):
    _, taken = counts(Sensor(range_N=300, bits=bits, noise_N=0))
    assert taken.max() == 2 ** (bits - 1) - 1
    _, taken = counts(Sensor(range_N=300, bits=bits, noise_N=0, gain=-1))
    assert taken.min() == -(2 ** (bits - 1))


def test_the_sensor_does_not_feel_the_mass_below_it():
    _, whole = counts(Sensor(noise_N=0, offset_N=0, ringing=0, bits=16))
    _, less = counts(Sensor(noise_N=0, offset_N=0, ringing=0, bits=16), dart=Dart(tip_mass_kg=0.0503))
    assert less.max() / whole.max() == pytest.approx(0.9, abs=1e-3)


def test_noise_and_offset_are_as_set():
    sensor = Sensor(noise_N=3, offset_N=5, bits=16)
    force = quiet(Rig(sensor=sensor), (0, 1, 1), 0, 200_000) * (3200 / 2**15)
    assert force.mean() == pytest.approx(5, abs=0.03)
    assert force.std() == pytest.approx(3, rel=0.01)
    steps = np.diff(force)
    assert steps.std() == pytest.approx(3 * math.sqrt(2), rel=0.01)


def test_the_stream_is_the_same_however_it_is_cut():
    whole = sensors.white((1, 2), -9000, 20_000)
    assert np.array_equal(whole[3000:12_345], sensors.white((1, 2), -6000, 9345))


def test_a_seed_gives_the_same_drop_again_and_every_drop_its_own_noise():
    assert np.array_equal(counts(Sensor())[1], counts(Sensor())[1])
    assert not np.array_equal(counts(Sensor())[1], counts(Sensor(), number=2)[1])
    assert not np.array_equal(counts(Sensor())[1], counts(Sensor(), seed=1)[1])


def test_ringing_starts_at_contact_and_decays():
    drop, _ = counts(Sensor(bits=16))
    t = np.linspace(-1e-3, 4e-3, 5001)
    with_it = chain(Sensor(ringing=0.05), drop, -1e-3, 1e-6, 5001)
    without = chain(Sensor(ringing=0), drop, -1e-3, 1e-6, 5001)
    F_M = drop.motion.contacts[0][1].F_M
    expected = np.where(t < 0, 0, 0.05 * F_M * np.sin(2e4 * np.pi * t) * np.exp(-t / 0.5e-3))
    assert with_it - without == pytest.approx(expected, abs=1e-6)


def test_failure_sets_the_sensor_ringing_again():
    drop, _ = counts(CLEAN, specimen=Specimen(fail_N=500))
    moments = list(drop.motion.ringings(0.01))
    assert moments == [(0.0, 500.0), (drop.motion.truth()["t_failure"], 500.0)]


@pytest.mark.parametrize("interval", [1e-6, 2e-6])
def test_droop_is_that_of_a_first_order_high_pass(interval):
    tau, t = 0.01, np.arange(20_000) * interval
    assert sensors.droop(1e4 * t, interval, tau) == pytest.approx(1e4 * tau * -np.expm1(-t / tau), rel=1e-9, abs=1e-9)


def test_droop_can_be_undone_by_the_integral_of_what_is_measured():
    drop, _ = counts(CLEAN)
    tau, h = 0.1, 1e-6
    true = chain(CLEAN, drop, -1e-3, h, 8000)
    seen = chain(Sensor(noise_N=0, offset_N=0, ringing=0, time_constant_s=tau), drop, -1e-3, h, 8000)
    integral = np.concatenate([[0], np.cumsum(0.5 * h * (seen[1:] + seen[:-1]))])
    assert seen + integral / tau == pytest.approx(true, abs=1e-6)
    assert seen[-1] < -5


def test_a_record_that_begins_after_contact_has_the_droop_of_what_came_before():
    drop, _ = counts(CLEAN)
    sensor = Sensor(noise_N=0, offset_N=0, ringing=0, time_constant_s=0.05)
    whole = chain(sensor, drop, -1e-4, 1e-6, 6000)
    late = chain(sensor, drop, 1.9e-3, 1e-6, 4000)
    assert late == pytest.approx(whole[2000:], abs=1e-3)


class At:
    def __init__(self, level: int, slope: str = "POS"):
        self.level, self.slope, self.interval_ns = level, slope, 1000


def test_the_comparator_wants_a_crossing_in_the_right_direction():
    samples = np.array([5, 9, 10, 12, 10, 9], dtype=np.int16)
    assert first_crossing(samples, At(10)) == 2
    assert first_crossing(samples, At(9, "NEG")) == 5
    assert first_crossing(samples, At(13)) is None
    assert first_crossing(samples, At(5)) is None


def test_the_comparator_sees_the_contact_in_the_very_samples_of_the_record():
    drop, _ = counts(Sensor())
    found = drop.crossing(At(300), -5000)
    assert found is not None
    around = drop.counts(drop.since_contact(found - 1, 1000), 1000, 2)
    assert around[0] < 300 <= around[1]
    assert drop.crossing(At(8000), -5000) is None


def test_a_level_within_the_noise_is_crossed_by_noise():
    assert within_noise(Rig(), 20)
    assert not within_noise(Rig(), 200)
    assert quiet_crossing(Rig(), (0, 1, 1), At(20), 500, 100_000) is not None


def test_a_stuck_bit_sits_in_every_sample():
    samples = np.array([-5, 0, 7, 1000], dtype=np.int16)
    assert np.all(with_stuck_bit(samples, 3, True) & 8)
    assert not np.any(with_stuck_bit(samples, 0, False) & 1)


def test_a_saturated_record_stands_at_the_rails_beyond_its_share():
    samples = np.array([[-5000, -10, 0, 399, 410, 8000], [5000] * 6], dtype=np.int16)
    assert saturated(samples, 14, 0.05).tolist() == [[-8192, -10, 0, 399, 8191, 8191], [5000] * 6]


def test_samples_that_are_missing_move_up_what_follows():
    samples = np.arange(16, dtype=np.int16).reshape(2, 8)
    assert without(samples, 2, 3).tolist() == [[0, 1, 5, 6, 7, 7, 7, 7], [8, 9, 13, 14, 15, 15, 15, 15]]


def test_the_other_channels_see_the_same_motion():
    rig = Rig(
        sensor=CLEAN, second_sensor=Sensor(noise_N=0, offset_N=0, ringing=0, gain=0.5),
        displacement=Displacement(noise_mm=0), accelerometer=Accelerometer(noise_m_s2=0), drop=CAUGHT,
    )  # fmt: skip
    drop = Drop(1, rig, Motion(rig), 0.0, 0.25, 0)
    first, interval, n = -0.2, 1e-5, 24_000
    F, second, mm, a = (sensors.signal(rig, drop.motion, k, first, interval, n) for k in range(4))
    assert second == pytest.approx(0.5 * F)
    t = first + np.arange(n) * interval
    held = t < -drop.motion.t_fall
    assert a[held] == pytest.approx(9.80665)
    assert a[~held] == pytest.approx(F[~held] / 0.503)
    # Twice differentiated, the displacement is the acceleration that gravity and the specimen make.
    speed = np.gradient(mm * 1e-3, interval)
    flying = (t > -drop.motion.t_fall + 1e-4) & (t < -1e-4)
    assert speed[flying] == pytest.approx(1.39 + 9.80665 * t[flying], abs=1e-6)
    touching = (t > 1e-4) & (t < 1e-3)
    assert np.gradient(speed, interval)[touching] == pytest.approx(9.80665 - a[touching], abs=5)
    assert mm[held] == pytest.approx(sensors.at_rest(rig, 2), abs=1e-9)
    assert mm.max() == pytest.approx(drop.motion.truth()["alpha_M"] * 1e3, rel=1e-4)
