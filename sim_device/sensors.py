"""From the dart's motion to the counts of the converter, channel by channel."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_device.fall import Motion
from sim_device.law import Floats
from sim_device.settings import Dart, Rig, Sensor, g

DISPLACEMENT, ACCELEROMETER = 2, 3
"""Channels, from 0; 0 and 1 are the tups."""
NOISE_BLOCK = 4096
RINGING_LASTS = 40
"""Decay times after which a ringing is below any converter's step."""
DROOP_BLOCK = 4096


@dataclass(frozen=True)
class Scale:
    """A channel's converter: ``range`` at the rails, ``noise`` and ``offset`` in the channel's unit."""

    range: float
    noise: float
    offset: float
    bits: int

    @classmethod
    def of(cls, rig: Rig, channel: int) -> Scale:
        """The converter of a channel, from 0."""
        bits = rig.sensor.bits
        if channel == DISPLACEMENT:
            d = rig.displacement
            return cls(d.range_mm, d.noise_mm, d.offset_mm, bits)
        if channel == ACCELEROMETER:
            a = rig.accelerometer
            return cls(a.range_m_s2, a.noise_m_s2, a.offset_m_s2, bits)
        s = _tup(rig, channel)
        return cls(s.range_N, s.noise_N, s.offset_N, bits)

    @property
    def per_unit(self) -> float:
        """Counts a unit: the rails stand at ±range."""
        return 2 ** (self.bits - 1) / self.range

    def counts(self, value: Floats) -> NDArray[np.int16]:
        """Counts of the converter (n,) for a value in the channel's unit (n,), clipped at the rails."""
        rail = 2 ** (self.bits - 1)
        return np.clip(np.rint(value * self.per_unit), -rail, rail - 1).astype(np.int16)


def _tup(rig: Rig, channel: int) -> Sensor:
    return rig.second_sensor if channel else rig.sensor


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


def at_rest(rig: Rig, channel: int) -> float:
    """What a channel sees while the dart hangs in its clamp, in its unit, without offset."""
    if channel == DISPLACEMENT:
        height = rig.drop.height_mm if rig.drop.height_mm is not None else 500 * (rig.drop.v0 or 0) ** 2 / g
        return -height * rig.displacement.gain
    return g * rig.accelerometer.gain if channel == ACCELEROMETER else 0.0


def signal(rig: Rig, motion: Motion, channel: int, first: float, interval: float, n: int) -> Floats:
    """What a channel's sensor puts before the converter, without offset and noise, in the channel's unit (n,).

    ``first`` is the time of the first sample in s from first contact, ``interval`` the time between samples in s.
    """
    t = np.add(first, np.arange(n) * interval, dtype=np.float64)
    if channel == DISPLACEMENT:
        return motion.position(t) * 1e3 * rig.displacement.gain
    if channel == ACCELEROMETER:
        return np.where(t < -motion.t_fall, g, motion.force(t) / motion.law.m) * rig.accelerometer.gain
    sensor = _tup(rig, channel)
    if sensor.time_constant_s is None:
        return _force_chain(motion, rig.dart, sensor, t)
    # The amplifier remembers all that was before: its samples begin before first contact.
    earlier = max(0, math.ceil(first / interval) + 1)
    whole = np.add(first - earlier * interval, np.arange(n + earlier) * interval, dtype=np.float64)
    F = _force_chain(motion, rig.dart, sensor, whole)
    return droop(F, interval, sensor.time_constant_s)[earlier:]
