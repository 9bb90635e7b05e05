"""Routes of runs: the list, one run's answer, its files."""

import base64
import io
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import FileResponse, JSONResponse, Response
from pydantic import BaseModel, ConfigDict, Field
from starlette.background import BackgroundTask

from api.answer import analysed, answer_of
from api.http import links
from api.http.caching import tag, tag_of_folder, tagged, unchanged
from api.http.errors import Refusal
from api.http.queries import cursor, moment, only_known
from api.http.rendering import plain
from api.http.shared import Shared
from daq.catalog import FILTERS, as_json
from daq.export import export_csv, export_nexus
from daq.test_file import TestFile

if TYPE_CHECKING:
    from analysis.fit import Fit

MOST_RUNS = 1000
CURVE = 500
"""Points of a curve."""
router = APIRouter(tags=["runs"], dependencies=[Depends(only_known)])
Filter = Annotated[str | None, Query(max_length=200)]


@router.get("/runs")
def list_runs(
    shared: Shared,
    series: Filter = None,
    specimen: Filter = None,
    material: Filter = None,
    batch: Filter = None,
    source: Annotated[Literal["acquired", "imported"] | None, Query()] = None,
    since: Annotated[
        str | None, Query(description="Started at this time (UTC unless it says otherwise) or later")
    ] = None,
    after: Annotated[str | None, Query(description="The run after which the list goes on, as in links.next")] = None,
    limit: Annotated[int, Query(ge=1, le=MOST_RUNS)] = 100,
) -> Response:
    """Runs, newest first."""
    given = dict(zip(FILTERS, (series, specimen, material, batch, source), strict=True))
    where = {k: v for k, v in given.items() if v is not None}
    rows = shared.catalog.runs(where, moment(since), cursor(after), limit + 1)
    found = [{**as_json(r), "links": _few_links(r.run)} for r in rows[:limit]]
    asked = {**where, "since": since, "limit": limit}
    more = links.runs(**asked, after=found[-1]["run"]) if len(rows) > limit else None
    body = {"runs": found, "links": {"self": links.runs(**asked, after=after), "next": more}}
    return JSONResponse(plain(body))


def _few_links(run: str) -> dict[str, str]:
    every = links.of_run(run)
    return {k: every[k] for k in ("self", "force", "page")}


@router.get("/runs/{run}")
def get_run(request: Request, shared: Shared, run: str) -> Response:
    """Findings with uncertainties, warnings and conditions; a run that was never analysed is analysed now."""
    trace = shared.traces.get(run)
    if (same := unchanged(request, tag_of_folder(shared.store, trace))) is not None:
        return same
    answer = answer_of(shared.store, run)
    data = trace.run
    facts = {
        "started": data.started,
        "source": data.source,
        "specimen": data.test.specimen.id,
        "material": data.test.specimen.material,
        "points": data.points,
        "sample_rate_Hz": 1 / data.dt,
        "conditions": tree_of(data.test),
        "links": links.of_run(run),
    }
    return tagged(JSONResponse(plain({**answer, **facts})), tag_of_folder(shared.store, trace))


def tree_of(test: TestFile) -> dict[str, Any]:
    """A test as its file would say it: tables of keys, each uncertainty beside its number."""
    tree = test.model_dump(mode="json", by_alias=True, exclude_none=True)
    return {name: kept for name, table in tree.items() if (kept := _flat(table))}


def _flat(table: dict[str, Any]) -> dict[str, Any]:
    u = table.get("u", {})
    flat: dict[str, Any] = {}
    for key, value in table.items():
        if key != "u" and value != []:
            flat[key] = [_flat(row) for row in value] if key == "channel" else value
            flat |= {f"u_{key}": u[key]} if key in u else {}
    return flat


class Correction(BaseModel):
    """Keys of the test file with their new values (`measured.failure_type`), who says so, and why."""

    model_config = ConfigDict(extra="forbid")
    set: Annotated[dict[str, bool | float | str | list[float]], Field(min_length=1, max_length=100)]
    author: Annotated[str, Field(min_length=1, max_length=200)]
    reason: Annotated[str, Field(min_length=1, max_length=2000)]


@router.post("/runs/{run}/corrections", status_code=201)
def add_correction(shared: Shared, run: str, correction: Correction) -> Response:
    """Correct the test file of a run; the record stays as it is, and the correction stands beside it."""
    path = shared.store.correct(run, dict(correction.set), correction.author, correction.reason)
    shared.catalog.forget(run)
    return JSONResponse({"correction": path.name, "links": links.of_run(run)}, 201)


@router.get("/runs/{run}/fit")
def get_fit(
    shared: Shared,
    run: str,
    model: Annotated[
        Literal["conservative", "parallel", "series", "flexed"] | None,
        Query(description="another model than the support's; its answer is not kept"),
    ] = None,
    correct: Annotated[
        list[Literal["overhang", "finite-thickness"]] | None, Query(description="correct the model for this")
    ] = None,
) -> Response:
    """The fitted model: parameters with intervals and verdicts, budget, validity; null where none can be fitted."""
    data = shared.traces.get(run).run
    answer = analysed(data, model, tuple(correct or ())) if model or correct else answer_of(shared.store, run)
    body = {"run": run, "fit": answer["fit"], "warnings": answer["warnings"], "links": links.of_run(run)}
    return JSONResponse(plain(body))


@router.get("/runs/{run}/fit/curves")
def get_curves(shared: Shared, run: str) -> Response:
    """Record, model, ringing and what is left (N) over t (s from contact); the elements apart (m) with the force."""
    from analysis.fit_answer import curves
    from analysis.fit_profile import elements_of

    fit = _fit(shared, run)
    parts, t = elements_of(fit, CURVE)
    of_record = {key: values.tolist() for key, values in curves(fit, CURVE).items()}
    apart = {"t": t.tolist(), **{key: values.tolist() for key, values in parts.items()}}
    body = {"run": run, "model": fit.problem.kind, "record": of_record, "elements": apart}
    return JSONResponse(plain(body))


def _fit(shared: Shared, run: str) -> "Fit":
    from analysis.fit import NotFitted
    from api.fitting import fit_of

    try:
        return fit_of(shared.traces.get(run).run)
    except NotFitted as e:
        raise Refusal(404, "not-fitted", str(e)) from None


@router.get("/runs/{run}/fit.svg", response_class=Response)
def get_figure(request: Request, shared: Shared, run: str) -> Response:
    """The record with its model, what is left, the loop, the elements apart, and the profiles of the parameters."""
    from api.figures import save_fit  # loads what draws

    trace = shared.traces.get(run)
    etag = tag(trace.sha256, "fit.svg")
    if (same := unchanged(request, etag)) is not None:
        return same
    drawn = io.BytesIO()
    save_fit(_fit(shared, run), drawn)
    return tagged(Response(drawn.getvalue(), media_type="image/svg+xml"), etag)


@router.get("/runs/{run}/raw", response_class=FileResponse)
def get_raw(request: Request, shared: Shared, run: str) -> Response:
    """The file as it was recorded, with its SHA-256 in `Repr-Digest`."""
    path = shared.store.raw(run)
    digest = shared.store.sha256(run)
    etag = tag(digest)
    if (same := unchanged(request, etag)) is not None:
        return same
    stated = base64.b64encode(bytes.fromhex(digest)).decode()
    headers = {"Repr-Digest": f"sha-256=:{stated}:", "Droptower-Sha256": digest}
    return tagged(FileResponse(path, media_type="application/x-hdf5", filename=f"{run}.h5", headers=headers), etag)


@router.get("/runs/{run}/export", response_class=FileResponse)
def get_export(shared: Shared, run: str, format: Annotated[Literal["csv", "h5"], Query()] = "h5") -> Response:
    """Every sample as CSV, or one self-contained NeXus file with the findings in it."""
    data = shared.traces.get(run).run
    folder = tempfile.TemporaryDirectory(prefix="droptower-export-", ignore_cleanup_errors=True)
    try:
        path = Path(folder.name) / f"{run}.{format}"
        if format == "csv":
            export_csv(data, path)
        else:
            export_nexus(data, answer_of(shared.store, run), path)
    except BaseException:
        folder.cleanup()
        raise
    kind = {"csv": "text/csv; charset=utf-8", "h5": "application/x-hdf5"}[format]
    name = f"{run}.csv" if format == "csv" else f"{run}.nexus.h5"
    return FileResponse(path, media_type=kind, filename=name, background=BackgroundTask(folder.cleanup))
