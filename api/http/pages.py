"""The pages: bench and list of runs, one run, definitions, the API's description."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response

from api.answer import answer_of
from api.http import present
from api.http.links import API, of_run, of_series
from api.http.queries import cursor
from api.http.rendering import page
from api.http.runs import tree_of
from api.http.shared import Service, Shared
from api.http.symbols import GROUPS
from api.series import drops_of, series_of
from daq.catalog import Row
from daq.errors import DaqError, StoreError

A_PAGE = 50
KEY_FIGURES = ("F_M", "t_c", "eps_exact", "v0", "alpha_M", "E_diss")
SKELETON = """\
[dart]
mass_kg = 0.503
tip_radius_mm = 6.35

[specimen]
id = "…"
thickness_mm = 4.6
nu = 0.30

[support]
kind = "ring"
radius_mm = 30

[drop]
height_mm = 100
"""
router = APIRouter(include_in_schema=False)
Text = Annotated[str, Query(max_length=200)]


@dataclass(frozen=True)
class Listed:
    """A run in the list; `answer` is the newest that stands beside it."""

    row: Row
    answer: dict[str, Any] | None

    @property
    def cells(self) -> Mapping[str, str]:
        """Digits of the columns."""
        return {key: present.cell(self.answer, key) for key in ("v0", "F_M", "t_c", "eps_exact")}


@router.get("/")
def bench(request: Request, shared: Shared, series: Text = "", specimen: Text = "", after: Text = "") -> Response:
    """Bench, newest run, list of runs."""
    where = {k: v for k, v in {"series": series, "specimen": specimen}.items() if v}
    rows = shared.catalog.runs(where, after=cursor(after or None), limit=A_PAGE + 1)
    every = shared.catalog.runs(limit=1000)
    newest = every[0] if every else None
    return page(
        request,
        "bench.html",
        listed=[Listed(row, _kept(shared, row)) for row in rows[:A_PAGE]],
        older=rows[A_PAGE - 1].run if len(rows) > A_PAGE else None,
        where={"series": series, "specimen": specimen},
        known={k: sorted({v for row in every if (v := getattr(row, k))}) for k in ("series", "specimen")},
        filtered=bool(where or after),
        newest=None if newest is None else _in_full(shared, newest),
        data=shared.store.folder,
        rig=None if shared.bench is None else shared.bench.rig,
        last=_last_test(shared, every),
        key_figures=KEY_FIGURES,
        present=present,
        series_page=_series_page,
    )


@router.get("/runs/{run}")
def one_run(request: Request, shared: Shared, run: str) -> Response:
    """All there is of one run."""
    data = shared.traces.get(run).run
    answer = answer_of(shared.store, run)
    stated = shared.store.raw(run).with_name("raw.sha256")
    return page(
        request,
        "run.html",
        run=data,
        answer=answer,
        groups=present.grouped(answer["findings"]),
        unknown=present.unknown(answer["findings"]),
        conditions=tree_of(data.test),
        key_figures=KEY_FIGURES,
        links=of_run(run),
        series_page=_series_page,
        sha256=shared.store.sha256(run),
        stated=stated.read_text().partition(" ")[0] if stated.is_file() else None,
        present=present,
    )


@router.get("/series/{name}")
def one_series(request: Request, shared: Shared, name: str) -> Response:
    """What the drops of a series say together."""
    from api.figure_series import FIGURES  # loads what draws
    from api.report_blocks import overview

    drops = drops_of(shared.store, name)
    parts = [[(type(b).__name__, b) for b in blocks] for blocks in overview(drops, series_of(name, drops))]
    figures = {figure: title for figure, (title, _) in FIGURES.items()}
    return page(
        request, "series.html", name=name, first=parts[0], rest=parts[1], figures=figures, links=of_series(name)
    )  # fmt: skip


@router.get("/definitions")
def definitions(request: Request) -> Response:
    """Every symbol with its definition."""
    return page(request, "definitions.html", groups=GROUPS)


@router.get("/docs")
def docs(request: Request) -> Response:
    """The API's description, by swagger-ui of an installed package."""
    return page(request, "docs.html", openapi=f"{API}/openapi.json")


def _kept(shared: Service, row: Row) -> dict[str, Any] | None:
    try:
        return shared.store.analysis(row.run)
    except (StoreError, OSError, ValueError):
        return None


def _in_full(shared: Service, row: Row) -> dict[str, Any]:
    """A run with its answer, or the words why there is none."""
    try:
        return {"row": row, "answer": answer_of(shared.store, row.run), "fault": None}
    except DaqError as error:
        return {"row": row, "answer": None, "fault": str(error)}


def _last_test(shared: Service, rows: list[Row]) -> dict[str, str | None]:
    """Series and test file of the last drop that was taken, for the next to start from."""
    for row in rows[:20]:
        if row.source == "acquired" and row.fault is None:
            try:
                return {"series": row.series, "test_text": shared.traces.get(row.run).run.test_text}
            except DaqError:
                continue
    return {"series": None, "test_text": SKELETON}


def _series_page(name: str) -> str:
    return of_series(name)["page"]
