"""Figures, each in one place: drawn for paper, readable in grey."""

from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from analysis.contact_solver import Solution
from analysis.fit import Fit
from analysis.fit_answer import curves
from analysis.fit_profile import CUT, elements_of, profile, profiled
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
        plain(axes)
    save(figure, path)


def save_fit(fit: Fit, path: Path | BinaryIO) -> None:
    """A record with its model and what is left, the loop, the elements apart, and the profiles of the parameters.

    Raises
    ------
    StoreError : the file cannot be written.
    """
    from matplotlib.figure import Figure  # half a second to load

    c = curves(fit)
    parts, t = elements_of(fit, POINTS)
    names = profiled(fit)
    figure = Figure(figsize=(10, 7.2), layout="constrained")
    rows: Any = figure.subfigures(2, 1, height_ratios=(3, 2.2))
    columns: Any = rows[0].subfigures(1, 2)
    time, left = columns[0].subplots(2, 1, height_ratios=(2, 1), sharex=True)
    loop, apart = columns[1].subplots(2, 1)
    time.plot(c["t"] * 1e3, c["force"], color="0.65", linewidth=0.8, label="record")
    time.plot(c["t"] * 1e3, c["model"], label=f"{fit.problem.kind} model", **STYLES[0])
    time.set(ylabel="Contact force (N)")
    time.legend(frameon=False)
    left.plot(c["t"] * 1e3, c["left"], color="0.3", linewidth=0.6)
    left.set(xlabel="Time from contact (ms)", ylabel="Left (N)")
    loop.plot(parts["alpha"] * 1e3, parts["F"], **STYLES[0])
    loop.set(xlabel="Displacement α (mm)", ylabel="Model force (N)", ylim=(0, None))
    labels = {"alpha": "α", "alpha_1": "α₁ contact", "alpha_2": "α₂ dashpot", "alpha_3": "α₃ plate"}
    for (key, label), style in zip(labels.items(), STYLES, strict=True):
        if float(np.abs(parts[key]).max()) > 0:
            apart.plot(t * 1e3, parts[key] * 1e3, label=label, **style)
    apart.set(xlabel="Time from contact (ms)", ylabel="Displacement (mm)")
    apart.legend(frameon=False, fontsize="small", loc="center right", bbox_to_anchor=(1.0, 0.55))
    apart.set_xlim(0, 1.5e3 * float(t[-1]))
    axes = rows[1].subplots(1, len(names), squeeze=False)[0]
    for each, name in zip(axes, names, strict=True):
        value, rise, unit = profile(fit, name)
        each.plot(value, rise, **STYLES[0])
        each.axhline(CUT, **STYLES[3])
        each.set(xlabel=f"{name} ({unit})", ylabel="Rise of χ²", ylim=(0, 9))
    for each in (time, loop, left, apart, *axes):
        plain(each)
    save(figure, path)


def plain(axes: Any) -> None:
    """Axes without a frame, with a faint grid."""
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="0.9", linewidth=0.6)


def save(figure: Any, to: Path | BinaryIO, form: str = "svg") -> None:
    """Write a figure; a path's suffix says what as, an open file takes ``form``.

    Raises
    ------
    StoreError : the file cannot be written.
    """
    try:
        figure.savefig(to, dpi=160, format=to.suffix[1:] if isinstance(to, Path) else form)
    except OSError as e:
        raise StoreError(f"{to} cannot be written: {e.strerror or e}") from None
