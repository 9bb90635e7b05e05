"""The models against scipy; the papers' numbers from their own constants: P1 Table 1, P2's marks. For docs/models.md.

.venv/bin/python bench/models.py
"""

import math
import sys
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "analysis"))

from test_models import CASES, papers_form

from analysis.contact_solver import solve
from analysis.fit_problem import kernel
from analysis.models import Model, contact_stiffness, plate_stiffness
from analysis.predict import predict

TIP = 6.35e-3
ROWS = (
    (1.39, 3.30, 8000, 10, 700, 1.28, 0.90),
    (1.95, 3.40, 4500, 10, 1045, 1.77, 0.80),
    (2.80, 3.42, 5000, 15, 1412, 2.61, 0.81),
)
MARKS = ((1.52, 0.214, 3.30), (1.60, 0.235, 3.45))


def value(model: Model, v0: float, symbol: str) -> float:
    """A finding of a predicted drop."""
    return float(predict(solve(model, v0), TIP).values[symbol].value or 0.0)


def against_scipy() -> None:
    """The largest error of F(t), in F_M, of kernel and of the plain solver against scipy at 1e-12, 0.5 to 4 m/s."""
    print("| model | kernel, of F_M | plain solver, of F_M |\n|---|---|---|")
    for name, model in CASES.items():
        worst = [0.0, 0.0]
        for v0 in (0.5, 2.0, 4.0):
            solution = solve(model, v0)
            t = np.linspace(0, 0.999 * solution.end, 300)
            expected, force = papers_form(model, v0, t), np.empty(t.size)
            q = 0.0 if math.isinf(model.K_d) else 1 / model.K_d
            constants = [model.mass, model.g, 0, model.K_i, model.flow, q, model.C_d * q, model.C, v0, 1, 0, 0, 0, 0]
            kernel().contact(np.array(constants, dtype=float), t, force, np.empty((0, 0)))
            for k, other in enumerate((force, solution.force(t))):
                worst[k] = max(worst[k], float(np.abs(other - expected).max() / expected.max()))
        print(f"| {name} | {worst[0]:.0e} | {worst[1]:.0e} |")
    print()


def main() -> None:
    """Print all."""
    against_scipy()
    print("| v0, m/s | F_M′ printed, N | found | α_M′ printed, mm | found | ε′ printed | found |")
    print("|---|---|---|---|---|---|---|")
    for v0, E, C_i, C_d, F_M, alpha_M, eps in ROWS:
        stiffness = contact_stiffness(TIP, E * 1e9, 0.30), plate_stiffness(4.6e-3, 30e-3, E * 1e9, 0.30)
        model = Model("flexed", 0.503, *stiffness, C_i, C_d)
        found = [value(model, v0, symbol) for symbol in ("F_M", "alpha_M", "eps_published")]
        print(f"| {v0:.2f} | {F_M} | {found[0]:.0f} | {alpha_M} | {found[1] * 1e3:.2f} | {eps:.2f} | {found[2]:.3f} |")
    print("\n| v0, m/s | α_r printed, mm | C that leaves it, kg/s | mark printed, mm | found |\n|---|---|---|---|---|")
    K_i = contact_stiffness(TIP, 2.3e9, 0.32)
    for v0, alpha_r, mark in MARKS:

        def lacks(C: float, v0: float = v0, alpha_r: float = alpha_r) -> float:
            return value(Model("series", 0.743, K_i, C_i=C), v0, "alpha_perm") - alpha_r * 1e-3

        C = float(brentq(lacks, 2000, 50_000))
        found_mark = value(Model("series", 0.743, K_i, C_i=C), v0, "mark_diameter") * 1e3
        print(f"| {v0:.2f} | {alpha_r} | {C:.0f} | {mark:.2f} | {found_mark:.3f} |")


if __name__ == "__main__":
    main()
