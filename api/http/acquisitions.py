"""Routes of the rig: arm by POST, follow by GET, disarm by DELETE. There are none without a rig file."""

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import APIRouter, Depends, Request
from fastapi.responses import JSONResponse, Response, StreamingResponse
from pydantic import BaseModel, ConfigDict, Field

from api.http.bench import Bench, after, told
from api.http.errors import Refusal
from api.http.links import ACQUISITION, CURRENT
from api.http.queries import only_known
from api.http.rendering import plain
from api.http.shared import Service, Shared
from api.process import Acquisition

LOOK_S = 0.03
KEEP_ALIVE_S = 15.0
router = APIRouter(tags=["rig"], dependencies=[Depends(only_known)], prefix="/acquisitions")


class Order(BaseModel):
    """One drop: the text of its test file (TOML), the series it belongs to, and whether its specimen is hit again."""

    model_config = ConfigDict(extra="forbid", strict=True)

    test: str
    series: Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\s\-\x00-\x1f][^\x00-\x1f]*$")] | None = (
        None
    )
    again: bool = False


def bench_of(shared: Shared) -> Bench:
    """The bench, where there is one."""
    if shared.bench is None:
        raise Refusal(
            404, "no-rig", "this service has no rig: start it as `droptower serve --data DIR --rig RIG.toml` to arm one"
        )
    return shared.bench


OfBench = Annotated[Bench, Depends(bench_of)]


@router.post("", status_code=202)
def arm(bench: OfBench, order: Order) -> Response:
    """Configure the recorder and arm it for one drop."""
    bench.start(order.test, order.series, order.again)
    return JSONResponse({"links": ACQUISITION}, 202, headers={"Location": CURRENT})


@router.post("/recovery", status_code=202)
def recover(bench: OfBench) -> Response:
    """Save the record that the recorder still holds of a drop that was cut short, and release the recorder."""
    bench.recover()
    return JSONResponse({"links": ACQUISITION}, 202, headers={"Location": CURRENT})


@router.get("/current")
def current(bench: OfBench) -> Response:
    """State and events of the drop that is running, or was last."""
    return JSONResponse(plain({"links": ACQUISITION, **bench.state()}))


@router.delete("/current", status_code=202)
def disarm(bench: OfBench) -> Response:
    """Disarm. A record whose trigger has come is read and saved all the same."""
    bench.disarm()
    return JSONResponse(plain({"links": ACQUISITION, **bench.state()}), 202)


@router.get("/current/events", response_class=StreamingResponse)
async def events(request: Request, shared: Shared, bench: OfBench) -> Response:
    """Server-Sent Events: each event of the drop from its first on, with the `state` it leads to, until it is over.

    204 if there was none since the service started.
    """
    acquisition = bench.current
    if acquisition is None:
        return Response(status_code=204)  # tells a browser not to ask again
    last = request.headers.get("last-event-id", "")
    seen = int(last) + 1 if last.isdecimal() and len(last) < 10 else 0
    headers = {"Cache-Control": "no-store"}
    return StreamingResponse(_stream(shared, acquisition, seen), media_type="text/event-stream", headers=headers)


async def _stream(shared: Service, acquisition: Acquisition, seen: int) -> AsyncIterator[str]:
    """Looks instead of waiting: a follower that blocks would hold a thread for as long as the rig stays armed."""
    quiet, state = 0.0, told(acquisition.events[:seen])["state"]
    while not shared.closing:
        done = acquisition.done
        news: list[dict[str, Any]] = acquisition.events[seen:]
        for event in news:
            state = after(state, event)
            yield f"id: {seen}\ndata: {json.dumps({**event, 'state': state})}\n\n"
            seen += 1
        if done:
            return
        quiet = 0.0 if news else quiet + LOOK_S
        if quiet > KEEP_ALIVE_S:
            quiet = 0.0
            yield ": still here\n\n"
        await asyncio.sleep(LOOK_S)
