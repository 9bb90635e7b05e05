"""What a model says of a drop: the findings of a predicted contact, exact for the model."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize_scalar

from analysis.contact_solver import Array, Solution, V
from analysis.findings import Answer, Findings

POINTS = 4001


def predict(solution: Solution, tip_radius: float) -> Findings:
    """Findings of a predicted contact of a tip of radius ``tip_radius`` (m).

    Definitions as of a record (PHYSICS.md, From the force record); energies by Newton's law:
    E = ½m(v0² − v²) + m·g·α. α_perm = J/C_i is what the dashpot in series keeps (P2), the mark 2√(2·r·α_perm).
    """
    model, answer = solution.model, Answer()
    last = min(solution.end, float(solution.t[-1]))
    answer.set("v0", solution.v0)
    F_M, t_M = _greatest(solution.force, last)
    answer.set("F_M", F_M)
    answer.set("t_M", t_M)
    answer.set("alpha_M", _greatest(solution.displacement, last)[0])
    answer.set("l_M", _at(solution.displacement, t_M))
    answer.set("E_M", _energy(solution, t_M))
    if math.isinf(solution.end):
        answer.warn("no-rebound", "the dart does not leave the specimen: there is no end of contact and no restitution")
        return answer.done()
    t_c = solution.end
    v1 = -float(solution.y[-1, V])
    J = model.mass * (solution.v0 + v1 + model.g * t_c)
    answer.set("t_c", t_c)
    answer.set("J", J)
    answer.set("v1", v1)
    answer.set("eps_published", J / (model.mass * solution.v0) - 1)
    answer.set("eps_exact", v1 / solution.v0)
    answer.set("E_diss", _energy(solution, t_c))
    answer.set("alpha_r", _at(solution.displacement, t_c))
    if model.kind in ("series", "flexed"):
        permanent = J * model.flow
        answer.set("alpha_perm", permanent)
        answer.set("mark_diameter", 2 * math.sqrt(2 * tip_radius * permanent))
    return answer.done()


def elements(solution: Solution, at: Array) -> dict[str, Array]:
    """α₁, α₂, α₃ in m at times (n,) within the contact, and the force through them in N (P2, Fig. 7)."""
    y = solution.states(at)
    return {
        "F": solution.force(at),
        "alpha_1": y[:, 2],
        "alpha_2": solution.model.flow * solution.impulse(at),
        "alpha_3": y[:, 1] - y[:, 2],
    }


def _at(function: Callable[[Array], Array], t: float) -> float:
    return float(function(np.array([t]))[0])


def _energy(solution: Solution, t: float) -> float:
    model = solution.model
    v = float(solution.states(np.array([t]))[0, V])
    return 0.5 * model.mass * (solution.v0**2 - v**2) + model.mass * model.g * _at(solution.displacement, t)


def _greatest(function: Callable[[Array], Array], last: float) -> tuple[float, float]:
    """Greatest value over 0 to ``last`` and its time."""
    t = np.linspace(0.0, last, POINTS)
    best = int(np.argmax(function(t)))
    low, high = t[max(best - 1, 0)], t[min(best + 1, POINTS - 1)]

    def lacking(at: float) -> float:
        return -_at(function, at)

    found = minimize_scalar(lacking, bounds=(low, high), method="bounded", options={"xatol": 1e-12})
    refined, on_grid = float(found.x), float(t[best])
    return max((_at(function, refined), refined), (_at(function, on_grid), on_grid))
