"""What the routes of one service share."""

from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request

from api.http.bench import Bench
from api.http.traces import Traces
from daq.catalog import Catalog
from daq.store import Store


@dataclass
class Service:
    """A data folder being served; `bench` is there if a rig file was given. `closing` is set when the server stops."""

    store: Store
    catalog: Catalog
    traces: Traces
    bench: Bench | None
    closing: bool = False


def service_of(request: Request) -> Service:
    """The service that a request came to."""
    return request.app.state.service


Shared = Annotated[Service, Depends(service_of)]
