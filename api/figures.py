"""Figures, each in one place: drawn for paper, readable in grey."""

from pathlib import Path
from typing import Any

import numpy as np

from analysis.contact_solver import Solution
from analysis.predict import elements
from daq.errors import StoreError

POINTS = 1200
STYLES: tuple[dict[str, Any], ...] = (
    {"color": "0.0", "linestyle": "-"},
    {"color": "0.25", "linestyle": "--"},
    {"color": "0.4", "linestyle": "-."},
    {"color": "0.55", "linestyle": ":"},
)


def save_model(solution: Solution, path: Path) -> None:
    """Force over time, force over displacement, and the elements of a predicted contact, as PNG or SVG.

    Raises
    ------
    StoreError : the file cannot be written.
    """
    from matplotlib.figure import Figure  # half a second to load

    last = min(solution.end, float(solution.t[-1]))
    t = np.linspace(0, last, POINTS)[:-1]
    F, alpha, parts = solution.force(t), solution.displacement(t) * 1e3, elements(solution, t)
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    time, loop, apart = figure.subplots(1, 3)
    time.plot(t * 1e3, F, **STYLES[0])
    time.set(xlabel="Time from contact (ms)", ylabel="Contact force (N)", ylim=(0, None))
    loop.plot(alpha, F, **STYLES[0])
    loop.set(xlabel="Displacement α (mm)", ylabel="Contact force (N)", ylim=(0, None))
    names = {"alpha_1": "α₁ contact", "alpha_2": "α₂ dashpot", "alpha_3": "α₃ plate"}
    apart.plot(t * 1e3, alpha, label="α", **STYLES[0])
    for (key, name), style in zip(names.items(), STYLES[1:], strict=True):
        if float(np.abs(parts[key]).max()) > 0:
            apart.plot(t * 1e3, parts[key] * 1e3, label=name, **style)
    apart.set(xlabel="Time from contact (ms)", ylabel="Displacement (mm)")
    apart.legend(frameon=False)
    for axes in (time, loop, apart):
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="0.9", linewidth=0.6)
    try:
        figure.savefig(path, dpi=160)
    except OSError as e:
        raise StoreError(f"{path} cannot be written: {e.strerror or e}") from None
