"""From the contact force to the counts of the converter."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sim_device.fall import Motion
from sim_device.mechanics import Floats
from sim_device.settings import Dart, Sensor

NOISE_BLOCK = 4096
RINGING_LASTS = 40
"""Decay times after which a ringing is below any converter's step."""
DROOP_BLOCK = 4096


def counts_per_newton(sensor: Sensor) -> float:
    """Counts a newton: the rails stand at ±range_N."""
    return 2 ** (sensor.bits - 1) / sensor.range_N


def rails(sensor: Sensor) -> tuple[int, int]:
    """Smallest and largest count of the converter."""
    return -(2 ** (sensor.bits - 1)), 2 ** (sensor.bits - 1) - 1


def white(seed: tuple[int, ...], first: int, n: int) -> Floats:
    """Standard normal numbers ``first`` to ``first + n`` of an endless stream, the same however it is cut (n,)."""
    start = first // NOISE_BLOCK
    blocks = [
        np.random.Generator(np.random.SFC64(np.random.SeedSequence((*seed, int(k >= 0), abs(k))))).standard_normal(
            NOISE_BLOCK
        )
        for k in range(start, (first + n - 1) // NOISE_BLOCK + 1)
    ]
    skip = first - start * NOISE_BLOCK
    return np.concatenate(blocks)[skip : skip + n] if blocks else np.zeros(0)


def droop(signal: Floats, interval: float, time_constant: float) -> Floats:
    """A charge amplifier's droop: first-order high-pass of ``signal`` (n,), sampled every ``interval`` s, from rest.

    Exact for a signal that is straight between samples:
    y_k = a·y_{k−1} + (x_k − x_{k−1})·τ(1 − a)/h with a = exp(−h/τ).
    """
    a = math.exp(-interval / time_constant)
    rise = np.diff(signal, prepend=0.0) * (time_constant * -math.expm1(-interval / time_constant) / interval)
    result = np.empty_like(signal)
    carried = 0.0
    block = max(1, min(DROOP_BLOCK, int(20 * time_constant / interval)))
    for start in range(0, len(signal), block):
        part = rise[start : start + block]
        fading = a ** np.arange(1, len(part) + 1)
        result[start : start + block] = fading * (carried + np.cumsum(part / fading))
        carried = float(result[min(start + block, len(signal)) - 1])
    return result


def _force_chain(motion: Motion, dart: Dart, sensor: Sensor, t: Floats) -> Floats:
    F = motion.force(t) * ((motion.law.m - dart.tip_mass_kg) / motion.law.m) * sensor.gain
    if sensor.ringing > 0:
        omega = 2 * math.pi * sensor.ringing_Hz
        for start, peak in motion.ringings(float(t[-1])):
            first, last = np.searchsorted(t, [start, start + RINGING_LASTS * sensor.ringing_decay_s])
            after = t[first:last] - start
            F[first:last] += sensor.ringing * peak * np.sin(omega * after) * np.exp(-after / sensor.ringing_decay_s)
    return F


def signal(motion: Motion | None, dart: Dart, sensor: Sensor, first: float, interval: float, n: int) -> Floats:
    """What the sensor chain puts before the converter, without noise, in N (n,).

    ``first`` is the time of the first sample in s from first contact, ``interval`` the time between samples in s.
    """
    if motion is None:
        return np.full(n, sensor.offset_N)
    t = np.add(first, np.arange(n) * interval, dtype=np.float64)
    if sensor.time_constant_s is None:
        return _force_chain(motion, dart, sensor, t) + sensor.offset_N
    # The amplifier remembers all that was before: its samples begin before first contact.
    earlier = max(0, math.ceil(first / interval) + 1)
    whole = np.add(first - earlier * interval, np.arange(n + earlier) * interval, dtype=np.float64)
    F = _force_chain(motion, dart, sensor, whole)
    return droop(F, interval, sensor.time_constant_s)[earlier:] + sensor.offset_N


def digitised(force: Floats, sensor: Sensor) -> NDArray[np.int16]:
    """Counts of the converter (n,) for a force in N (n,), clipped at the rails."""
    low, high = rails(sensor)
    return np.clip(np.rint(force * counts_per_newton(sensor)), low, high).astype(np.int16)
