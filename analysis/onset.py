"""First contact and end of contact between the samples.

Near either end the force follows the local inverse law of a Hertz contact on a compliant support,
    A·x^{2/3} + B·(x − φ·(1 − e^{−x/φ})) = (t − t0) − ∬F dt²/(m·v) ∓ P·∫F dt/J,   x = F/F_top,   A, B, φ, P ≥ 0
A is indentation, B the support's compliance, φ the force below which the support's dashpot holds it, P what yields for
good. The right side is the dart's way over its speed: time, less what the force has taken off the speed so far.
A half sine is A = P = 0, pure Hertz B = P = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.posterior import Part, bounded_part, damped_least_squares, mixture
from analysis.record import Array
from analysis.ringing import Ringing

_PHI_SCALE = 0.03  # C_d·v0/F_M is 0 to 0.03 over P1's plates
_FROM_REST = 0.2  # of its amplitude: how far from 0 ringing may begin; the sensor is at rest before contact
_DISCREPANCY = 1.25  # widens every interval: what real shapes lack of the law; from bench/coverage_events.py
_FAR = 3.0  # window lengths
_HOLD = 0.03  # of the delay that the dashpot makes: what the exponential in the law lacks of the plate equations
_PHI_NODES = (0.0, 0.2, 0.5, 1.0, 1.6)  # of that


@dataclass(frozen=True)
class Edge:
    """An end of contact: time, s, its standard uncertainty, s, and the reduced χ² of the fit."""

    t: float
    u: float
    chi2: float


@dataclass(frozen=True)
class Rise:
    """What `fit_edge` works on, time running away from the edge into the contact.

    t, force : (n,) s and N; guess : s, edge to a few samples
    top : N, largest force in the window; peak : N, F_M; noise : N
    u_level : N, what the zero level may be off; yields : s, the P that would take all the energy lost; impulse : N·s, J
    slowing : s/(kg·m), 1/(m·v); ending : the edge is the end of contact, time runs backwards
    """

    t: Array
    force: Array
    guess: float
    top: float
    peak: float
    noise: float
    u_level: float
    yields: float
    impulse: float
    slowing: float
    ending: bool
    ringing: Ringing | None


def fit_edge(rise: Rise) -> Edge:
    """Time of the edge: mean of the fit's posterior over the parameters that can be."""
    t, step = rise.t, float(rise.t[1] - rise.t[0])
    span = max(float(t[-1]) - rise.guess, 2 * step)
    pushed = np.cumsum(np.where(t > rise.guess, np.maximum(rise.force, 0), 0.0)) * step
    taken = rise.slowing * np.cumsum(pushed) * step
    yielded = (1.0 if rise.ending else -1.0) * pushed / rise.impulse
    ring_sd = rise.ringing.u_pair if rise.ringing is not None else np.ones(2)
    ring0 = rise.ringing.pair if rise.ringing is not None else np.zeros(2)
    sd = np.array([span, span, span, 1.0, 0.4 * rise.yields + 1e-9, rise.u_level, *ring_sd])
    prior = np.array([0, 0, 0, 0, 1, 1, 1, 1.0])
    centre = np.array([0, 0, 0, 0, 1.5, 0, 0, 0.0])  # 0.6 of `yields`, give or take 0.4
    ringing = rise.ringing is not None
    free = np.array([True, True, True, False, True, rise.u_level > 0, ringing, ringing])
    low = np.array([-np.inf, 0, 0, 0, 0, -np.inf, -np.inf, -np.inf])

    def residual(q: Array) -> tuple[Array, Array]:
        p = q * sd
        tau = t - rise.guess - p[0] - taken + p[4] * yielded
        x, columns = _law(tau, max(p[1], 1e-9 * span), max(p[2], 0.0), max(p[3], 1e-9))
        jacobian = np.zeros((t.size + 9, 8))
        part = jacobian[: t.size]
        part[:, :4] = columns
        part[:, 4] = -columns[:, 0] * yielded
        part[:, :5] *= rise.top
        part[:, 5] = 1.0
        value = rise.top * x + p[5]
        begins = 0.0
        if rise.ringing is not None:
            sign = -1.0 if rise.ending else 1.0
            on = 1.0 if rise.ending else np.clip((t - rise.guess - p[0]) / step + 0.5, 0.0, 1.0)
            for k in (0, 1):
                part[:, 6 + k] = on * rise.ringing.wave(sign * t, np.eye(2)[k])
            value = value + part[:, 6:] @ (ring0 + p[6:])
            if not rise.ending:
                begins = _from_rest(rise.ringing, rise.guess + p[0], ring0 + p[6:], jacobian[-1])
        part *= sd / rise.noise
        jacobian[t.size : -1] = np.diag(prior)
        jacobian[-1] *= sd
        return np.concatenate(((value - rise.force) / rise.noise, prior * (q - centre), [begins])), jacobian

    # t0 and φ are not linear in each other: the posterior is a mixture over φ.
    unit = _PHI_SCALE * rise.peak / rise.top
    parts: list[Part] = []
    delays: list[float] = []
    for node in (0.0,) if rise.ending else _PHI_NODES:
        first = np.where(free, np.array([0, 0.4, 0.6, 0, 1.5, 0, 0, 0]), 0.0)
        first[3] = node * unit
        q = damped_least_squares(residual, first, low, free)
        rest, jacobian = residual(q)
        delays.append(float(q[2] * q[3] * (1 - np.exp(-1 / max(q[3], 1e-9)))))
        parts.append(bounded_part(q, rest, jacobian, low, free, float(rest[: t.size] @ rest[: t.size]), node**2))
    mean, deviation, misfit = mixture(parts, _HOLD * np.array(delays), max(t.size - 4, 1))
    if not (abs(mean) < _FAR and deviation < _FAR):
        # Nothing like the law: the sample found before stands, as unsure as the window is long.
        return Edge(rise.guess, span, float("inf"))
    return Edge(rise.guess + span * mean, _DISCREPANCY * span * deviation, misfit)


def _from_rest(ringing: Ringing, t0: float, pair: Array, row: Array) -> float:
    """Residual of ringing that begins at 0, and its derivatives into `row`."""
    unit = _FROM_REST * float(np.hypot(*ringing.pair))
    at = np.array([t0 - 1e-8, t0, t0 + 1e-8])
    values = ringing.wave(at, pair) / unit
    row[0] = (values[2] - values[0]) / 2e-8
    row[6:] = [float(ringing.wave(at[1:2], one)[0]) / unit for one in np.eye(2)]
    return float(values[1])


def _law(tau: Array, a: float, b: float, phi: float) -> tuple[Array, Array]:
    """x(τ), 0 for τ ≤ 0, and its derivatives by t0, A, B, φ: (n,), (n, 4)."""
    x = np.zeros_like(tau)
    columns = np.zeros((tau.size, 4))
    on = tau > 0
    want = tau[on]
    if want.size == 0:
        return x, columns
    top = 2.0
    while a * top ** (2 / 3) + b * (top - phi) < want.max() and top < 1e4:
        top *= 2
    grid = np.linspace(0.0, top ** (1 / 3), 128)
    u = np.interp(want, a * grid**2 + b * (grid**3 - phi * (1 - np.exp(-(grid**3) / phi))), grid)
    for _ in range(4):
        e = np.exp(-(u**3) / phi)
        error = a * u * u + b * (u**3 - phi * (1 - e)) - want
        u = np.maximum(u - error / np.maximum(2 * a * u + 3 * b * u * u * (1 - e), 1e-30), 1e-9)
    x[on] = u**3
    z = u**3 / phi
    e = np.exp(-z)
    slope = 1 / np.maximum(2 / 3 * a / u + b * (1 - e), 1e-30)
    columns[on] = np.column_stack(
        (-slope, -slope * u * u, -slope * (u**3 - phi * (1 - e)), slope * b * (1 - e - z * e))
    )
    return x, columns


def clean_edge(t: Array, force: Array, high: int, noise: float) -> Edge | None:
    """Edge of a record without noise, from its first 4, 5 and 6 samples, by the one of two series that agrees best.

    t = t0 + Σ c_k·F^{k/3}, k = 2, 3, …, holds for a support without dashpot: it is the law above with its corrections.
    F^{2/3} = Σ c_k·(t − t0)^k holds for one with, where the force bends over within samples.
    t, force : (n,) s and N, from the edge into the contact; high : a sample surely in contact. None where neither
    agrees to 0.05 sample, as with ringing.
    """
    step = float(t[1] - t[0])
    below = np.flatnonzero(force[:high] <= max(1e-7 * float(force.max()), 10 * noise))
    first = int(below[-1]) + 1 if below.size else 0
    if first == 0 or first + 6 > force.size or float(force[first : first + 6].min()) <= 0:
        return None
    u = np.cbrt(force[first : first + 6] / force[first + 5])
    best: tuple[float, float] | None = None
    for series in (_time_over_force, _force_over_time):
        roots = [series(u[:n]) for n in (4, 5, 6)]
        spread = max(roots) - min(roots)
        if all(-1.05 <= r <= 0 for r in roots) and (best is None or spread < best[0]):
            best = spread, roots[-1]
    if best is None or best[0] > 0.05:
        return None
    return Edge(float(t[first]) + best[1] * step, max(best[0], 1e-3) * step, 1.0)


def _time_over_force(u: Array) -> float:
    """t0 in samples from u = F^{1/3} (n,) at 0, 1, …, through all of them; NaN where there is none."""
    rows = np.column_stack((np.ones(u.size), *(u**k for k in range(2, u.size + 1))))
    try:
        return float(np.linalg.solve(rows, np.arange(u.size, dtype=np.float64))[0])
    except np.linalg.LinAlgError:
        return float("nan")


def _force_over_time(u: Array) -> float:
    """Zero before the first sample of the polynomial through u² (n,) at 0, 1, …, by Newton."""
    fit = np.polynomial.polynomial.polyfit(np.arange(u.size), u * u, u.size - 1)
    slope = np.polynomial.polynomial.polyder(fit)
    at = 0.0
    for _ in range(20):
        at -= float(np.polynomial.polynomial.polyval(at, fit) / np.polynomial.polynomial.polyval(at, slope))
    return at
