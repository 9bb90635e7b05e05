"""What a report of a series holds, as blocks that a page of HTML and a page of PDF are made of alike."""

import io
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

from analysis.fit import NotFitted
from api.drop import Drop
from api.http import present
from api.http.runs import tree_of
from api.report_findings import by_groups, failure, joint_fits
from api.report_parts import Block, Cell, Heading, Picture, Table, Text, ends, sign_of, with_u
from api.series import OF_A_RUN
from daq.store import Store

TOLD = ("v0", "F_M", "t_c", "alpha_M", "eps_exact", "E_diss")
METHOD = (
    ("α(t), E(t)", "α = v0·t + ½·g·t² − (1/m)∬F dt², E = ∫F·v dt", "P1 (2), (4); P2 (2)"),
    ("ε", "J/(m·v0) − 1 − g·t_c/v0", "P1 (7) with the weight's impulse"),
    ("E, C_i, C_d", "F = K_i·α₁^(3/2) = C_i·α̇₂ = K_d·α₃ + C_d·α̇₃, least squares with nuisances", "P1 (8)–(16)"),
    ("C", "F = K_i·α₁^(3/2) = C·α̇₂", "P2 (13), (14)"),
    ("σ_r", "F/d²·[(1 + ν)(0.485·ln(R/d) + 0.52) + 0.48]; as published: log₁₀", "P1 (15)"),
    ("v0_fail", "half of the specimens fail; likelihood of the drops with a prior on scatter, 95 % interval", ""),
    ("E_a, E_a′", "½·m·v0_fail²; mean of ∫F dα up to failure", "P1 (17)"),
    ("failure", "impulse short and load lost at once; crack: softer for good from a sudden loss on", "P1, ISO 6603-2"),
    ("ratios", "means of logarithms, Welch's degrees of freedom, 95 % interval", ""),
)  # fmt: skip


def blocks_of(store: Store, drops: list[Drop], series: dict[str, Any], drawn: Callable[[int], None]) -> list[Block]:
    """The whole report, in order; `drawn` is told how many drops are done."""
    first, rest = overview(drops, series)
    made = f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC"
    out: list[Block] = [
        Heading(series["series"], 1),
        Text(f"{len(drops)} drops · report of {made} · droptower {version('droptower')}"),
        *first, *_figures(drops, series), *rest,
    ]  # fmt: skip
    out += [Heading("Method"), Table(["Number", "Is", "Source"], [list(row) for row in METHOD], (0, 1, 2))]
    shared = _shared(drops)
    out += [Heading("Conditions of all drops"), Table([], [[*key, value] for key, value in shared.items()], (0, 1, 2))]
    raw: list[list[Cell]] = [
        [d.run.run, d.run.test.specimen.id or "", str(present.when(d.run.started)), store.sha256(d.run.run)]
        for d in drops
    ]
    out += [Heading("Raw data"), Table(["Run", "Specimen", "Started", "SHA-256"], raw, (0, 1, 2, 3))]
    for done, drop in enumerate(_by_speed(drops), 1):
        out += _one(drop, shared)
        drawn(done)
    return out


def overview(drops: list[Drop], series: dict[str, Any]) -> tuple[list[Block], list[Block]]:
    """What the page of a series and its report have in common: before the figures, and after them."""
    order = _by_speed(drops)
    note = Text("± standard uncertainty. – : not to be had from the record.")
    first: list[Block] = [Heading("Drops"), _table_of_drops(order, series), note]
    rest = [*failure(order, series), *by_groups(series), *joint_fits(series)]
    if series["warnings"]:
        rest += [Heading("Cautions"), *(Text(w["text"], w["code"]) for w in series["warnings"])]
    return first, rest


def _by_speed(drops: list[Drop]) -> list[Drop]:
    return sorted(drops, key=lambda d: (d.value("v0") is None, d.value("v0") or 0.0))


def _table_of_drops(drops: list[Drop], series: dict[str, Any]) -> Table:
    marked = {run["run"]: run["outlier"] for run in series["runs"]}
    rows: list[list[Cell]] = []
    for d in drops:
        found = d.answer["findings"]
        E = None if d.answer["fit"] is None else d.answer["fit"]["parameters"].get("E")
        kind = "" if not d.failed else found["failure_kind"]["value"] or "yes, says the operator"
        mark = f"off in {', '.join(marked[d.run.run])}" if marked[d.run.run] else ""
        rows.append(
            [
                d.run.test.specimen.id or "", *(with_u(s, found[s]) for s in TOLD),
                "–" if E is None else with_u("E", {**E, "u": E["u_total"]}), kind, mark,
            ]
        )  # fmt: skip
    head = ["Specimen", *(sign_of(s) for s in (*TOLD, "E")), "Failed", "Outlier"]
    if not any(row[-1] for row in rows):
        head, rows = head[:-1], [row[:-1] for row in rows]
    return Table(head, rows, (0, 8, 9))


def _figures(drops: list[Drop], series: dict[str, Any]) -> list[Block]:
    from api.figure_series import FIGURES, draw  # half a second to load

    out: list[Block] = []
    for name, (title, _) in FIGURES.items():
        drawn = io.BytesIO()
        draw(name, drops, series, drawn)
        out.append(Picture(drawn.getvalue().decode(), title))
    return out


def _conditions(drop: Drop) -> dict[tuple[str, str], str]:
    found = {
        (table, key): present.setting(value)
        for table, keys in tree_of(drop.run.test).items() for key, value in keys.items()
    }  # fmt: skip
    for c in drop.run.channels:
        k = c.calibration
        words = [
            k.quantity,
            f"calibrated {k.calibrated_on}" if k.calibrated_on else "",
            f"certificate {k.certificate}" if k.certificate else "",
        ]
        found["channel", k.name] = ", ".join(w for w in words if w)
    return {key: str(value) for key, value in found.items()}


def _shared(drops: list[Drop]) -> dict[tuple[str, str], str]:
    """Conditions that all drops have in common."""
    first, *rest = [_conditions(d) for d in drops]
    return {key: value for key, value in first.items() if all(other.get(key) == value for other in rest)}


def _one(drop: Drop, shared: dict[tuple[str, str], str]) -> list[Block]:
    run, fit = drop.run, drop.answer["fit"]
    facts = f"{run.run} · {run.source} {present.when(run.started)} · {run.points:,} samples at {1e-3 / run.dt:g} kHz"
    out: list[Block] = [Heading(run.test.specimen.id or run.run, 2, page=True), Text(facts)]
    out += [Text(w["text"], w["code"]) for w in drop.answer["warnings"]]
    if fit is not None:
        known = {name: fit["parameters"][name] for name in OF_A_RUN if name in fit["parameters"]}
        rows: list[list[Cell]] = [
            [name, with_u(name, {**p, "u": p["u_total"]}), ends(name, p), p["verdict"]] for name, p in known.items()
        ]
        out.append(Table([f"{fit['model']} model", "Value", "95 %", "Verdict"], rows, (0, 3)))
        out += _picture(drop)
    own: list[list[Cell]] = [[*key, value] for key, value in _conditions(drop).items() if key not in shared]
    if own:
        out += [Heading("Conditions of its own", 3), Table([], own, (0, 1, 2))]
    return out


def _picture(drop: Drop) -> list[Block]:
    from api.figures import save_fit

    if isinstance(drop.fit, NotFitted):
        return []
    drawn = io.BytesIO()
    save_fit(drop.fit, drawn)
    return [Picture(drawn.getvalue().decode(), "Record and model, what is left, loop, elements apart, profiles")]
