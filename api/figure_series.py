"""Figures of a series, each defined here once: page, report and command draw them from the same place.

For paper and readable in grey: groups differ by the shape of their marks, specimens that failed are hollow.
"""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from matplotlib.figure import Figure

from analysis.fit import NotFitted
from analysis.fit_answer import curves
from api.answer import kinematics_of
from api.drop import Drop
from api.figures import STYLES, plain, save
from api.groups import groups_of
from daq.errors import StoreError

MARKS = "os^Dv<>P*X"
GREYS = ("0.1", "0.4", "0.6", "0.25", "0.5")
MOST_CURVES = 12
"""Drops whose curves share axes, spread evenly over v0."""
KG_S, GPA, MM, MS = 1.0, 1e-9, 1e3, 1e3


def draw(name: str, drops: list[Drop], series: dict[str, Any], to: BinaryIO | Path, form: str = "svg") -> None:
    """Draw one of `FIGURES` as SVG or PNG.

    Raises
    ------
    KeyError : no figure of that name.
    StoreError : the file cannot be written.
    """
    save(FIGURES[name][1](drops, series), to, form)


def draw_all(drops: list[Drop], series: dict[str, Any], folder: Path) -> None:
    """Every figure as SVG and PNG into a folder.

    Raises
    ------
    StoreError : it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as e:
        raise StoreError(f"{folder} cannot be made: {e.strerror or e}") from None
    for name in FIGURES:
        for form in ("svg", "png"):
            draw(name, drops, series, folder / f"{name}.{form}", form)


def _scatter(axes: Any, drops: list[Drop], key: str, factor: float, label: str, over: str = "v0") -> None:
    """A quantity against v0, a mark for each group, with standard uncertainties; hollow where the specimen failed."""
    rows, members = groups_of(drops)
    for k, (row, some) in enumerate(zip(rows, members, strict=True)):
        for failed in (False, True):
            points = [p for d in some if (d.failed is True) is failed and (p := _point(d, key)) is not None]
            if not points:
                continue
            v0, u_v0, y, u = (np.array(part) for part in zip(*points, strict=True))
            colour = GREYS[k % len(GREYS)]
            axes.errorbar(
                v0, y * factor, u * factor, u_v0, fmt=MARKS[k % len(MARKS)], color=colour, markersize=5.5,
                markerfacecolor="white" if failed else colour, elinewidth=0.8,
                label=f"{row['name']}{', failed' if failed else ''}",
            )  # fmt: skip
    axes.set(xlabel=signs("Impact speed v_0 (m/s)"), ylabel=signs(label))
    plain(axes)


def _point(drop: Drop, key: str) -> tuple[float, float, float, float] | None:
    """v0, its u, the value and its u; None where one is unknown."""
    y, v0 = drop.load_lasts if key == "load_lasts" else drop.value(key), drop.value("v0")
    if y is None or v0 is None:
        return None
    found = drop.answer["findings"].get("t_c" if key == "load_lasts" else key)
    u = found["u"] if found is not None else drop.answer["fit"]["parameters"][key]["u_total"]
    return v0, drop.answer["findings"]["v0"]["u"] or 0.0, y, u or 0.0


def _limit(axes: Any, series: dict[str, Any]) -> None:
    limit = series["v0_fail"]
    if limit is not None and len({run["material"] for run in series["runs"]}) == 1:
        axes.axvline(limit["value"], **STYLES[1])
        axes.axvspan(limit["lo"], limit["hi"], color="0.9", zorder=0, label=signs("v_0fail, 95 %"))


def _legend(axes: Any) -> None:
    if len(axes.get_legend_handles_labels()[0]) > 1:
        axes.legend(frameon=False, fontsize="small")


def signs(label: str) -> str:
    """A label with its subscripts set as such."""
    return re.sub(r"(\w)_(\w+)", r"$\1_{\\mathrm{\2}}$", label)


def _failure(drops: list[Drop], series: dict[str, Any]) -> Figure:
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    force, time = figure.subplots(1, 2)
    _scatter(force, drops, "F_M", 1.0, "Maximum force F_M (N)")
    _scatter(time, drops, "load_lasts", MS, "Load lasts (ms): t_c, or to failure")
    for axes in (force, time):
        _limit(axes, series)
    _legend(force)
    return figure


def _restitution(drops: list[Drop], series: dict[str, Any]) -> Figure:
    del series
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    eps, energy = figure.subplots(1, 2)
    _scatter(eps, drops, "eps_exact", 1.0, "Restitution ε")
    _scatter(energy, drops, "E_diss", 1.0, "Dissipated energy (J)")
    _legend(eps)
    return figure


def _modulus(drops: list[Drop], series: dict[str, Any]) -> Figure:
    del series
    dampers = [c for c in ("C_i", "C_d", "C") if any(d.value(c) is not None for d in drops)][:2]
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    axes = figure.subplots(1, 1 + len(dampers), squeeze=False)[0]
    _scatter(axes[0], drops, "E", GPA, "Elastic modulus E (GPa)")
    for each, name in zip(axes[1:], dampers, strict=True):
        _scatter(each, drops, name, KG_S, f"Damper {name} (kg/s)")
    _legend(axes[0])
    return figure


def _displacement(drops: list[Drop], series: dict[str, Any]) -> Figure:
    del series
    figure = Figure(figsize=(10, 3.6), layout="constrained")
    deepest, left = figure.subplots(1, 2)
    _scatter(deepest, drops, "alpha_M", MM, "Maximum displacement α_M (mm)")
    _scatter(left, drops, "alpha_r", MM, "Left at the end of contact α_r (mm)")
    _legend(deepest)
    return figure


def _curves(drops: list[Drop], series: dict[str, Any]) -> Figure:
    """F(t) with the model, and F–α, of drops over the range of v0."""
    del series
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    time, loop = figure.subplots(1, 2)
    told = sorted((d for d in drops if d.value("v0")), key=lambda d: d.value("v0") or 0.0)
    some = [told[round(k)] for k in np.linspace(0, len(told) - 1, min(len(told), MOST_CURVES))] if told else []
    modelled = False
    for k, drop in enumerate(some):
        motion = kinematics_of(drop.run)
        if motion.t.size == 0:
            continue
        grey = f"{0.15 + 0.55 * k / max(len(some) - 1, 1):.2f}"
        dash = "--" if drop.failed else "-"
        thin = slice(None, None, max(1, motion.t.size // 1500))
        label = f"{drop.value('v0'):.2f} m/s{', failed' if drop.failed else ''}"
        time.plot(motion.t[thin] * MS, motion.force[thin], dash, color=grey, linewidth=0.8, label=label)
        loop.plot(motion.alpha[thin] * MM, motion.force[thin], dash, color=grey, linewidth=0.8)
        if drop.failed:
            loop.plot(
                [MM * (drop.value("alpha_failure") or np.nan)],
                [drop.value("F_failure") or np.nan],
                "o",
                mfc="white",
                color=grey,
            )
        else:
            modelled |= _model(time, drop)
    time.set(xlabel="Time from contact (ms)", ylabel="Contact force (N)")
    loop.set(xlabel="Displacement α (mm)", ylabel="Contact force (N)")
    if modelled:
        time.plot([], [], **STYLES[3], label="model")
    _legend(time)
    time.set_xlim(right=1.4 * time.dataLim.x1)
    for axes in (time, loop):
        plain(axes)
    return figure


def _model(axes: Any, drop: Drop) -> bool:
    """The fitted model over the record; False where there is none."""
    if isinstance(drop.fit, NotFitted):
        return False
    c = curves(drop.fit)
    within = c["model"] > 0
    axes.plot(c["t"][within] * MS, c["model"][within], **STYLES[3])
    return True


FIGURES: dict[str, tuple[str, Callable[[list[Drop], dict[str, Any]], Figure]]] = {
    "curves": ("Force over time with the model, and over displacement", _curves),
    "failure": ("Maximum force and duration of load over v0; hollow: failed", _failure),
    "restitution": ("Restitution and dissipated energy over v0", _restitution),
    "modulus": ("Elastic modulus and dampers over v0", _modulus),
    "displacement": ("Displacement at maximum and at the end of contact over v0", _displacement),
}
"""By name: what it shows, and what draws it."""
