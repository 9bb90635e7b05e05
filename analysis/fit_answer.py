"""A fit as an answer: parameters with verdicts, budget, correlations, what was compared, and cautions in words."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from analysis.budget import Row, budget, total
from analysis.findings import Caution
from analysis.fit import Fit, NotFitted, fit_window
from analysis.fit_intervals import NOT, Parameter, parameters, spread
from analysis.fit_problem import DAMPER, FLOW, LEVEL, LN_E, T0, V0
from analysis.models import Kind
from analysis.record import Array

_MISFIT = 0.02
"""Of F_M: what a model may leave of a record, noise taken off, before its values are doubted."""
_PATTERN, _SMOOTH = 0.005, 3.0
"""The same where it is no noise: where what is left goes together so much that intervals are as many times wider."""
_UNMISTAKABLE = 10.0
"""Difference of Schwarz's criterion that settles which model it is (Kass and Raftery 1995: very strong)."""
BESIDE: dict[Kind, Kind] = {"series": "parallel", "parallel": "series"}
"""What a model on a rigid support is compared with."""


def to_json(fit: Fit) -> tuple[dict[str, Any], list[Caution]]:
    """The contract's ``fit`` object, and the cautions that go with it."""
    known, rows = parameters(fit), budget(fit)
    cautions = _cautions(fit, known)
    answer: dict[str, Any] = {
        "model": fit.problem.kind,
        "corrections": list(fit.problem.corrections),
        "parameters": {name: _parameter(name, p, rows) for name, p in known.items()},
        "budget": [_row(row) for row in rows],
        "residual_rms": float(np.sqrt(np.mean(fit.left[fit.problem.window.kept] ** 2))),
        "noise_widened": fit.widened,
        "correlations": _correlations(fit),
        "stopped": "converged" if fit.best.converged else "after the most steps",
        "alpha_perm": permanent(fit),
        "compared": _compared(fit),
    }
    return answer, cautions


def permanent(fit: Fit) -> dict[str, float | None] | None:
    """α_perm = J/C of the element in series, m, and its standard uncertainty; None without one."""
    if not fit.problem.free[FLOW]:
        return None
    J, c = _impulse(fit), float(fit.best.x[FLOW])
    u = float(np.sqrt(spread(fit)[FLOW, FLOW]))
    return {"value": J * c, "u": None if fit.best.at_bound[FLOW] else J * u}


def _impulse(fit: Fit) -> float:
    """J of the fitted contact as far as the record was seen, N·s."""
    w = fit.problem.window
    t = fit.best.x[T0] + (np.arange(4000) + 0.5) / 4000 * 2 * w.length
    return float(fit.problem.contact(fit.best.x, t)[t <= w.reach].sum()) * (2 * w.length / 4000)


def _parameter(name: str, p: Parameter, rows: list[Row]) -> dict[str, Any]:
    return {
        "value": p.value, "unit": p.unit, "u": p.u, "lo": p.lo, "hi": p.hi, "u_total": total(name, p.u, rows),
        "verdict": p.verdict,
    }  # fmt: skip


def _row(row: Row) -> dict[str, Any]:
    return {
        "input": row.name, "value": row.value, "unit": row.unit, "u": row.u, "given": row.u > 0,
        "sensitivity": row.sensitivity, "contribution": row.contribution,
    }  # fmt: skip


def _correlations(fit: Fit) -> dict[str, dict[str, float]]:
    """Between the fitted parameters; C_i by its reciprocal, as it is fitted."""
    kind = fit.problem.kind
    names = {
        LN_E: "E", FLOW: "C" if kind == "series" else "C_i", DAMPER: "C" if kind == "parallel" else "C_d", V0: "v0",
        T0: "t0", LEVEL: "baseline",
    }  # fmt: skip
    C = spread(fit)
    u = np.sqrt(np.diag(C))
    known = {i: name for i, name in names.items() if u[i] > 0}
    sign = {i: -1.0 if i == FLOW else 1.0 for i in known}
    return {
        a: {b: float(sign[i] * sign[j] * C[i, j] / (u[i] * u[j])) for j, b in known.items() if j != i}
        for i, a in known.items()
    }


def _compared(fit: Fit) -> dict[str, Any] | None:
    """The dashpot beside the spring against the one in series, by Schwarz's criterion; None for a plate."""
    problem = fit.problem
    other = BESIDE.get(problem.kind)
    if other is None:
        return None
    try:
        beside = fit_window(problem.window, problem.impact, other, problem.corrections)
    except NotFitted:
        return None
    bic = {problem.kind: fit.bic, other: beside.bic}
    gap = abs(bic[problem.kind] - bic[other])
    better = min(bic, key=lambda k: bic[k])
    return {
        "criterion": "BIC", "values": bic, "difference": gap,
        "preferred": better if gap > _UNMISTAKABLE else None,
    }  # fmt: skip


def _cautions(fit: Fit, known: dict[str, Parameter]) -> list[Caution]:
    w, found = fit.problem.window, list[Caution]()
    top = float(w.force.max())
    left = float(np.sqrt(np.mean(fit.left[w.kept] ** 2)))
    excess = math.sqrt(max(left**2 - w.noise**2, 0.0)) / top
    if excess > (_PATTERN if fit.widened > _SMOOTH else _MISFIT):
        text = (
            f"the {fit.problem.kind} model leaves {100 * excess:.1f} % of F_M beyond the noise (limit {100 * _MISFIT:g}"
            f" %, {100 * _PATTERN:g} % if it has a pattern): its values are those of the nearest curve, not of this "
            "specimen; look at the residuals for failure, slip or a support that is not as the test file has it"
        )
        found.append(Caution("model-misfit", text))
    if w.left_out is not None:
        found.append(Caution("fitted-in-part", f"{w.left_out}; the model is fitted to the rest"))
    if not w.whole:
        found.append(
            Caution("fitted-in-part", "the record ends within the contact; the model is fitted to what there is")
        )
    for name in ("E", "C", "C_i", "C_d"):
        if name in known and known[name].verdict == NOT:
            found.append(Caution("not-determined", f"{name} is not determined by this record"))
    return found


def curves(fit: Fit, points: int = 1000) -> dict[str, Array]:
    """For figures: t s from contact (n,), force and model N, ringing N, and what is left N, at the fitted points.

    What is left is NaN where a point was left out, the model where none follows that was fitted.
    """
    w, x = fit.problem.window, fit.best.x
    step = max(1, w.t.size // points)
    t = w.t[::step]
    ringing = fit.problem.ringing(x, t)
    model = np.where(t <= w.reach, fit.problem.contact(x, t), np.nan)
    left = np.where(w.kept[::step], w.force[::step] - x[LEVEL] - model - ringing, np.nan)
    return {"t": t - x[T0], "force": w.force[::step] - x[LEVEL], "model": model, "ringing": ringing, "left": left}
