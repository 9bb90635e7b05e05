"""Routes of samples: force in any form, its envelope for plots, the kinematics of the contact."""

import json
from typing import Annotated

import numpy as np
from fastapi import APIRouter, Depends, Query, Request
from fastapi.responses import JSONResponse, Response
from numpy.typing import NDArray

from api.answer import kinematics_of
from api.http.caching import tag, tagged, unchanged
from api.http.errors import Refusal
from api.http.formats import WRITERS, Samples, chosen, written
from api.http.queries import only_known, part_of
from api.http.rendering import numbers
from api.http.shared import Shared
from daq.run_file import envelope

RAW_BELOW = 20_000
"""A slice of fewer samples needs no envelope."""
router = APIRouter(tags=["samples"], dependencies=[Depends(only_known)])
Slice = Annotated[str | None, Query(description="start:stop or start:stop:step in samples, as in Python")]
Points = Annotated[int, Query(ge=10, le=20_000, description="Values to give at most")]
Form = Annotated[str | None, Query(description="Overrides Accept")]


@router.get("/runs/{run}/force")
def get_force(
    request: Request,
    shared: Shared,
    run: str,
    slice: Slice = None,
    format: Form = None,
    points: Annotated[
        int | None,
        Query(ge=1, description="Values to give at most: every n-th is taken. Peaks between are lost, see envelope"),
    ] = None,
) -> Response:
    """Sensor force in N as json, csv, npy (float64) or octet-stream (little-endian float32).

    Value i stands at (start + i·step)·dt seconds after the first sample; dt, start and step are in the body or, in
    forms without words, in the headers Droptower-Dt, -Start and -Step.
    """
    form = chosen(request, format, WRITERS)
    trace = shared.traces.get(run)
    part = part_of(slice, len(trace.force))
    if points is not None and len(part) > points:
        part = part[:: -(-len(part) // points)]
    etag = tag(trace.sha256, "force", part, form)
    if (same := unchanged(request, etag)) is not None:
        return same
    samples = Samples(run, trace.run.dt, part.start, part.step, _take(trace.force, part))
    return tagged(written(samples, form), etag)


@router.get("/runs/{run}/envelope")
def get_envelope(
    request: Request, shared: Shared, run: str, slice: Slice = None, points: Points = 2000, format: Form = None
) -> Response:
    """Least and greatest force of each stretch of the slice: a picture in which no peak is missed.

    octet-stream (the default): pairs of little-endian float32, index and force in N; json: `index` and `values`.
    The index counts from the slice's first sample: time is (start + index)·dt. Below 20,000 samples in the slice all
    of them come back, and `raw` (header Droptower-Raw) is true.
    """
    form = chosen(request, format, ("octet-stream", "json"))
    trace = shared.traces.get(run)
    part = part_of(slice, len(trace.force))
    if part.step != 1:
        raise Refusal(422, "wrong-slice", "query slice: an envelope is taken of every sample; leave the step out")
    etag = tag(trace.sha256, "envelope", part, points, form)
    if (same := unchanged(request, etag)) is not None:
        return same
    values = _take(trace.force, part)
    raw = len(values) < RAW_BELOW
    index = np.arange(len(values), dtype=np.int64) if raw else envelope(values, points)
    if form == "json":
        body = {
            "run": run, "unit": "N", "dt": trace.run.dt, "start": part.start, "samples": len(values), "raw": raw,
            "index": index.tolist(), "values": numbers(values[index]),
        }  # fmt: skip
        return tagged(JSONResponse(body), etag)
    headers = Samples(run, trace.run.dt, part.start, 1, values).headers()
    headers |= {"Droptower-Samples": str(len(values)), "Droptower-Raw": json.dumps(raw)}
    pairs = np.column_stack([index, values[index]]).astype("<f4")
    return tagged(Response(pairs.tobytes(), media_type="application/octet-stream", headers=headers), etag)


@router.get("/runs/{run}/contact")
def get_contact(request: Request, shared: Shared, run: str, points: Points = 2000) -> Response:
    """Time from first contact, contact force, speed, displacement and energy; every n-th sample and the last.

    Empty where the run has no contact; null where v0 is not known.
    """
    trace = shared.traces.get(run)
    etag = tag(trace.sha256, "contact", points)
    if (same := unchanged(request, etag)) is not None:
        return same
    found = kinematics_of(trace.run)
    n = len(found.t)
    stride = max(1, -(-n // (points - 1)))
    index = np.unique(np.append(np.arange(0, n, stride), n - 1)) if n else np.empty(0, dtype=np.int64)
    arrays = {k: numbers(getattr(found, k)[index]) for k in ("t", "force", "v", "alpha", "energy")}
    units = {"t": "s", "force": "N", "v": "m/s", "alpha": "m", "energy": "J"}
    return tagged(JSONResponse({"run": run, "units": units, "stride": stride, **arrays}), etag)


def _take(force: NDArray[np.float64], part: range) -> NDArray[np.float64]:
    return force[part.start : part.stop : part.step]
