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
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Any

import numpy as np

from sim_device.law import GIVES_WAY, SLIPS, Floats, Law
from sim_device.settings import g

LONGEST_CONTACT = 0.1
"""s; a dart that has not left by then lies on the specimen."""
TOLERANCES = (1e-11, 1e-9, 1e-7)
"""Relative, the next for a contact that the one before cannot settle: one so stiff that rounding is in the way."""
SCALE = np.array([1e-6, 1e-3, 1e-7, 1e-7])
"""m, m/s, m, m: of the state, times the tolerance, for the absolute one."""
MOST_STEPS = 40_000
"""Evaluations of the equations, some twenty times what a contact takes, and as many again for each mode of a plate."""
CLEAR = 50e-6
"""m above where a plate with mass rests: a dart that is as high has left, and is not hit again by the plate."""


@dataclass(frozen=True)
class Damage:
    """When the specimen failed, cracked and slipped, s from touch; inf: it has not."""

    failed_at: float = math.inf
    cracked_at: float = math.inf
    slipped_at: float = math.inf

    def left(self, law: Law, t: float) -> float:
        """What is left of the stiffness at ``t``, of 1."""
        part = 1.0
        if t > self.cracked_at:
            part += law.crack_loss * math.expm1(-(t - self.cracked_at) / GIVES_WAY)
        return part if t < self.failed_at else part * math.exp(-(t - self.failed_at) / GIVES_WAY)

    def slipping(self, law: Law, t: float) -> float:
        """m/s, at which the specimen gives way at ``t``."""
        return law.slip / SLIPS * math.exp(-(t - self.slipped_at) / SLIPS) if t > self.slipped_at else 0.0


@dataclass
class Piece:
    """A stretch of smooth motion within a contact: dense solution from ``start`` to ``end``, s from touch."""

    start: float
    end: float
    solution: Callable[[Any], Floats]
    damage: Damage


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
    t_crack: float | None = None
    x_crack: float | None = None
    t_slip: float | None = None
    rests: bool = False
    v_end: float = 0.0
    x_end: float = 0.0
    alpha2_end: float = 0.0
    alpha3_end: float = 0.0
    F_M: float = 0.0
    t_M: float = 0.0
    x_max: float = 0.0
    t_turn: float | None = None

    @property
    def law_after(self) -> Law:
        """The law of the next hit."""
        return self.law.after(cracked=self.t_crack is not None, slipped=self.t_slip is not None)

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
    left = np.array([piece.damage.left(law, float(each)) for each in t]) if piece.damage != Damage() else 1.0
    return law.spring(alpha1) * left


class _NotSettled(ArithmeticError):
    """The integrator makes no headway."""


def _equations(law: Law, damage: Damage, sense: float) -> Callable[[float, Floats], tuple[float, ...]]:
    m, K_d, C_d, flow = law.m, law.K_d, law.C_d, 1 / law.C_i
    drag = law.friction * sense
    bends = law.bends
    steps, most = count(), MOST_STEPS * (1 + len(law.modes))
    modes = [(m.M, 2 * law.damping * m.omega, m.omega**2) for m in law.modes]

    def equations(t: float, y: Floats) -> tuple[float, ...]:
        if next(steps) > most:
            raise _NotSettled(f"it is too stiff (C_d {C_d:g} kg/s, K_d {K_d:.3g} N/m)")
        v, alpha3 = y[1], y[3]
        left = damage.left(law, t)
        delta = float(law.gap(y))
        alpha1 = max(delta, 0.0) if bends else law.indentation_of(delta)
        F = left * law.spring_at(alpha1)
        bending = (F - left * K_d * alpha3) / C_d if bends else 0.0
        shaking: list[float] = []
        for (M, damping, stiff), q, rate in zip(modes, y[4::2], y[5::2], strict=True):
            shaking += [rate, F / M - damping * rate - stiff * q]
        return v, g - (F + drag) / m, F * flow + damage.slipping(law, t), bending, *shaking

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
    y, t, damage, sense = np.array([x0, v0, alpha2, alpha3, *[0.0] * (2 * n)]), 0.0, Damage(), 1.0
    scale = np.concatenate((SCALE, [1e-7, 1e-3] * n))

    def force(t: float, y: Floats) -> float:
        delta = float(law.gap(y))
        return damage.left(law, t) * law.spring_at(max(delta, 0.0) if law.bends else law.indentation_of(delta))

    def parting(t: float, y: Floats) -> float:
        return float(y[0] - y[2]) + CLEAR if n else float(law.gap(y))

    def apart(t: float, y: Floats) -> float:
        return float(law.gap(y))

    def turning(t: float, y: Floats) -> float:
        return float(y[1])

    def failing(t: float, y: Floats) -> float:
        return force(t, y) - law.fail_N

    def cracking(t: float, y: Floats) -> float:
        return force(t, y) - law.crack_N

    def slipping(t: float, y: Floats) -> float:
        return force(t, y) - law.slip_N

    # solve_ivp reads what an event does from attributes of the function.
    for event, direction, terminal in (
        (parting, -1.0, True), (turning, -1.0, law.friction > 0), (apart, -1.0, False),
        (failing, 1.0, True), (cracking, 1.0, True), (slipping, 1.0, True),
    ):  # fmt: skip
        setattr(event, "terminal", terminal)  # noqa: B010  a function type has no such attribute
        setattr(event, "direction", direction)  # noqa: B010  as above

    while True:
        setattr(turning, "direction", -sense)  # noqa: B010  as above
        whole = math.isinf(damage.failed_at)
        events = [parting, turning]
        for event, load, done_at in (
            (failing, law.fail_N, damage.failed_at), (cracking, law.crack_N, damage.cracked_at),
            (slipping, law.slip_N, damage.slipped_at),
        ):  # fmt: skip
            events += [event] if whole and math.isinf(done_at) and math.isfinite(load) else []
        events += [apart] if n else []
        end = LONGEST_CONTACT if whole else damage.failed_at + 40 * GIVES_WAY
        with warnings.catch_warnings(action="ignore", category=UserWarning):
            run: Any = solve_ivp(
                _equations(law, damage, sense), (t, end), y, method="LSODA", rtol=tolerance, atol=tolerance * scale,
                first_step=1e-9, dense_output=True, events=events,
            )  # fmt: skip
        if run.status < 0:
            raise _NotSettled(str(run.message))
        met = {event for event, times in zip(events, run.t_events, strict=True) if len(times)}
        contact.pieces.append(Piece(t, float(run.t[-1]), run.sol, damage))
        y, t = run.y[:, -1], float(run.t[-1])
        if turning in met and contact.t_turn is None:
            contact.t_turn, contact.x_max = float(run.t_events[1][0]), float(run.y_events[1][0][0])
        if run.status == 1 and failing in met:
            damage = replace(damage, failed_at=t)
            contact.t_failure, contact.v_failure, contact.x_failure = t, float(y[1]), float(y[0])
        elif run.status == 1 and cracking in met:
            damage = replace(damage, cracked_at=t)
            contact.t_crack, contact.x_crack = t, float(y[0])
        elif run.status == 1 and slipping in met:
            damage = replace(damage, slipped_at=t)
            contact.t_slip = t
        elif run.status == 1 and parting in met:
            if apart in met:  # the plate let go of the dart for good at the last time it did
                t, y = float(run.t_events[-1][-1]), run.y_events[-1][-1]
            break
        elif run.status == 1:
            F, y[1] = force(t, y), 0.0
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
