"""A series as one self-contained file to send to a colleague: HTML that opens without a network, or PDF."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

from jinja2 import Environment, PackageLoader, select_autoescape
from markupsafe import Markup

from api.report_blocks import blocks_of
from api.report_parts import Block, Cell, Heading, Picture, Table, Text
from api.series import drops_of, series_of
from daq.errors import StoreError
from daq.store import Store

FORMATS = (".html", ".pdf")
_WIDE, _SMALL = 8, "6.2pt"
"""Columns beyond which a table is set smaller."""
TYPST_HEAD = """#set page(paper: "a4", margin: (x: 16mm, top: 16mm, bottom: 18mm), numbering: "1 / 1")
#set text(size: 8.5pt, hyphenate: false)
#set par(leading: 0.55em)
#set table(stroke: (x, y) => (bottom: 0.4pt + luma(80%)), inset: (x: 4pt, y: 3pt))
#show heading.where(level: 1): set text(size: 17pt)
#show heading.where(level: 2): set text(size: 12pt)
#show heading: set block(above: 1.3em, below: 0.7em)
#show heading: set block(sticky: true)
"""


def write_report(store: Store, name: str, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Write the report of a series; the suffix says what as, `progress` is told of drops read, then of drops drawn.

    Raises
    ------
    SeriesNotFound : no run is in the series. StoreError : the file cannot be written.
    """
    drops = drops_of(store, name)
    blocks = blocks_of(
        store, drops, series_of(name, drops), lambda done: progress(done, len(drops)) if progress else None
    )
    content = _pdf(blocks) if path.suffix == ".pdf" else _html(blocks, name)
    try:
        path.write_bytes(content)
    except OSError as e:
        raise StoreError(f"{path} cannot be written: {e.strerror or e}") from None


def _html(blocks: list[Block], name: str) -> bytes:
    environment = Environment(
        loader=PackageLoader("api"), autoescape=select_autoescape(), trim_blocks=True, lstrip_blocks=True
    )
    rows = [(type(block).__name__, block) for block in blocks]
    template = environment.get_template("report.html")
    return template.render(blocks=rows, name=name, svg=_bare_svg).encode()


def _bare_svg(text: str) -> Markup:
    """A figure as it stands in a page: without its XML head."""
    return Markup(text[text.index("<svg") :])


def _pdf(blocks: list[Block]) -> bytes:
    import typst  # a typesetter, not loaded for HTML

    files: dict[str, str | bytes] = {}
    parts = [TYPST_HEAD]
    for block in blocks:
        match block:
            case Heading(text, level, page):
                parts += ["#pagebreak(weak: true)"] if page else []
                parts.append(f"{'=' * level} {typeset(text)}")
            case Text(text, None):
                parts.append(f"#text(fill: luma(35%))[{typeset(text)}]\n")
            case Text(text, code):
                box = "width: 100%, fill: luma(94%), inset: 5pt, stroke: (left: 2pt + luma(40%))"
                parts.append(f"#block({box})[*{typeset(code or '')}* {typeset(text)}]")
            case Table():
                parts.append(_table(block))
            case Picture(svg, caption):
                files[f"{len(files)}.svg"] = svg.encode()
                image = f'image("{len(files) - 1}.svg", width: 100%)'
                parts.append(f"#block(breakable: false)[#{image} #text(size: 7.5pt)[{typeset(caption)}]]")
    files["main.typ"] = "\n\n".join(parts).encode()
    made: bytes = typst.compile(cast("Any", files), format="pdf")
    return made


def _table(table: Table) -> str:
    width = len(table.head or table.rows[0]) if table.head or table.rows else 0
    if width == 0:
        return ""
    sides = ", ".join("left" if k in table.words else "right" for k in range(width))
    cells = [f"[{typeset(c) if k in table.words else _whole(c)}]" for row in table.rows for k, c in enumerate(row)]
    head = f"table.header({', '.join(f'[*{typeset(c)}*]' if c else '[]' for c in table.head)}), " if table.head else ""
    columns = ", ".join("auto" for _ in range(width))
    drawn = f"table(columns: ({columns},), align: ({sides},), {head}{', '.join(cells)})"
    return f"#[#set text(size: {_SMALL}); #{drawn}]" if width > _WIDE else f"#[#set text(size: 7.4pt); #{drawn}]"


def _whole(cell: Cell) -> str:
    """A number with its unit, on one line."""
    return typeset(cell).replace(" ", "~").replace("/", "/\u2060")


def typeset(text: Cell) -> str:
    """A cell as Typst markup: what it would take for markup is escaped, subscripts are kept."""
    plain = str(text) if isinstance(text, Markup) else str(Markup.escape(text))
    out: list[str] = []
    for piece in re.split(r"(</?su[bp]>)", plain):
        tag = re.fullmatch(r"<(/?)(su[bp])>", piece)
        if tag is not None:
            out.append("]" if tag[1] else f"#{tag[2]}[")
        else:
            # A hash of 64 digits may break anywhere, else it would leave the page.
            words = re.sub(
                r"\b[0-9a-f]{64}\b", lambda m: "\u200b".join(re.findall(".{8}", m[0])), Markup(piece).unescape()
            )
            out.append(re.sub(r"([\\#$*_`<>@\[\]~=/\-+'\"])", r"\\\1", words))
    return "".join(out)
