"""Maximum force without the white noise that lifts the largest sample."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.record import Array
from analysis.ringing import Ringing

_DEGREE = 4
_DISCREPANCY = 1.2  # what a peak that just passes for a quartic differs from it; from bench/coverage_events.py


@dataclass(frozen=True)
class Peak:
    """Maximum force, N, its time, s, and standard uncertainties from noise."""

    force: float
    u_force: float
    t: float
    u_t: float


def find_peak(t: Array, force: Array, at: int, noise: float, longest: float, ringing: Ringing | None) -> Peak:
    """Top of a quartic, with the ringing's pair where there is ringing, fitted around the peak.

    The widest window (half-width up to `longest` s) in which that fits within the noise is used: real ringing stays in,
    white noise averages out. Where none does, as beside a sudden drop, windows that end at the largest sample `at` are
    tried, and at last that sample itself stands. noise : N
    """
    step = float(t[1] - t[0])
    noise = max(noise, 1e-7 * abs(float(force[at])))
    near = slice(max(0, at - int(longest / step)), at + int(longest / step) + 1)
    high = np.flatnonzero(force[near] >= force[at] - max(0.03 * abs(force[at]), 3 * noise)) + near.start
    middle = int(np.median(high))
    half = max(int(longest / step), 4)
    while half >= 4:
        for first, last in ((middle - half, middle + half + 1), (at - 2 * half, at + 1)):
            if first >= 0 and last <= force.size:
                found = _fitted(t[first:last], force[first:last], noise, ringing)
                if found is not None:
                    return found
        half = int(half / 1.3)
    return Peak(float(force[at]), noise, float(t[at]), step)


def _fitted(t: Array, force: Array, noise: float, ringing: Ringing | None) -> Peak | None:
    middle, scale = (t[0] + t[-1]) / 2, (t[-1] - t[0]) / 2

    def rows(at: Array) -> Array:
        basis = np.vander((at - middle) / scale, _DEGREE + 1, increasing=True)
        if ringing is None:
            return basis
        return np.column_stack((basis, *(ringing.wave(at, pair) for pair in np.eye(2))))

    basis = rows(t)
    normal = basis.T @ basis
    try:
        inverse = np.linalg.inv(normal)
    except np.linalg.LinAlgError:
        return None
    coefficients = inverse @ (basis.T @ force)
    rest = force - basis @ coefficients
    free = t.size - basis.shape[1]
    if free < 2 or float(rest @ rest) > noise**2 * (free + np.sqrt(2 * free)):
        return None
    step = float(t[1] - t[0])
    fine = np.linspace(t[0], t[-1], 8 * t.size)
    top = float(fine[int(np.argmax(rows(fine) @ coefficients))])
    below, row, above = rows(np.array([top - step, top, top + step]))
    values = np.array([below, row, above]) @ coefficients
    curvature = float(values[0] - 2 * values[1] + values[2])
    slope = (above - below) / 2
    if curvature < 0:
        top -= step * float(values[2] - values[0]) / 2 / curvature
        row = rows(np.array([top]))[0]
    u_top = step * noise * float(np.sqrt(slope @ inverse @ slope)) / max(-curvature, 1e-12)
    u = _DISCREPANCY * noise * float(np.sqrt(row @ inverse @ row))
    force_at_top = float(row @ coefficients)
    # A fit less sure than one sample, or away from the samples, is none: pair and quartic cannot be told apart there.
    if not u < noise or not abs(force_at_top - float(force.max())) < 6 * noise + 0.01 * abs(force_at_top):
        return None
    return Peak(force_at_top, u, top, min(u_top, scale))
