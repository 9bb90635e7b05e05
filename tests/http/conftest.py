"""A service over a handful of runs, and a real browser."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import httpx2
import numpy as np
import pytest
from emulator import Emulator
from fastapi import FastAPI
from playwright.sync_api import Browser, Page
from services import LONG, SPIKE, drop, publish, run_of, running

from api.http.service import create_app


@pytest.fixture(scope="session")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, list[str]]]:
    """Address and runs, newest first, of a service over three drops, a flat record and a long one with one spike."""
    folder = tmp_path_factory.mktemp("served")
    long = np.random.default_rng(1).integers(-3, 4, LONG)
    long[SPIKE] = 4000
    runs = [
        drop(1, specimen__id="a-1"), drop(2, specimen__id="a-2", specimen__material="PETG"),
        drop(3, series="other", specimen__id="b-1"), run_of(np.zeros(5000), series=None, specimen__id="flat"),
        run_of(long, series=None, specimen__id="long"),
    ]  # fmt: skip
    ids = publish(folder, runs)
    with running(create_app(folder)) as address:
        yield address, ids


@pytest.fixture
def runs(served: tuple[str, list[str]]) -> list[str]:
    return served[1]


@pytest.fixture
def client(served: tuple[str, list[str]]) -> Iterator[httpx2.Client]:
    with httpx2.Client(base_url=served[0], timeout=20) as client:
        yield client


@pytest.fixture
def serve_app() -> Iterator[Callable[[FastAPI], str]]:
    """Serves an application for as long as the test's page is open, and gives its address."""
    with ExitStack() as open_services:
        yield lambda app: open_services.enter_context(running(app))


@pytest.fixture
def open_page(browser: Browser, serve_app: object) -> Iterator[Callable[[str], Page]]:
    """Opens an address; whatever the console complained of, or was loaded from elsewhere, fails the test at its end."""
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    complaints: list[str] = []
    asked: list[str] = []
    # A request that is answered 409 is a question to the operator; the browser complains of it all the same.
    page.on(
        "console",
        lambda m: complaints.append(m.text) if m.type in ("error", "warning") and "409" not in m.text else None,
    )
    page.on("pageerror", lambda e: complaints.append(str(e)))
    page.on("request", lambda r: asked.append(r.url))

    def go(address: str) -> Page:
        page.goto(address)
        return page

    yield go
    home = page.url.split("/", 3)[2]
    page.close()
    assert complaints == []
    assert [url for url in asked if not url.startswith((f"http://{home}/", "data:", "blob:"))] == []


@pytest.fixture(scope="session")
def tower() -> Iterator[Emulator]:
    with Emulator() as emulator:
        yield emulator
