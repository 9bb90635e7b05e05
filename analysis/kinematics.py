"""Speed, displacement and energy of the dart from the contact force, P1 (2) and P2 (1), (2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.record import Array


@dataclass(frozen=True)
class Kinematics:
    """The contact, from its onset to its end; arrays of one length (n,).

    t : s, from first contact; force : N, corrected for baseline, droop and tip mass
    v : m/s, alpha : m, energy : J = ∫F·v dt; NaN where v0 is not known
    """

    t: Array
    force: Array
    v: Array
    alpha: Array
    energy: Array

    @property
    def impulse(self) -> float:
        """J = ∫₀^tc F dt, N·s."""
        return float(np.trapezoid(self.force, self.t))


def running(values: Array, t: Array) -> Array:
    """∫₀^t values dt by the trapezoid rule, (n,)."""
    total = np.empty_like(values)
    total[0] = 0.0
    np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(t), out=total[1:])
    return total


def integrate(t: Array, force: Array, start: float, end: float, mass: float, v0: float, g: float) -> Kinematics:
    """Kinematics between `start` and `end`, s on the axis of `t`, where the force is 0 by definition.

    t, force : (n,) s and N; mass : kg; v0 : m/s (NaN: not known); g : m/s²
    `v = v0 + g·t − (1/m)∫F dt`, `α = ∫v dt`, `E = ∫F·v dt`
    """
    inside = (t > start) & (t < end)
    time = np.concatenate(([0.0], t[inside] - start, [end - start]))
    pushed = np.concatenate(([0.0], force[inside], [0.0]))
    _, v, alpha, energy = passed(time, pushed, mass, v0, g)
    return Kinematics(time, pushed, v, alpha, energy)


def passed(t: Array, force: Array, mass: float, v0: float, g: float) -> Array:
    """J, v, α and E (4, n) along a force (n,) N at times (n,) s, from 0, v0, 0, 0, by the trapezoid rule."""
    from analysis.kernel import path  # compiled: not before it is wanted

    out = np.empty((4, t.size))
    path(t, force, mass, v0, g, *out)
    return out


def empty() -> Kinematics:
    """Kinematics of a record without a contact: arrays of length 0."""
    none = np.empty(0)
    return Kinematics(none, none, none, none, none)
