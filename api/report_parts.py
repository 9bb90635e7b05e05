"""The blocks that reports are made of, as HTML and as PDF, and cells of their tables."""

from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from api.http import present
from api.http.symbols import SYMBOLS

Cell = str | Markup


@dataclass(frozen=True)
class Heading:
    """level : 1 to 3; a page begins before one of a drop."""

    text: Cell
    level: int = 2
    page: bool = False


@dataclass(frozen=True)
class Text:
    """A paragraph; `code` makes it a warning of that code."""

    text: Cell
    code: str | None = None


@dataclass(frozen=True)
class Table:
    """head : may be empty; words : places of columns that hold words and may wrap, the others hold numbers."""

    head: list[Cell]
    rows: list[list[Cell]]
    words: tuple[int, ...] = ()


@dataclass(frozen=True)
class Picture:
    """A figure as SVG, and what it shows."""

    svg: str
    caption: str


Block = Heading | Text | Table | Picture

SIGNS = {
    "v0_fail": "v<sub>0,fail</sub>", "v0_survived_max": "v<sub>0</sub> survived",
    "v0_failed_min": "v<sub>0</sub> failed",
    "F_rupture": "F<sub>rupture</sub>", "sigma_r": "σ<sub>r</sub>",
    "sigma_r_as_published": "σ<sub>r</sub> as published", "E_a": "E<sub>a</sub>", "E_a_prime": "E<sub>a</sub>′",
    "C_i": "C<sub>i</sub>", "C_d": "C<sub>d</sub>",
}  # fmt: skip


def with_u(key: str, finding: dict[str, Any]) -> Cell:
    """A value with its uncertainty and unit."""
    s = present.shown(key, finding)
    u = f" ± {s.u}" if s.u else ""
    unit = f" {s.unit}" if s.unit and s.value != "–" else ""
    return f"{s.value}{u}{unit}"


def sign_of(key: str) -> Cell:
    """A symbol as it is set."""
    return SYMBOLS[key].sign if key in SYMBOLS else Markup(SIGNS[key]) if key in SIGNS else key


def bare(key: str, v: dict[str, Any], end: str) -> str:
    """One end of an interval, in digits."""
    return present.shown(key, {"value": v[end], "u": None, "unit": v["unit"]}).value


def interval(key: str, v: dict[str, Any] | None) -> Cell:
    """A value with its 95 % interval and unit."""
    if v is None:
        return "–"
    s = present.shown(key, {"value": v["value"], "u": None, "unit": v["unit"]})
    around = "" if v.get("lo") is None else f" ({bare(key, v, 'lo')} to {bare(key, v, 'hi')})"
    return f"{s.value}{around} {s.unit}".rstrip()


def ends(name: str, p: dict[str, Any]) -> str:
    """The 95 % interval of a parameter; … at an open side."""
    return " to ".join("…" if p[end] is None else bare(name, p, end) for end in ("lo", "hi"))
