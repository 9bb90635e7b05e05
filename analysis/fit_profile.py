"""Profiles of a fit's parameters, and its elements apart, for figures."""

from __future__ import annotations

import math

import numpy as np

from analysis.contact_solver import solve
from analysis.fit import Fit
from analysis.fit_intervals import LEVEL_95, interval, spread
from analysis.fit_problem import DAMPER, FLOW, LN_E
from analysis.levenberg import minimise
from analysis.models import Model
from analysis.predict import elements
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
    """F, α, α₁, α₂, α₃ of the fitted contact, N and m, and the times from touch, s, each (points − 1,)."""
    m, g, _, K, c, q, lag, beside, v0, _ = (float(v) for v in fit.problem.constants(fit.best.x))
    bent = math.inf if q == 0 else 1 / q
    C_d = 0.0 if q == 0 else lag / q
    solution = solve(Model(fit.problem.kind, m, K, bent, 1 / c if c > 0 else math.inf, C_d, beside, g), v0)
    t = np.linspace(0, min(solution.end, float(solution.t[-1])), points)[:-1]
    return {**elements(solution, t), "alpha": solution.displacement(t)}, t
