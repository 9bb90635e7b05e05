"""Drops for the tests: the models of PHYSICS.md by scipy at tight tolerance, and what a recorder does to them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from analysis import Impact, Record

G = 9.80665
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Drop:
    """A contact known exactly: force(t) from first contact (0 outside), and what follows from it."""

    name: str
    mass: float
    v0: float
    t_c: float
    F_M: float
    J: float
    eps: float
    alpha_M: float
    alpha_r: float
    E_diss: float
    grid: tuple[float, ...]
    values: tuple[float, ...]

    def force(self, t: Array) -> Array:
        if self.name == "half-sine":
            return np.where((t > 0) & (t < self.t_c), self.F_M * np.sin(np.pi * t / self.t_c), 0.0)
        inside = (t > 0) & (t < self.t_c)
        # The grid is even in a stretched variable that follows the 3/2 power at both ends.
        s = np.arccos(np.clip(1 - 2 * t / self.t_c, -1, 1)) / np.pi
        return np.where(inside, CubicSpline(self.grid, self.values)(s), 0.0)


@cache
def half_sine(peak: float = 1050.0, t_c: float = 3e-3, mass: float = 0.5, v0: float = 2.0) -> Drop:
    """F = F_M·sin(πt/t_c): J = 2·F_M·t_c/π, and the rest by hand."""
    j = 2 * peak * t_c / np.pi
    eps = j / (mass * v0) - 1 - G * t_c / v0
    # v(t) = v0 + g·t − (J/2m)(1 − cos ωt)
    omega = np.pi / t_c
    a = peak / (mass * omega)
    alpha_r = v0 * t_c + G * t_c**2 / 2 - a * t_c
    e_diss = mass / 2 * (v0**2 - (eps * v0) ** 2) + mass * G * alpha_r
    t = np.linspace(0, t_c, 2_000_001)
    alpha = v0 * t + G * t**2 / 2 - a * (t - np.sin(omega * t) / omega)
    return Drop("half-sine", mass, v0, t_c, peak, j, eps, float(alpha.max()), alpha_r, e_diss, (), ())


@cache
def plate(
    name: str,
    v0: float = 2.0,
    mass: float = 0.503,
    E: float = 3.3e9,
    nu: float = 0.30,
    r: float = 6.35e-3,
    d: float = 4.6e-3,
    R: float = 30e-3,
    C_i: float = 7000.0,
    C_d: float = 8.0,
    flexed: bool = True,
) -> Drop:
    """Flexed plate (C_d = 0 exactly or not), or without flexure the series model (C_i = inf: conservative)."""
    K = 4 / 3 * np.sqrt(r) * E / (1 - nu**2)
    K_d = 4 * np.pi / 3 * d**3 / ((1 - nu) * (3 + nu) * R**2) * E
    c = 0.0 if np.isinf(C_i) else 1 / C_i

    def f(a1: float) -> float:
        return K * max(a1, 0.0) ** 1.5

    # y = v, α, α1, α3, E, J
    def rates(_: float, y: Array) -> list[float]:
        v, _, a1, a3, *_ = y
        force = f(a1)
        if not flexed:
            a3_rate, a1_rate = 0.0, v - force * c
        elif C_d == 0:
            a1_rate = (v - force * c) / (1 + 1.5 * K * np.sqrt(max(a1, 0.0)) / K_d)
            a3_rate = v - force * c - a1_rate
        else:
            a3_rate = (force - K_d * a3) / C_d
            a1_rate = v - force * c - a3_rate
        return [G - force / mass, v, a1_rate, a3_rate, force * v, force]

    def over(_: float, y: Array) -> float:
        return float(y[2])

    over.terminal = True
    over.direction = -1
    sol = solve_ivp(rates, (0, 0.05), [v0, 0, 0, 0, 0, 0], events=over, method="Radau" if C_d else "DOP853",
                    rtol=1e-10, atol=[1e-10, 1e-14, 1e-14, 1e-14, 1e-12, 1e-12], dense_output=True)  # fmt: skip
    t_c = float(sol.t_events[0][0])
    s = np.linspace(0, 1, 4001)
    t = t_c * (1 - np.cos(np.pi * s)) / 2
    y = sol.sol(t)
    y[2, -1] = y[2, 0] = 0.0
    force = K * np.maximum(y[2], 0) ** 1.5
    fine = CubicSpline(s, force)(np.linspace(0, 1, 400_001))
    return Drop(name, mass, v0, t_c, float(fine.max()), float(y[5, -1]), float(-y[0, -1] / v0), float(y[1].max()),
                float(y[1, -1]), float(y[4, -1]), tuple(s), tuple(force))  # fmt: skip


def shapes() -> dict[str, Drop]:
    """The shapes that the requirement names."""
    return {
        "half-sine": half_sine(),
        "conservative": plate("conservative", C_i=np.inf, flexed=False),
        "series": plate("series", C_i=5000.0, flexed=False, v0=1.6, mass=0.743),
        "flexed C_d=0": plate("flexed C_d=0", C_d=0.0),
        "flexed C_d=5": plate("flexed C_d=5", C_d=5.0),
        "flexed C_d=15": plate("flexed C_d=15", C_d=15.0, v0=2.8, C_i=5000.0),
    }


@dataclass(frozen=True)
class Recorder:
    """What the recorder adds: noise (of F_M), ringing (of F_M, Hz, s), bits over ±1.6 F_M, offset, drift."""

    dt: float = 1e-6
    noise: float = 0.0
    ringing: tuple[float, float, float] | None = None
    bits: int | None = None
    offset: float = 0.0
    before: float = 1.5e-3
    after: float = 2e-3


def ring(drop: Drop, recorder: Recorder, t: Array) -> Array:
    """Force of the ringing, N: a decaying sine from first contact on."""
    if recorder.ringing is None:
        return np.zeros_like(t)
    size, frequency, decay = recorder.ringing
    on = np.maximum(t, 0.0)
    return np.where(t > 0, size * drop.F_M * np.exp(-on / decay) * np.sin(2 * np.pi * frequency * on), 0.0)


def record(drop: Drop, recorder: Recorder, rng: np.random.Generator) -> tuple[Record, float]:
    """A record of `drop` with a random sub-sample phase, and its t_contact."""
    t0 = recorder.before + float(rng.uniform()) * recorder.dt
    n = int((recorder.before + drop.t_c + recorder.after) / recorder.dt)
    t = np.arange(n) * recorder.dt - t0
    force = drop.force(t) + ring(drop, recorder, t) + recorder.offset
    force = force + rng.normal(0, recorder.noise * drop.F_M, n) if recorder.noise else force
    lsb = None
    if recorder.bits is not None:
        lsb = 3.2 * drop.F_M / 2**recorder.bits
        force = np.round(force / lsb) * lsb
    return Record(force, recorder.dt, lsb=lsb), t0


def impact(drop: Drop, **more: object) -> Impact:
    """Conditions that fit `drop`."""
    given: dict[str, object] = {"mass": drop.mass, "tip_radius": 6.35e-3, "thickness": 4.6e-3, "nu": 0.3,
                                "support": "ring", "support_radius": 0.03, "v0": drop.v0}  # fmt: skip
    return Impact(**(given | more))
