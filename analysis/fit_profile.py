"""Profiles of a fit's parameters, and its elements apart, for figures."""

from __future__ import annotations

import math

import numpy as np

from analysis.fit import Fit
from analysis.fit_intervals import LEVEL_95, interval, spread
from analysis.fit_problem import DAMPER, FLOW, LN_E, T0
from analysis.kinematics import running
from analysis.levenberg import minimise
from analysis.record import Array

CUT = LEVEL_95**2
"""Rise of χ² at the ends of the 95 % interval."""
_POINTS, _REACH = 15, 3.0
"""Of a profile: its points, and how many standard errors it goes out to."""


def profiled(fit: Fit) -> dict[str, int]:
    """The model's parameters by name, and where they stand in x."""
    kind, free = fit.problem.kind, fit.problem.free
    found = {"E": LN_E}
    if free[FLOW]:
        found["C" if kind == "series" else "C_i"] = FLOW
    if free[DAMPER]:
        found["C" if kind == "parallel" else "C_d"] = DAMPER
    return found


def profile(fit: Fit, name: str) -> tuple[Array, Array, str]:
    """Values of a parameter (n,), the rise of χ² with all others fitted (n,), and the unit (GPa, Mg/s or kg/s)."""
    at = profiled(fit)[name]
    problem, best = fit.problem, fit.best
    free, (low, high) = problem.free.copy(), problem.bounds()
    u = math.sqrt(spread(fit)[at, at]) if at == LN_E else interval(fit, at)[0]
    free[at] = False
    values = float(best.x[at]) + np.linspace(-_REACH, _REACH, _POINTS) * u
    values = values[values > 0] if at != LN_E else values
    rise: list[float] = []
    x = best.x
    for value in values:
        start = x.copy()
        start[at] = value
        found = minimise(problem.residuals, start, free, low, high)
        x = found.x
        rise.append(found.chi2 - best.chi2)
    if at == LN_E:
        return np.exp(values) * 1e-9, np.array(rise), "GPa"
    if at == FLOW:
        return 1e-3 / values, np.array(rise), "Mg/s"
    return values, np.array(rise), "kg/s"


def elements_of(fit: Fit, points: int) -> tuple[dict[str, Array], Array]:
    """F, α, α₁, α₂, α₃ of the fitted contact, N and m, and the times from touch, s, each (points,)."""
    problem, x = fit.problem, fit.best.x
    constants = problem.constants(x)
    m, g, c, v0 = (float(constants[k]) for k in (0, 1, 4, 8))
    t = np.linspace(0, 2 * problem.window.length, 8 * points)
    F = problem.contact(x, t + x[T0])
    J = running(F, t)
    alpha = running(v0 + g * t - J / m, t)
    alpha_1 = alpha
    if problem.kind != "parallel":
        deepest = np.linspace(0, 1.05 * float(alpha.max()), 8 * points)
        alpha_1 = np.interp(F, spring_of(constants, deepest), deepest)
    parts = {"F": F, "alpha": alpha, "alpha_1": alpha_1, "alpha_2": c * J, "alpha_3": alpha - alpha_1 - c * J}
    if problem.kind != "flexed":
        parts["alpha_3"] = np.zeros(t.size)
    some = np.linspace(0, int(np.flatnonzero((F > 0) & (t + x[T0] <= problem.window.reach))[-1]), points).astype(int)
    return {key: values[some] for key, values in parts.items()}, t[some]


def spring_of(constants: Array, alpha: Array) -> Array:
    """F in N at α₁ (n,), m: K_i·α^1.5, and what the base under a layer adds."""
    u = np.sqrt(alpha)
    return constants[3] * alpha**1.5 * (1 + sum(k * u**n for n, k in enumerate(constants[10:], 1)))
