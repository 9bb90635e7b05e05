"""The forms in which samples are given out, and the choice between them: `format=` over Accept."""

import io
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from fastapi import Request
from fastapi.responses import Response
from numpy.typing import NDArray

from api.http.errors import Refusal
from api.http.rendering import numbers

TEXT_CAP = 200_000
"""Samples that an answer in text may hold."""
TYPES = {
    "json": "application/json",
    "csv": "text/csv",
    "npy": "application/x-npy",
    "octet-stream": "application/octet-stream",
}


@dataclass(frozen=True)
class Samples:
    """Sensor force in N; value i stands at (start + i·step)·dt after the first sample of the record."""

    run: str
    dt: float
    start: int
    step: int
    values: NDArray[np.float64]

    def headers(self) -> dict[str, str]:
        """What a form without room for words needs beside it."""
        return {
            "Droptower-Dt": repr(self.dt),
            "Droptower-Start": str(self.start),
            "Droptower-Step": str(self.step),
            "Droptower-Unit": "N",
        }


def chosen(request: Request, asked: str | None, offered: Iterable[str]) -> str:
    """The form to answer in, the first of `offered` if any will do.

    Raises
    ------
    Refusal : 406, none of them is asked for; the message lists what there is.
    """
    names = list(offered)
    if asked is not None:
        found = next((n for n in names if asked.lower() in (n, TYPES[n])), None)
    else:
        found = _accepted(request.headers.get("accept", "*/*"), names)
    if found is None:
        wanted = f"format {asked!r}" if asked is not None else f"Accept: {request.headers.get('accept', '')[:100]}"
        there = ", ".join(f"{n} ({TYPES[n]})" for n in names)
        raise Refusal(406, "no-such-format", f"{wanted} is not to be had here; there is {there}")
    return found


def _accepted(header: str, names: list[str]) -> str | None:
    best: tuple[float, int, int] | None = None
    for position, name in enumerate(names):
        kind = TYPES[name]
        ranks = [(s, q) for s, q in (_fit(entry, kind) for entry in header.split(",")) if s]
        if not ranks:
            continue
        specific, quality = max(ranks)
        rank = (quality, specific, -position)
        if quality > 0 and (best is None or rank > best):
            best = rank
    return None if best is None else names[-best[2]]


def _fit(entry: str, kind: str) -> tuple[int, float]:
    """How closely an entry of Accept names a media type (0: not at all), and how much it is wanted."""
    wanted, *settings = [part.strip().lower() for part in entry.split(";")]
    quality = 1.0
    for setting in settings:
        if setting.startswith("q="):
            try:
                quality = float(setting[2:])
            except ValueError:
                quality = 0.0
    closeness = {"*/*": 1, f"{kind.partition('/')[0]}/*": 2, kind: 3}
    return closeness.get(wanted, 0), quality


def _json(samples: Samples) -> bytes:
    head = {"run": samples.run, "unit": "N", "dt": samples.dt, "start": samples.start, "step": samples.step}
    return json.dumps({**head, "values": numbers(samples.values)}, allow_nan=False).encode()


def _csv(samples: Samples) -> bytes:
    time = (samples.start + np.arange(len(samples.values)) * samples.step) * samples.dt
    text = io.StringIO()
    table = np.column_stack([time, samples.values])
    np.savetxt(text, table, delimiter=",", header="time_s,force_N", comments="", fmt="%.10g")
    return text.getvalue().encode()


def _npy(samples: Samples) -> bytes:
    file = io.BytesIO()
    np.save(file, samples.values)
    return file.getvalue()


def _octets(samples: Samples) -> bytes:
    return samples.values.astype("<f4").tobytes()


WRITERS: dict[str, Callable[[Samples], bytes]] = {"json": _json, "csv": _csv, "npy": _npy, "octet-stream": _octets}


def written(samples: Samples, form: str) -> Response:
    """The samples in a form of WRITERS.

    Raises
    ------
    Refusal : 413, too many for a text.
    """
    if form in ("json", "csv") and len(samples.values) > TEXT_CAP:
        raise Refusal(
            413,
            "too-many-samples",
            f"{len(samples.values)} samples as {form}: the limit is {TEXT_CAP}. Take a part by slice=start:stop, all "
            f"of them by format=npy or format=octet-stream, or a picture of them by …/envelope",
        )
    kind = TYPES[form] + ("; charset=utf-8" if form == "csv" else "")
    return Response(WRITERS[form](samples), media_type=kind, headers=samples.headers())
