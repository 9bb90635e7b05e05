"""The papers' numbers from their own constants: P1 Table 1 and P2's marks, as docs/models.md shows them.

.venv/bin/python bench/models.py
"""

from scipy.optimize import brentq

from analysis.contact_solver import solve
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


def main() -> None:
    """Print both."""
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
