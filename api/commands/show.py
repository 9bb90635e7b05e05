"""How findings look in a terminal."""

import json
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

EDGE = {"Pa": ("GPa", 1e-9), "m": ("mm", 1e3), "s": ("ms", 1e3), "1": ("", 1.0)}
"""Units at the edge, and the factor to them."""


def print_json(line: dict[str, Any]) -> None:
    """One line on stdout."""
    print(json.dumps(line, allow_nan=False), flush=True)


def value_with_u(value: float | bool | str | None, u: float | None, factor: float = 1.0) -> str:
    """`1.234 ± 0.012`: the uncertainty to two digits, the value to the same place; `–` where there is none."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, str):
        return value
    value *= factor
    if not u:
        return f"{value:.4g}"
    u *= factor
    places = max(0, 1 - _exponent(u))
    return f"{value:.{places}f} ± {u:.{places}f}"


def _exponent(number: float) -> int:
    return int(f"{number:e}".partition("e")[2])


def print_answer(answer: dict[str, Any]) -> None:
    """Findings and warnings of a run as a table on stdout."""
    table = Table(title=f"{answer['run']}  {answer['series'] or ''}", title_justify="left")
    for title in ("symbol", "value ± standard uncertainty", "unit"):
        table.add_column(title)
    for symbol, finding in answer["findings"].items():
        if finding["value"] is None:
            continue
        unit, factor = EDGE.get(finding["unit"], (finding["unit"], 1.0))
        table.add_row(symbol, value_with_u(finding["value"], finding["u"], factor), unit)
    console = Console()
    console.print(table)
    if answer["fit"] is not None:
        console.print(_fit_table(answer["fit"]))
    unknown = [s for s, f in answer["findings"].items() if f["value"] is None]
    if unknown:
        console.print(f"not known: {', '.join(unknown)}", highlight=False)
    for warning in answer["warnings"]:
        console.print(f"! {warning['code']}: {warning['text']}", highlight=False, markup=False)


def _fit_table(fit: dict[str, Any]) -> Table:
    table = Table(title=f"{fit['model']} model", title_justify="left")
    for title in ("parameter", "value ± standard uncertainty", "95 %", "unit", "verdict"):
        table.add_column(title)
    for name, p in fit["parameters"].items():
        unit, factor = EDGE.get(p["unit"], (p["unit"], 1.0))
        lo, hi = (f"{p[end] * factor:.4g}" if p[end] is not None else "…" for end in ("lo", "hi"))
        table.add_row(name, value_with_u(p["value"], p["u_total"], factor), f"{lo} to {hi}", unit, p["verdict"])
    return table


def findings_in_line(findings: dict[str, Any], symbols: tuple[str, ...]) -> str:
    """Some findings in a line: `F_M 712.3 ± 1.2 N`."""
    found: list[str] = []
    for symbol in symbols:
        finding = findings[symbol]
        if finding["value"] is not None:
            unit, factor = EDGE.get(finding["unit"], (finding["unit"], 1.0))
            found.append(f"{symbol} {value_with_u(finding['value'], finding['u'], factor)} {unit}".rstrip())
    return ", ".join(found) or "nothing yet"


def tell(text: str) -> None:
    """A line for the operator, on stderr."""
    print(text, file=sys.stderr, flush=True)
