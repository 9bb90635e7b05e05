"""`droptower series`: what a series of drops says together."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from api.commands.options import Data, Json
from api.commands.show import print_json, tell

if TYPE_CHECKING:
    from api.drop import Drop


def series(
    name: Annotated[str, typer.Argument(help="Name of the series.", metavar="NAME")],
    data: Data,
    as_json: Json = False,
    table: Annotated[
        Path | None, typer.Option(help="Write a row a drop to FILE.csv or FILE.parquet, in SI.", metavar="FILE")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Write every figure as SVG and PNG into this folder.", metavar="FOLDER")
    ] = None,
) -> None:
    """What the drops of a series say together: groups, what E depends on, where they fail, one fit of them all."""
    from api.series import drops_of, series_of
    from api.tables import FORMATS, write_table
    from daq.store import Store

    if table is not None and table.suffix not in FORMATS:
        raise typer.BadParameter(f"{table} ends in neither {' nor '.join(FORMATS)}", param_hint="--table")
    drops = drops_of(Store(data), name, _counted)
    found = series_of(name, drops)
    if table is not None:
        write_table(drops, table)
        tell(f"{len(drops)} drops written to {table}")
    if plot is not None:
        from api.figure_series import draw_all

        draw_all(drops, found, plot)
        tell(f"figures written to {plot}")
    if as_json:
        print_json(found)
    else:
        _print(drops, found)


def report(
    name: Annotated[str, typer.Argument(help="Name of the series.", metavar="NAME")],
    data: Data,
    output: Annotated[Path, typer.Option("-o", "--output", help="FILE.html or FILE.pdf.", metavar="FILE")],
) -> None:
    """Write a series as one file that opens without a network: runs, figures, failure, models, method, checksums."""
    from api.report import FORMATS, write_report
    from daq.store import Store

    if output.suffix not in FORMATS:
        raise typer.BadParameter(f"{output} ends in neither {' nor '.join(FORMATS)}", param_hint="-o")

    write_report(Store(data), name, output, _counted)
    tell(f"{name} written to {output}")


def _counted(done: int, of: int) -> None:
    """On a terminal, how far it is."""
    if sys.stderr.isatty():
        print(f"\r{done} of {of} drops", end="" if done < of else "\n", file=sys.stderr, flush=True)


def _print(drops: "list[Drop]", found: dict[str, Any]) -> None:
    """The overview that the page and the report give, as text."""
    import rich.table
    from markupsafe import Markup
    from rich.console import Console

    from api.report_blocks import overview
    from api.report_parts import Cell, Heading, Table, Text

    def words(cell: Cell) -> str:
        if not isinstance(cell, Markup):
            return cell
        plain = cell.replace("v<sub>0,", "v0_").replace("v<sub>0</sub>", "v0").replace("<sub>", "_")
        return Markup(plain).striptags()

    console = Console()
    if not console.is_terminal:
        console.width = max(console.width, 190)  # so that no cell is broken
    first, rest = overview(drops, found)
    for block in [Heading(found["series"]), *first, *rest]:
        match block:
            case Heading(text):
                console.print(f"\n[bold]{words(text)}[/bold]", highlight=False)
            case Text(text, code):
                mark = f"! {code}: " if code else ""
                console.print(mark + words(text), highlight=False, markup=False)
            case Table():
                table = rich.table.Table(box=None, padding=(0, 2, 0, 0), show_header=bool(block.head))
                width = len(block.head or block.rows[0])
                for k in range(width):
                    title = words(block.head[k]) if block.head else ""
                    table.add_column(title, justify="left" if k in block.words else "right")
                for row in block.rows:
                    table.add_row(*(words(cell) for cell in row))
                console.print(table)
            case _:
                pass  # a picture
