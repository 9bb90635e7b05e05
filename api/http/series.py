"""Routes of series: what the drops say together, figures, the table."""

import io
import tempfile
from pathlib import Path
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import FileResponse, JSONResponse, Response
from starlette.background import BackgroundTask

from api.http import links
from api.http.caching import tag, tagged, unchanged
from api.http.errors import Refusal
from api.http.queries import only_known
from api.http.rendering import plain
from api.http.shared import Service, Shared
from api.series import drops_of, series_of
from api.tables import as_csv, rows_of

router = APIRouter(tags=["series"], dependencies=[Depends(only_known)])


@router.get("/series")
def list_series(shared: Shared) -> Response:
    """Names of the series, each with its number of runs."""
    count: dict[str, int] = {}
    for row in shared.catalog.runs(limit=100_000):
        if row.series:
            count[row.series] = count.get(row.series, 0) + 1
    found = [{"series": name, "runs": n, "links": links.of_series(name)} for name, n in sorted(count.items())]
    return JSONResponse(plain({"series": found}))


@router.get("/series/{name}")
def get_series(shared: Shared, name: str) -> Response:
    """Runs, groups and their ratios, what E depends on, failure, joint fits: as `droptower series --json`."""
    return JSONResponse(plain({**series_of(name, drops_of(shared.store, name)), "links": links.of_series(name)}))


@router.get("/series/{name}/table", response_class=Response)
def get_table(shared: Shared, name: str) -> Response:
    """A row a drop, in SI, as CSV."""
    return Response(as_csv(rows_of(drops_of(shared.store, name))), media_type="text/csv; charset=utf-8")


@router.get("/series/{name}/figures/{figure}", response_class=Response)
def get_figure(
    request: Request, shared: Shared, name: str, figure: str,
    format: Annotated[Literal["svg", "png"], Query()] = "svg",
) -> Response:  # fmt: skip
    """A figure of the series: curves, failure, restitution, modulus or displacement."""
    from api.figure_series import FIGURES, draw  # loads what draws

    if figure not in FIGURES:
        raise Refusal(404, "no-figure", f"there is no figure {figure!r}; there are {', '.join(FIGURES)}")
    etag = _etag(shared, name, figure, format)
    if (same := unchanged(request, etag)) is not None:
        return same
    drops = drops_of(shared.store, name)
    drawn = io.BytesIO()
    draw(figure, drops, series_of(name, drops), drawn, format)
    kind = {"svg": "image/svg+xml", "png": "image/png"}[format]
    return tagged(Response(drawn.getvalue(), media_type=kind), etag)


@router.get("/series/{name}/report", response_class=FileResponse)
def get_report(shared: Shared, name: str, format: Annotated[Literal["pdf", "html"], Query()] = "pdf") -> Response:
    """The report as one file; it takes about a second a drop."""
    from api.report import write_report  # loads what draws

    folder = tempfile.TemporaryDirectory(prefix="droptower-report-", ignore_cleanup_errors=True)
    try:
        path = Path(folder.name) / f"report.{format}"
        write_report(shared.store, name, path)
    except BaseException:
        folder.cleanup()
        raise
    kind = {"pdf": "application/pdf", "html": "text/html; charset=utf-8"}[format]
    done = BackgroundTask(folder.cleanup)
    return FileResponse(path, media_type=kind, filename=f"{name}.{format}", background=done)


def _etag(shared: Service, name: str, *what: str) -> str:
    """Changes with every run that comes to the series, and with every answer to one."""
    rows = shared.catalog.runs({"series": name}, limit=100_000)
    beside = [str(sorted(p.name for p in shared.store.raw(r.run).parent.iterdir())) for r in rows if r.fault is None]
    return tag("".join(f"{r.run}{r.sha256}" for r in rows) + "".join(beside), *what)
