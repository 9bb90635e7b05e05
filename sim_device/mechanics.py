"""One contact between dart and specimen, integrated from touch to parting (PHYSICS.md, Models).

The state is (x, v, α₂, α₃): x the dart's displacement into the undeformed specimen, α₂ the flow of the dashpot in
series, α₃ the bending of the plate. What is left, α₁ = x − α₂ − α₃, is the Hertzian indentation that makes the force.
A plate with mass bends in modes instead (q, q̇ of each behind the four), M·(q̈ + 2ζω·q̇ + ω²·q) = F; what the modes that
are left out would bend follows the force at once.
"""

from __future__ import annotations

import contextlib
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_device.plate import Layer, Mode, modes_of
from sim_device.settings import Dart, Specimen, g

Floats = NDArray[np.float64]

FAILURE_DECAY = 10e-6
"""s, time constant with which a failed specimen loses its stiffness, K_i and K_d alike: all force with it."""
LONGEST_CONTACT = 0.1
"""s; a dart that has not left by then lies on the specimen."""
LEAST_LAG = 1e-10
"""s; a plate that follows faster (C_d/K_d) is taken to follow at once. That moves ε by less than 1e-6, and the rounding
of α₁ alone would keep the integrator from ever getting through."""
TOLERANCES = (1e-11, 1e-9, 1e-7)
"""Relative, the next for a contact that the one before cannot settle: one so stiff that rounding is in the way."""
SCALE = np.array([1e-6, 1e-3, 1e-7, 1e-7])
"""m, m/s, m, m: of the state, times the tolerance, for the absolute one."""
MOST_STEPS = 40_000
"""Evaluations of the equations, some twenty times what a contact takes, and as many again for each mode of a plate."""
CLEAR = 50e-6
"""m above where a plate with mass rests: a dart that is as high has left, and is not hit again by the plate."""


@dataclass(frozen=True)
class Law:
    """Constants of dart and specimen.

    m : kg; friction : N; K_i : N/m^1.5 (P1 eq. 16); K_d : N/m, inf when rigid (P1 eq. 14); C_i : kg/s, inf without
    dashpot; C_d : kg/s; fail_N : N, inf when it never fails; modes : of a plate with mass, damping : ζ of each
    layer : of a specimen of finite thickness, None for a half-space.
    """

    m: float
    friction: float
    K_i: float
    K_d: float
    C_i: float
    C_d: float
    fail_N: float
    modes: tuple[Mode, ...] = ()
    damping: float = 0.0
    layer: Layer | None = None

    @classmethod
    def of(cls, specimen: Specimen, dart: Dart) -> Law:
        """The law of a specimen under a dart."""
        E, nu = specimen.E_GPa * 1e9, specimen.nu
        d, R = specimen.thickness_mm * 1e-3, specimen.support_radius_mm * 1e-3
        ring = specimen.kind == "ring"
        dashpot = specimen.C_i if ring else specimen.C
        tip = dart.tip_radius_mm * 1e-3
        return cls(
            m=dart.mass_kg,
            friction=dart.friction_N,
            K_i=4 / 3 * math.sqrt(tip) * E / (1 - nu**2),
            K_d=4 * math.pi / 3 * d**3 / ((1 - nu) * (3 + nu) * R**2) * E if ring else math.inf,
            C_i=math.inf if dashpot is None else dashpot,
            C_d=specimen.C_d if ring else 0.0,
            fail_N=math.inf if specimen.fail_N is None else specimen.fail_N,
            modes=modes_of(specimen.modes, E, nu, d, R, specimen.density_kg_m3) if ring else (),
            damping=specimen.modal_damping,
            layer=None if ring or not specimen.finite else Layer(tip, d, nu),
        )

    @property
    def bends(self) -> bool:
        """Whether α₃ is a state of its own; else (C_d = 0, or as good as) it follows from the force at once."""
        return math.isfinite(self.K_d) and self.C_d > LEAST_LAG * self.K_d and not self.modes

    @property
    def at_once(self) -> float:
        """m/N, bending that follows the force at once: all of a massless plate's, the rest of one with modes."""
        return max(0.0, 1 / self.K_d - sum(1 / (m.M * m.omega**2) for m in self.modes))

    def gap(self, y: Floats) -> Floats:
        """δ in m of states (4 + 2n, …): what the tip is in the surface that it would meet without force."""
        return y[0] - y[2] - y[3] - y[4::2].sum(axis=0)

    def spring(self, alpha1: Floats) -> Floats:
        """F in N at α₁ ≥ 0 (n,), m."""
        F = self.K_i * alpha1**1.5
        return F if self.layer is None else F * np.vectorize(self.layer.factor)(alpha1)

    def spring_at(self, alpha1: float) -> float:
        """``spring`` for one value."""
        F = self.K_i * alpha1 * math.sqrt(alpha1)
        return F if self.layer is None else F * self.layer.factor(alpha1)

    def indentation(self, delta: Floats) -> Floats:
        """α₁ in m from δ = α₁ + α₃ in m, where α₃ = F/K_d at once (C_d = 0), its share of it (modes) or 0 (rigid).

        With u = √α₁ that is K u³/K_d + u² = δ, convex in u, so Newton from √δ comes down to the root.
        """
        delta = np.maximum(delta, 0.0)
        if math.isinf(self.K_d):
            return delta
        ratio = self.K_i * self.at_once
        u = np.sqrt(delta)
        for _ in range(60):
            step = (ratio * u**3 + u * u - delta) / np.maximum(3 * ratio * u * u + 2 * u, 1e-300)
            u = u - step
            if np.all(np.abs(step) <= 1e-15 * np.abs(u) + 1e-300):
                break
        return u * u

    def indentation_of(self, delta: float) -> float:
        """``indentation`` for one value, without numpy's overhead on scalars."""
        if delta <= 0 or math.isinf(self.K_d):
            return max(delta, 0.0)
        ratio, u = self.K_i * self.at_once, math.sqrt(delta)
        for _ in range(60):
            step = (ratio * u**3 + u * u - delta) / (3 * ratio * u * u + 2 * u)
            u -= step
            if abs(step) <= 1e-15 * u:
                break
        return u * u


@dataclass
class Piece:
    """A stretch of smooth motion within a contact: dense solution from ``start`` to ``end``, s from touch."""

    start: float
    end: float
    solution: Callable[[Any], Floats]
    failed_at: float


@dataclass
class Contact:
    """A solved contact; times in s from its own touch, displacements in m from the undeformed specimen."""

    law: Law
    v0: float
    x0: float
    alpha2_0: float
    pieces: list[Piece] = field(default_factory=list[Piece])
    end: float = 0.0
    t_failure: float | None = None
    v_failure: float | None = None
    x_failure: float | None = None
    rests: bool = False
    v_end: float = 0.0
    x_end: float = 0.0
    alpha2_end: float = 0.0
    alpha3_end: float = 0.0
    F_M: float = 0.0
    t_M: float = 0.0
    x_max: float = 0.0
    t_turn: float | None = None

    def force(self, t: Floats) -> Floats:
        """Contact force in N at the times ``t`` (n,), 0 outside the contact."""
        F = np.zeros_like(t)
        for piece in self.pieces:
            inside = (t >= piece.start) & (t < piece.end)
            if inside.any():
                F[inside] = _force(self.law, piece, t[inside])
        return F

    def position(self, t: Floats) -> Floats:
        """The dart's displacement in m at the times ``t`` (n,); that of the end after it."""
        x = np.full_like(t, self.x_end)
        for piece in self.pieces:
            inside = (t >= piece.start) & (t < piece.end)
            if inside.any():
                x[inside] = piece.solution(t[inside])[0]
        return x


def _force(law: Law, piece: Piece, t: Floats) -> Floats:
    y = piece.solution(t)
    delta = law.gap(y)
    alpha1 = np.maximum(delta, 0.0) if law.bends else law.indentation(delta)
    return law.spring(alpha1) * np.exp(-np.maximum(t - piece.failed_at, 0.0) / FAILURE_DECAY)


class _NotSettled(ArithmeticError):
    """The integrator makes no headway."""


def _equations(law: Law, failed_at: float, sense: float) -> Callable[[float, Floats], tuple[float, ...]]:
    m, K_d, C_d, flow = law.m, law.K_d, law.C_d, 1 / law.C_i
    drag = law.friction * sense
    bends = law.bends
    steps, most = count(), MOST_STEPS * (1 + len(law.modes))
    modes = [(m.M, 2 * law.damping * m.omega, m.omega**2) for m in law.modes]

    def equations(t: float, y: Floats) -> tuple[float, ...]:
        if next(steps) > most:
            raise _NotSettled(f"it is too stiff (C_d {C_d:g} kg/s, K_d {K_d:.3g} N/m)")
        v, alpha3 = y[1], y[3]
        left = 1.0 if t < failed_at else math.exp(-(t - failed_at) / FAILURE_DECAY)
        delta = float(law.gap(y))
        alpha1 = max(delta, 0.0) if bends else law.indentation_of(delta)
        F = left * law.spring_at(alpha1)
        bending = (F - left * K_d * alpha3) / C_d if bends else 0.0
        shaking: list[float] = []
        for (M, damping, stiff), q, rate in zip(modes, y[4::2], y[5::2], strict=True):
            shaking += [rate, F / M - damping * rate - stiff * q]
        return v, g - (F + drag) / m, F * flow, bending, *shaking

    return equations


def solve(law: Law, v0: float, x0: float = 0.0, alpha2: float = 0.0, alpha3: float = 0.0) -> Contact:
    """Integrate one contact from touch at displacement ``x0`` with speed ``v0`` (m/s, into the specimen).

    LSODA at a relative tolerance of 1e-11: the plate's damper makes the contact stiff (NUMERICS.md).

    Raises
    ------
    ArithmeticError
        The constants make a contact that cannot be integrated.
    """
    for tolerance in TOLERANCES[:-1]:
        with contextlib.suppress(_NotSettled):
            return _solve(law, v0, x0, alpha2, alpha3, tolerance)
    return _solve(law, v0, x0, alpha2, alpha3, TOLERANCES[-1])


def _solve(law: Law, v0: float, x0: float, alpha2: float, alpha3: float, tolerance: float) -> Contact:
    from scipy.integrate import solve_ivp  # half a second to load: not before the first drop

    contact = Contact(law, v0, x0, alpha2)
    n = len(law.modes)
    y, t, failed_at, sense = np.array([x0, v0, alpha2, alpha3, *[0.0] * (2 * n)]), 0.0, math.inf, 1.0
    scale = np.concatenate((SCALE, [1e-7, 1e-3] * n))

    def intact_force(y: Floats) -> float:
        delta = float(law.gap(y))
        return law.spring_at(max(delta, 0.0) if law.bends else law.indentation_of(delta))

    def parting(t: float, y: Floats) -> float:
        return float(y[0] - y[2]) + CLEAR if n else float(law.gap(y))

    def apart(t: float, y: Floats) -> float:
        return float(law.gap(y))

    def failing(t: float, y: Floats) -> float:
        return intact_force(y) - law.fail_N

    def turning(t: float, y: Floats) -> float:
        return float(y[1])

    # solve_ivp reads what an event does from attributes of the function.
    for event, direction, terminal in (
        (parting, -1.0, True), (failing, 1.0, True), (turning, -1.0, law.friction > 0), (apart, -1.0, False)
    ):  # fmt: skip
        setattr(event, "terminal", terminal)  # noqa: B010  a function type has no such attribute
        setattr(event, "direction", direction)  # noqa: B010  as above

    while True:
        setattr(turning, "direction", -sense)  # noqa: B010  as above
        whole = math.isinf(failed_at)
        events = [parting, turning, failing] if whole and math.isfinite(law.fail_N) else [parting, turning]
        events += [apart] if n else []
        end = LONGEST_CONTACT if whole else failed_at + 40 * FAILURE_DECAY
        with warnings.catch_warnings(action="ignore", category=UserWarning):
            run: Any = solve_ivp(
                _equations(law, failed_at, sense), (t, end), y, method="LSODA", rtol=tolerance, atol=tolerance * scale,
                first_step=1e-9, dense_output=True, events=events,
            )  # fmt: skip
        if run.status < 0:
            raise _NotSettled(str(run.message))
        contact.pieces.append(Piece(t, float(run.t[-1]), run.sol, failed_at))
        y, t = run.y[:, -1], float(run.t[-1])
        if len(run.t_events[1]) and contact.t_turn is None:
            contact.t_turn, contact.x_max = float(run.t_events[1][0]), float(run.y_events[1][0][0])
        if run.status == 1 and failing in events and len(run.t_events[2]):
            failed_at = t
            contact.t_failure, contact.v_failure, contact.x_failure = t, float(y[1]), float(y[0])
        elif run.status == 1 and len(run.t_events[0]):
            if n and len(run.t_events[-1]):  # the plate let go of the dart for good at the last time it did
                t, y = float(run.t_events[-1][-1]), run.y_events[-1][-1]
            break
        elif run.status == 1:
            F, y[1] = intact_force(y), 0.0
            if abs(F - law.m * g) <= law.friction:
                contact.rests = True
                break
            sense = 1.0 if law.m * g > F else -1.0
        else:
            contact.rests = whole
            break
    contact.end, (contact.x_end, contact.v_end, contact.alpha2_end, contact.alpha3_end) = t, map(float, y[:4])
    if contact.t_turn is None:
        contact.x_max = max(contact.x_end, x0)
    _peak(contact)
    return contact


def _peak(contact: Contact) -> None:
    """Set the maximum force and its time: where dF/dt = 0 on the dense solution, or the moment of failure."""
    from scipy.optimize import minimize_scalar

    if contact.t_failure is not None:
        contact.F_M, contact.t_M = contact.law.fail_N, contact.t_failure
        return
    t = np.linspace(0.0, contact.end, 2001)[1:-1]
    best = int(np.argmax(contact.force(t)))
    low, high = t[max(best - 1, 0)], t[min(best + 1, len(t) - 1)]

    def lacking(at: float) -> float:
        return -float(contact.force(np.array([at]))[0])

    peak: Any = minimize_scalar(lacking, bounds=(low, high), method="bounded", options={"xatol": 1e-12})
    contact.F_M, contact.t_M = -float(peak.fun), float(peak.x)
