"""`droptower series`: what a series of drops says together."""

from pathlib import Path
from typing import Annotated, Any

import typer

from api.commands.options import Data, Json
from api.commands.show import EDGE, print_json, tell, value_with_u


def series(
    name: Annotated[str, typer.Argument(help="Name of the series.", metavar="NAME")], data: Data, as_json: Json = False
) -> None:
    """Fit every run of a series, and all of them together: one E, and E over v0."""
    from api.series import series_of
    from daq.store import Store

    found = series_of(Store(data), name)
    if as_json:
        print_json(found)
    else:
        _print(found)


def report(
    name: Annotated[str, typer.Argument(help="Name of the series.", metavar="NAME")],
    data: Data,
    output: Annotated[Path, typer.Option("-o", "--output", help="FILE.html.", metavar="FILE")],
) -> None:
    """Write a series as one file that opens without a network: runs, figures, failure, models, method, checksums."""
    from api.report import write_report
    from daq.store import Store

    if output.suffix != ".html":
        raise typer.BadParameter(f"{output} does not end in .html; a browser prints it to PDF", param_hint="-o")
    write_report(Store(data), name, output)
    tell(f"{name} written to {output}")


RUPTURE = {
    "v0_fail": "speed at which half fail", "v0_survived_max": "fastest that survived",
    "v0_failed_min": "slowest that failed", "F_rupture": "load at failure, mean",
    "sigma_r": "stress at failure, P1 (15), natural logarithm",
    "sigma_r_as_published": "the same as P1 printed it, log₁₀", "E_a": "½·m·v0_fail²",
    "E_a_prime": "energy up to failure, mean",
}  # fmt: skip


def _rupture(found: dict[str, Any]) -> Any:
    from rich.table import Table

    table = Table(title="failure", title_justify="left")
    for title in ("symbol", "value", "unit", "is"):
        table.add_column(title)
    for key, words in RUPTURE.items():
        row = found[key]
        if row is None:
            continue
        unit, factor = ("MPa", 1e-6) if row["unit"] == "Pa" else (row["unit"], 1.0)
        if "lo" in row:
            ends = " to ".join("…" if row[e] is None else f"{row[e] * factor:.4g}" for e in ("lo", "hi"))
            shown = f"{row['value'] * factor:.4g} (95 %: {ends})"
        else:
            shown = value_with_u(row["value"], row.get("u"), factor)
        table.add_row(key, shown, unit, words)
    return table


def _print(found: dict[str, Any]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    names = list(dict.fromkeys(n for run in found["runs"] for n in run["fit"]))
    table = Table(title=found["series"], title_justify="left")
    for title in (
        "run",
        "specimen",
        "v0, m/s",
        "F_M, N",
        "failed",
        *(f"{n}, {'GPa' if n == 'E' else 'kg/s'}" for n in names),
    ):
        table.add_column(title)
    for run in found["runs"]:
        values = [run["fit"].get(n) for n in names]
        cells = [value_with_u(p["value"], p["u_total"], 1e-9 if p["unit"] == "Pa" else 1) if p else "–" for p in values]
        table.add_row(run["run"], run["specimen"] or "", value_with_u(run["v0"]["value"], run["v0"]["u"]),
                      value_with_u(run["F_M"]["value"], run["F_M"]["u"]),
                      "yes" if run["failed"]["value"] else "", *cells)  # fmt: skip
    console.print(table)
    titles = {"one_E": "all drops, one E", "E_over_v0": "all drops, E = E_ref·(v0/v_ref)^n"}
    for key, joint in found["joint"].items():
        if joint is None:
            continue
        table = Table(title=f"{titles[key]} at {joint['v_ref']:.3g} m/s", title_justify="left")
        for title in ("parameter", "value ± standard uncertainty", "95 %", "unit", "verdict"):
            table.add_column(title)
        for name, p in joint["parameters"].items():
            unit, factor = EDGE.get(p["unit"], (p["unit"], 1.0))
            ends = " to ".join("…" if p[end] is None else f"{p[end] * factor:.4g}" for end in ("lo", "hi"))
            table.add_row(name, value_with_u(p["value"], p["u"], factor), ends, unit, p["verdict"])
        console.print(table)
    if found["v0_fail"] is not None or found["F_rupture"] is not None:
        console.print(_rupture(found))
    steps = found["staircase"]
    if steps is not None:
        E = value_with_u(steps["E_50"]["value"], steps["E_50"]["u"])
        console.print(
            f"up and down over {steps['drops']} drops: half fail at {E} J; next height {steps['next_height_mm']:g} mm"
        )
    for warning in found["warnings"]:
        console.print(f"! {warning['code']}: {warning['text']}", highlight=False, markup=False)
