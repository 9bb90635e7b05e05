"""A contact of a lumped model, from touch to parting, by Radau IIA of order 5.

The plate's damper makes the contact stiff (a time constant of a microsecond), its absence makes it algebraic, and the
3/2 power has no second derivative where contact begins and ends. Radau IIA takes the first two as they are (Hairer and
Wanner, Solving ODEs II, IV.5 and VI.1); the steps are graded for the third.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.models import Model

Array = NDArray[np.float64]

ROOT6 = math.sqrt(6)
NODES = np.array([(4 - ROOT6) / 10, (4 + ROOT6) / 10, 1.0])
A = np.array(
    [
        [(88 - 7 * ROOT6) / 360, (296 - 169 * ROOT6) / 1800, (-2 + 3 * ROOT6) / 225],
        [(296 + 169 * ROOT6) / 1800, (88 + 7 * ROOT6) / 360, (-2 - 3 * ROOT6) / 225],
        [(16 - ROOT6) / 36, (16 + ROOT6) / 36, 1 / 9],
    ]
)
"""Butcher's table of Radau IIA with three stages."""
LONGEST, FIRST = 10e-6, 0.02e-6
"""s, of a step."""
GRADE = 0.1
"""A step is at most this share of the time since touch, and of the time to parting at the present speed."""
LONGEST_CONTACT = 0.2
"""s; a dart that has not parted by then lies on the specimen."""
NEWTON, GOOD_ENOUGH, MOST_ITERATIONS = 1e-14, 1e-9, 30
"""Newton ends at the first; where rounding keeps it from there, the second will do."""
SCALE = np.array([1.0, 1e-3, 1e-3])
"""m/s, m, m: what is usual of the states."""
V, DELTA, ALPHA1 = 0, 1, 2


class NotSolved(ArithmeticError):
    """The constants make a contact that cannot be integrated."""


@dataclass(frozen=True)
class Solution:
    """A contact at its steps, dense between them. Times in s from first contact.

    t : (n,) ends of the steps; y : (n, 3) v, δ, α₁ there (parallel: v, α, α); stages : (n − 1, 3, 3) at the nodes
    end : s, parting; inf where the dart stays on the specimen
    """

    model: Model
    v0: float
    t: Array
    y: Array
    stages: Array
    end: float

    def states(self, at: Array) -> Array:
        """v, δ, α₁ at times (n,) within the contact (n, 3): the collocation polynomial, of order 4."""
        step = np.clip(np.searchsorted(self.t, at, side="right") - 1, 0, len(self.t) - 2)
        s = (at - self.t[step]) / (self.t[step + 1] - self.t[step])
        nodes = np.concatenate([[0.0], NODES])
        weights = np.ones((4, len(at)))
        for i in range(4):
            for j in range(4):
                if i != j:
                    weights[i] *= (s - nodes[j]) / (nodes[i] - nodes[j])
        values = np.concatenate([self.y[step][:, None, :], self.stages[step]], axis=1)
        return np.einsum("in,nik->nk", weights, values)

    def force(self, at: Array) -> Array:
        """Contact force in N at times (n,); 0 outside the contact."""
        F = np.zeros(len(at))
        inside = (at >= 0) & (at < min(self.end, self.t[-1]))
        y = self.states(at[inside])
        F[inside] = np.maximum(force_of(self.model, y[:, V], y[:, ALPHA1]), 0.0)
        return F

    def impulse(self, at: Array) -> Array:
        """∫F dt in N·s at times (n,) within the contact, from Newton's law: m·(v0 − v + g·t)."""
        return self.model.mass * (self.v0 - self.states(at)[:, V] + self.model.g * at)

    def displacement(self, at: Array) -> Array:
        """α in m at times (n,) within the contact."""
        return self.states(at)[:, DELTA] + self.model.flow * self.impulse(at)


def force_of(model: Model, v: Array, alpha1: Array) -> Array:
    """Contact force, N."""
    spring = model.K_i * np.maximum(alpha1, 0.0) ** 1.5
    return spring * (1 + model.chi * v) + model.C * v if model.kind == "parallel" else spring


def _right_side(model: Model) -> tuple[Array, Callable[[Array], Array], Callable[[Array], Array]]:
    """Mass matrix diagonal, f(Y) and df/dy(Y) for Y (k, 3)."""
    m, K, c, q, theta, g = model.mass, model.K_i, model.flow, model.bending, model.lag, model.g
    if model.kind == "parallel":

        def f_parallel(Y: Array) -> Array:
            F = force_of(model, Y[:, V], Y[:, ALPHA1])
            return np.stack([g - F / m, Y[:, V], Y[:, V]], axis=1)

        def jac_parallel(Y: Array) -> Array:
            J = np.zeros((len(Y), 3, 3))
            root = np.sqrt(np.maximum(Y[:, ALPHA1], 0.0))
            J[:, V, V] = -(model.C + model.chi * K * root**3) / m
            J[:, V, ALPHA1] = -1.5 * K * root * (1 + model.chi * Y[:, V]) / m
            J[:, DELTA, V] = J[:, ALPHA1, V] = 1.0
            return J

        return np.ones(3), f_parallel, jac_parallel

    def f(Y: Array) -> Array:
        v, delta, alpha1 = Y[:, V], Y[:, DELTA], Y[:, ALPHA1]
        F = K * np.maximum(alpha1, 0.0) ** 1.5
        return np.stack([g - F / m, v - c * F, theta * (v - c * F) + delta - alpha1 - q * F], axis=1)

    def jac(Y: Array) -> Array:
        F1 = 1.5 * K * np.sqrt(np.maximum(Y[:, ALPHA1], 0.0))
        J = np.zeros((len(Y), 3, 3))
        J[:, V, ALPHA1] = -F1 / m
        J[:, DELTA, V] = 1.0
        J[:, DELTA, ALPHA1] = -c * F1
        J[:, ALPHA1, V] = theta
        J[:, ALPHA1, DELTA] = 1.0
        J[:, ALPHA1, ALPHA1] = -theta * c * F1 - 1.0 - q * F1
        return J

    return np.array([1.0, 1.0, theta]), f, jac


class Stepper:
    """Steps of one model."""

    def __init__(self, model: Model) -> None:
        self._mass, self._f, self._jac = _right_side(model)

    def step(self, y: Array, h: float) -> Array:
        """Stages (3, 3) of a step of ``h`` s from ``y``; the last is its end.

        Raises
        ------
        NotSolved : Newton's iteration does not come to an end.
        """
        stages, size = np.tile(y, (3, 1)), math.inf
        M = np.kron(np.eye(3), np.diag(self._mass))
        for _ in range(MOST_ITERATIONS):
            residual = (stages - y) * self._mass - h * A @ self._f(stages)
            J = self._jac(stages)
            system = M - h * np.block([[A[i, j] * J[j] for j in range(3)] for i in range(3)])
            change = np.linalg.solve(system, residual.ravel()).reshape(3, 3)
            stages = stages - change
            size = float(np.abs(change / SCALE).max())
            if size < NEWTON * max(1.0, float(np.abs(stages / SCALE).max())):
                break
        if not size < GOOD_ENOUGH:
            raise NotSolved("the steps of this contact do not converge: look at stiffness and dampers")
        return stages


def solve(model: Model, v0: float) -> Solution:
    """The contact of a dart that touches with ``v0`` (m/s, into the specimen).

    Raises
    ------
    ValueError : v0 is not above 0.
    NotSolved : the constants make a contact that cannot be integrated.
    """
    if not 0 < v0 < math.inf:
        raise ValueError(f"v0 has to be above 0 m/s, and finite, not {v0:g}")
    stepper = Stepper(model)
    t, y = 0.0, np.array([v0, 0.0, 0.0])
    times, states, stages = [t], [y], list[Array]()
    end = math.inf
    while t < LONGEST_CONTACT:
        h = min(LONGEST, max(FIRST, GRADE * t))
        leaving = _leaving(model, y, states)
        if leaving is not None:
            h = min(h, max(FIRST, GRADE * leaving))
        nodes = stepper.step(y, h)
        if _gauge(model, nodes[2]) <= 0:
            h, nodes = _last_step(model, stepper, y, h, nodes)
            end = t + h
        stages.append(nodes)
        t, y = t + h, nodes[2]
        times.append(t)
        states.append(y)
        if end < math.inf:
            break
    return Solution(model, v0, np.array(times), np.array(states), np.array(stages), end)


def _gauge(model: Model, y: Array) -> float:
    """What is above 0 while they touch: α₁, or the force of the parallel model over its stiffness at this depth."""
    if model.kind != "parallel":
        return float(y[ALPHA1])
    return float(force_of(model, y[None, V], y[None, ALPHA1])[0])


def _leaving(model: Model, y: Array, before: list[Array]) -> float | None:
    """Seconds to parting at the rate of the last step, None while the force grows; the grading's other end."""
    if len(before) < 2 or y[V] > 0:
        return None
    depth, speed = float(y[ALPHA1]), -float(y[V])
    return depth / speed if depth > 0 and speed > 0 else None


def _last_step(model: Model, stepper: Stepper, y: Array, h: float, nodes: Array) -> tuple[float, Array]:
    """The step at whose end they part, by secant and bisection; ``nodes`` are those of a step ``h``, too long."""
    low, high = 0.0, h
    g_low, g_high = _gauge(model, y), _gauge(model, nodes[2])
    for k in range(200):
        share = g_low / (g_low - g_high) if k % 3 else 0.5
        middle = low + (high - low) * min(max(share, 0.01), 0.99)
        nodes = stepper.step(y, middle)
        gauge = _gauge(model, nodes[2])
        if gauge > 0:
            low, g_low = middle, gauge
        else:
            high, g_high = middle, gauge
        if high - low < 1e-15:
            break
    return 0.5 * (low + high), nodes
