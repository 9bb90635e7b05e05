"""Options that several commands take."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

Data = Annotated[Path, typer.Option("--data", help="Data folder.", metavar="DIR")]
Json = Annotated[bool, typer.Option("--json", help="One JSON object a line on stdout; everything else on stderr.")]
Series = Annotated[str | None, typer.Option("--series", help="Series that the run belongs to.", metavar="NAME")]
RigFileOption = Annotated[Path, typer.Option("--rig", help="Rig file.", metavar="RIG.toml")]
TestFileOption = Annotated[Path, typer.Option("--test", help="Test file.", metavar="TEST.toml")]


class Kind(StrEnum):
    """The models of PHYSICS.md."""

    conservative = "conservative"
    parallel = "parallel"
    series = "series"
    flexed = "flexed"


class Correction(StrEnum):
    """What a model can be corrected for."""

    overhang = "overhang"
    finite_thickness = "finite-thickness"


def checked_figure(path: Path) -> None:
    """Refuse a figure file of another kind."""
    if path.suffix not in (".png", ".svg"):
        raise typer.BadParameter(f"{path} ends in neither .png nor .svg", param_hint="--plot")
