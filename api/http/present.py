"""Findings as a technician reads them: mm, ms, N, J, as many digits as the uncertainty bears."""

import math
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from markupsafe import Markup, escape

from api.http.symbols import GROUPS, SYMBOLS, Symbol

UNITS = {"m": ("mm", 1e3), "s": ("ms", 1e3), "N*s": ("N·s", 1.0), "Pa": ("GPa", 1e-9), "1": ("", 1.0)}
"""The bench's unit for one of the contract, and how many of it there are in one."""
STRESSES = ("sigma_r", "sigma_r_as_published")
OTHER = "Further"


@dataclass(frozen=True)
class Shown:
    """A finding in words and digits; `value` is a dash where it is unknown, `u` is empty where it cannot be had."""

    key: str
    symbol: Symbol
    value: str
    u: str
    unit: str


def shown(key: str, finding: dict[str, Any]) -> Shown:
    """A finding of an answer as it is shown."""
    symbol = SYMBOLS.get(key) or Symbol(escape(key), "", "")
    unit, factor = ("MPa", 1e-6) if key in STRESSES else UNITS.get(finding["unit"], (finding["unit"], 1.0))
    value, u = in_digits(finding["value"], finding["u"], factor)
    return Shown(key, symbol, value, u, unit)


def in_digits(value: float | str | bool | None, u: float | None, factor: float) -> tuple[str, str]:
    """Value and uncertainty: two digits of the uncertainty, four of the value if there is none."""
    if value is None:
        return "–", ""
    if isinstance(value, bool | str):
        return value if isinstance(value, str) else "yes" if value else "no", ""
    value, u = value * factor, (u or 0.0) * factor
    digits_of, kept = (u, 2) if u > 0 else (abs(value) or 1.0, 4)
    decimals = kept - 1 - math.floor(math.log10(digits_of))
    if decimals > 7:
        return f"{value:.4g}".replace("-", "−"), f"{u:.2g}".replace("-", "−") if u > 0 else ""
    places = max(0, decimals)
    digits = f"{round(value, decimals):.{places}f}".replace("-", "−")
    return digits, f"{round(u, decimals):.{places}f}" if u > 0 else ""


def grouped(findings: dict[str, dict[str, Any]]) -> dict[str, list[Shown]]:
    """Findings by group, those that are known; what no group names comes last. Groups of nothing are left out."""
    names = {group: list(symbols) for group, symbols in GROUPS.items()}
    names[OTHER] = [key for key in findings if key not in SYMBOLS]
    found = {
        group: [shown(k, findings[k]) for k in keys if k in findings and findings[k]["value"] is not None]
        for group, keys in names.items()
    }
    return {group: rows for group, rows in found.items() if rows}


def unknown(findings: dict[str, dict[str, Any]]) -> list[Markup]:
    """Signs of what could not be found."""
    return [SYMBOLS[k].sign if k in SYMBOLS else escape(k) for k, f in findings.items() if f["value"] is None]


def cell(answer: dict[str, Any] | None, key: str) -> str:
    """A finding's digits for a list, whose header has the unit."""
    finding = (answer or {}).get("findings", {}).get(key)
    return "" if finding is None else shown(key, finding).value


def setting(value: Any) -> str:
    """A value of a test file."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return ", ".join(f"{k} {setting(v)}" for k, v in value.items())
    if isinstance(value, list):
        return "; ".join(setting(v) for v in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def when(started: str | None) -> str:
    """A time in the zone of this computer."""
    if not started:
        return ""
    try:
        return f"{datetime.fromisoformat(started).astimezone():%Y-%m-%d %H:%M:%S %Z}"
    except ValueError:
        return started
