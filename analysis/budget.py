"""The uncertainty budget of a fit: what each known input that is not fitted puts into each parameter (GUM, 5.1).

An input off by δ moves the best point by −N⁻¹·Jᵀ·∂r/∂input·δ: the first step of a new fit, with every nuisance free to
take it up.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.conditions import Impact
from analysis.fit import Fit
from analysis.fit_intervals import spread
from analysis.fit_problem import DAMPER, FLOW, LN_E, Problem
from analysis.record import Array

_SHIFT = 1e-4
"""Relative, of an input, for its sensitivity."""


@dataclass(frozen=True)
class Row:
    """An input: its value and standard uncertainty u in ``unit`` (0: none was given), and by parameter what it puts in.

    sensitivity : relative change of the parameter (of C_i, C_d: in its unit) per relative change of the input
    """

    name: str
    value: float
    unit: str
    u: float
    sensitivity: dict[str, float]
    contribution: dict[str, float]


INPUTS = {"mass": "kg", "tip_radius": "m", "nu": "1"}
OF_A_PLATE = {"thickness": "m", "support_radius": "m"}
"""Inputs of the model, by their names in `Impact`, and their units."""


def budget(fit: Fit) -> list[Row]:
    """A row an input: mass, tip mass, gain of the force, tip radius, ν, and of a plate its thickness and its ring."""
    problem, impact = fit.problem, fit.problem.impact
    w, x = problem.window, fit.best.x
    gain_of = spread(fit) @ fit.best.J
    rows: list[Row] = []
    base = problem.residuals(x)[0]
    for name, unit in {**INPUTS, **(OF_A_PLATE if problem.kind == "flexed" else {})}.items():
        value, u = float(getattr(impact, name)), float(getattr(impact, f"u_{name}"))
        shift = _SHIFT * (value or 1.0)
        other = replace(problem, impact=replace(impact, **{name: value + shift}))
        if name == "mass":  # the tip's share of the sensor's reading goes with it
            other = replace(other, window=replace(w, force=w.force * _tip(other.impact) / _tip(impact)))
        rows.append(_row(fit, name, value, unit, u, -gain_of @ (other.residuals(x)[0] - base) / shift))
    scaled = replace(problem, window=replace(w, force=w.force * (1 + _SHIFT)))
    by_gain = -gain_of @ (scaled.residuals(x)[0] - base) / _SHIFT
    rows.append(_row(fit, "gain", 1.0, "1", impact.u_gain, by_gain))
    more = impact.mass / (impact.mass - impact.tip_mass)
    by_tip = by_gain * more / impact.mass  # F·m/(m − m_tip), by m_tip
    rows.append(_row(fit, "tip_mass", impact.tip_mass, "kg", impact.u_tip_mass, by_tip))
    by_v0 = -gain_of @ _v0_row(problem, base) if w.v0.u > 0 else np.zeros(x.size)
    rows.append(_row(fit, "v0", w.v0.value, "m/s", w.v0.u, by_v0))
    return rows


def _tip(impact: Impact) -> float:
    return impact.mass / (impact.mass - impact.tip_mass)


def _v0_row(problem: Problem, base: Array) -> Array:
    row = np.zeros(base.size)
    row[problem.window.t.size] = -1 / problem.window.v0.u
    return row


def _row(fit: Fit, name: str, value: float, unit: str, u: float, slopes: Array) -> Row:
    """``slopes`` (p,): change of x by the input."""
    sensitivity: dict[str, float] = {}
    contribution: dict[str, float] = {}
    for parameter, slope in in_units(fit, slopes).items():
        of = {"E": float(np.exp(fit.best.x[LN_E]))}.get(parameter)
        sensitivity[parameter] = slope * (value or 1.0) / of if of else slope * (value or 1.0)
        contribution[parameter] = abs(slope) * u
    return Row(name, value, unit, u, sensitivity, contribution)


def in_units(fit: Fit, slopes: Array) -> dict[str, float]:
    """Small changes of x (p,) as changes of the model's parameters, in their units; without dampers at a bound."""
    x, problem = fit.best.x, fit.problem
    found = {"E": float(np.exp(x[LN_E]) * slopes[LN_E])}
    if problem.free[FLOW] and x[FLOW] > 0:
        found["C" if problem.kind == "series" else "C_i"] = float(-slopes[FLOW] / x[FLOW] ** 2)
    if problem.free[DAMPER] and not fit.best.at_bound[DAMPER]:
        found["C" if problem.kind == "parallel" else "C_d"] = float(slopes[DAMPER])
    return found


def total(name: str, u: float | None, rows: list[Row]) -> float | None:
    """u_total of a parameter: its ``u``, of the record and v0, with what the other inputs put in."""
    if u is None:
        return None
    return float(np.hypot(u, np.sqrt(sum(r.contribution.get(name, 0.0) ** 2 for r in rows if r.name != "v0"))))
