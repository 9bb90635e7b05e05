"""A series as one self-contained file to send to a colleague."""

import io
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, select_autoescape
from markupsafe import Markup

from api.answer import answer_of
from api.http import present
from api.http.runs import tree_of
from api.http.symbols import GROUPS
from api.series import series_of
from daq.errors import StoreError
from daq.store import Store

TOLD = ("v0", "F_M", "t_c", "alpha_M", "eps_exact", "E_diss")
OF_FAILED = ("v0", "F_failure", "t_failure", "alpha_failure", "E_failure")
"""Findings in the table of runs, and in that of those that failed."""
FITTED = ("E", "C_i", "C_d", "C")
METHOD = (
    ("α(t), E(t)", "α = v0·t + ½·g·t² − (1/m)∬F dt², E = ∫F·v dt", "P1 (2), (4); P2 (2)"),
    ("ε", "J/(m·v0) − 1 − g·t_c/v0", "P1 (7) with the weight's impulse"),
    ("E, C_i, C_d", "F = K_i·α₁^(3/2) = C_i·α̇₂ = K_d·α₃ + C_d·α̇₃, least squares with nuisances", "P1 (8)–(16)"),
    ("C", "F = K_i·α₁^(3/2) = C·α̇₂", "P2 (13), (14)"),
    ("σ_r", "F/d²·[(1 + ν)(0.485·ln(R/d) + 0.52) + 0.48]; as published: log₁₀", "P1 (15)"),
    ("v0_fail", "half of the specimens fail; likelihood of the drops with a prior on scatter, 95 % interval", ""),
    ("E_a, E_a′", "½·m·v0_fail²; mean of ∫F dα up to failure", "P1 (17)"),
)  # fmt: skip


def write_report(store: Store, name: str, path: Path) -> None:
    """Write the report of a series as HTML that opens without a network.

    Raises
    ------
    StoreError : no run is in the series, or the file cannot be written.
    """
    from api.figure_series import save_series
    from api.figures import save_fit
    from api.fitting import fit_of

    series = series_of(store, name)
    drawn = io.BytesIO()
    save_series(series, drawn)
    runs: list[dict[str, Any]] = []
    for row in sorted(series["runs"], key=lambda r: (r["v0"]["value"] is None, r["v0"]["value"])):
        run, answer = store.read(row["run"]), answer_of(store, row["run"])
        figure = None
        if answer["fit"] is not None:
            figure = io.BytesIO()
            save_fit(fit_of(run), figure)
        runs.append(
            {
                "run": run, "answer": answer, "conditions": tree_of(run.test), "sha256": store.sha256(run.run),
                "figure": None if figure is None else _svg(figure),
                "cells": [present.shown(s, answer["findings"][s]) for s in TOLD],
                "of_failure": [present.shown(s, answer["findings"][s]) for s in OF_FAILED],
            }
        )  # fmt: skip
    environment = Environment(
        loader=PackageLoader("api"), autoescape=select_autoescape(), trim_blocks=True, lstrip_blocks=True
    )
    symbols = {key: symbol for group in GROUPS.values() for key, symbol in group.items()}
    text = environment.get_template("report.html").render(
        series=series, runs=runs, figure=_svg(drawn), told=[symbols[s] for s in TOLD],
        of_failed=[symbols[s] for s in OF_FAILED], fitted=FITTED, method=METHOD,
        present=present, made=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC", version=version("droptower"),
    )  # fmt: skip
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as e:
        raise StoreError(f"{path} cannot be written: {e.strerror or e}") from None


def _svg(drawn: io.BytesIO) -> Markup:
    """A figure as it stands in a page: without its XML head."""
    text = drawn.getvalue().decode("utf-8")
    return Markup(text[text.index("<svg") :])
