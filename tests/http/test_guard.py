"""Who may ask, and what an answer never shows."""

import os
import re
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest
from fastapi import FastAPI
from rigs import TEST, write_rig
from services import drop, publish, running

from api.http.assets import PACKAGED
from api.http.rendering import FOLDER
from api.http.service import create_app

TOKEN = "a-long-secret-of-the-bench"


@pytest.fixture
def locked(tmp_path: Path) -> Iterator[httpx2.Client]:
    """A client without the token of a service that wants one."""
    publish(tmp_path, [drop()])
    with running(create_app(tmp_path, token=TOKEN)) as address, httpx2.Client(base_url=address) as client:
        yield client


@pytest.fixture(scope="module")
def rigged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[FastAPI, str]]:
    """A service with a rig that nothing answers for, and its address."""
    folder = tmp_path_factory.mktemp("rigged")
    app = create_app(folder, write_rig(folder, "socket://127.0.0.1:1", "scpi"))
    with running(app) as address:
        yield app, address


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "127.0.0.2", "", "localhost@evil.example"])
def test_a_request_for_another_host_is_refused(client: httpx2.Client, host: str) -> None:
    assert client.get("/api/v1/runs", headers={"Host": host}).status_code == 400


@pytest.mark.parametrize(
    "headers",
    [
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site", "Origin": "http://127.0.0.1"},
    ],
)
@pytest.mark.parametrize("method", ["POST", "DELETE"])
def test_another_sites_page_cannot_arm_or_disarm(
    rigged: tuple[FastAPI, str], headers: dict[str, str], method: str
) -> None:
    app, address = rigged
    path = {"POST": "/api/v1/acquisitions", "DELETE": "/api/v1/acquisitions/current"}[method]
    answer = httpx2.request(method, f"{address}{path}", headers=headers, json={"test": TEST})
    assert (answer.status_code, answer.json()["error"]["code"]) == (403, "cross-site")
    assert app.state.service.bench.current is None


def test_every_answer_has_the_headers_that_keep_a_page_to_itself(client: httpx2.Client) -> None:
    for path in ("/", "/api/v1/runs", "/static/style.css", "/nothing", "/api/v1/runs?limit=0"):
        headers = client.get(path).headers
        assert "default-src 'self'" in headers["content-security-policy"]
        assert "script-src" not in headers["content-security-policy"], "scripts come under default-src, no exception"
        assert headers["x-content-type-options"] == "nosniff"
        assert "access-control-allow-origin" not in headers


@pytest.mark.parametrize("content", [b"x" * 300_000, iter([b"x" * 300_000])], ids=["length told", "not told"])
def test_a_body_too_large_is_refused(rigged: tuple[FastAPI, str], content: bytes) -> None:
    answer = httpx2.post(
        f"{rigged[1]}/api/v1/acquisitions", content=content, headers={"Content-Type": "application/json"}
    )
    assert answer.status_code == 413


@pytest.mark.parametrize(
    "path", ["/static/../service.py", "/static/%2e%2e/http/service.py", "/static//etc/passwd", "/static/"]
)
def test_static_files_are_all_that_static_gives(client: httpx2.Client, path: str) -> None:
    assert client.get(path).status_code == 404


def test_without_the_token_there_is_nothing_but_the_form(locked: httpx2.Client) -> None:
    answer = locked.get("/api/v1/runs")
    assert (answer.status_code, answer.headers["www-authenticate"]) == (401, "Bearer")
    assert "Authorization: Bearer" in answer.json()["error"]["text"]
    assert locked.get("/api/v1/runs", headers={"Authorization": "Bearer wrong"}).status_code == 401
    assert locked.get("/api/v1/openapi.json").status_code == 401
    for page in ("/", "/docs", "/definitions"):
        assert locked.get(page).headers["location"] == "/login"
    assert locked.get("/api/v1/runs", headers={"Authorization": f"Bearer {TOKEN}"}).status_code == 200


def test_the_form_gives_a_cookie_for_the_token(locked: httpx2.Client) -> None:
    assert "not the token" in locked.post("/login", data={"token": "wrong"}).text
    assert not locked.cookies
    answer = locked.post("/login", data={"token": TOKEN})
    cookie = answer.headers["set-cookie"]
    assert answer.status_code == 303
    assert "HttpOnly" in cookie
    assert "samesite=strict" in cookie.lower()
    assert TOKEN not in cookie
    assert locked.get("/api/v1/runs").status_code == 200


def test_an_error_nobody_foresaw_shows_no_inside(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    app = create_app(tmp_path)
    app.state.service.catalog = None
    with running(app) as address:
        answer = httpx2.get(f"{address}/api/v1/runs")
    assert answer.status_code == 500
    assert answer.json()["error"]["code"] == "internal"
    assert "Traceback" not in answer.text
    assert ".py" not in answer.text
    assert "runs.py" in caplog.text


def test_a_folder_that_cannot_be_read_is_503(tmp_path: Path) -> None:
    run = publish(tmp_path, [drop()])[0]
    raw = tmp_path / "runs" / run / "raw.h5"
    os.chmod(raw, 0o644)  # noqa: PTH101  the file is read-only by design; this is the damage
    raw.write_bytes(raw.read_bytes()[:3000])
    with running(create_app(tmp_path)) as address:
        answer = httpx2.get(f"{address}/api/v1/runs/{run}")
        page = httpx2.get(f"{address}/runs/{run}", headers={"Accept": "text/html"})
        listed = httpx2.get(f"{address}/", headers={"Accept": "text/html"})
    assert answer.status_code == page.status_code == 503
    assert run in answer.json()["error"]["text"]
    assert "verify" in page.text
    assert listed.status_code == 200


def test_no_page_and_no_file_of_ours_loads_anything_from_elsewhere(client: httpx2.Client, runs: list[str]) -> None:
    own = [p for folder in ("templates", "static") for p in (FOLDER / folder).iterdir()]
    pages = [client.get(p).text for p in ("/", f"/runs/{runs[0]}", "/docs", "/definitions")]
    for text in [*pages, *(p.read_text() for p in own)]:
        found = re.findall(r"(?:https?:)?//[a-z0-9-]+\.[a-z][^\s\"']*", text.replace("http://www.w3.org/2000/svg", ""))
        assert found == []
        assert "<script>" not in text
        assert not re.search(r"\son[a-z]+=", text), "the policy allows no inline script"
    for name in PACKAGED:
        assert client.get(f"/static/{name}").status_code == 200
        assert not (FOLDER / "static" / name).exists(), "it comes from its installed package"
