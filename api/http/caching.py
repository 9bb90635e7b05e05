"""ETag and 304: who has a run's answer already is told so, and nothing is sent twice."""

import hashlib
from importlib.metadata import version

from fastapi import Request
from fastapi.responses import Response

from api.http.traces import Trace
from daq.store import Store


def tag(*parts: object) -> str:
    """The ETag of what these parts, and this version of the software, make."""
    text = "\n".join([version("droptower"), *map(str, parts)])
    return f'"{hashlib.sha256(text.encode()).hexdigest()[:32]}"'


def tag_of_folder(store: Store, trace: Trace) -> str:
    """The ETag of a run and all that stands beside it; every file there is written once, so that names are enough."""
    folder = store.raw(trace.run.run).parent
    return tag(trace.sha256, *sorted(p.name for p in folder.iterdir() if not p.name.startswith(".")))


def unchanged(request: Request, etag: str) -> Response | None:
    """304 if the asker has this already."""
    header = request.headers.get("if-none-match", "")
    held = {t.strip().removeprefix("W/") for t in header.split(",")}
    if etag in held or "*" in held:
        return Response(status_code=304, headers={"ETag": etag, "Vary": "Accept"})
    return None


def tagged(response: Response, etag: str) -> Response:
    """The response with its ETag."""
    response.headers["ETag"] = etag
    response.headers["Vary"] = "Accept"
    return response
