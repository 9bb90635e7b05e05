"""Arming, following and disarming over HTTP, against the emulator."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx2
import pytest
from emulator import Emulator, until
from fastapi import FastAPI
from rigs import TEST, Daq, write_rig, write_test
from services import running

from api.http.bench import told
from api.http.service import create_app
from daq.lock import RigLock
from daq.rig_file import load_rig

PATH = "/api/v1/acquisitions"


@pytest.fixture
def app(tmp_path: Path, tower: Emulator) -> Iterator[FastAPI]:
    tower.fresh()
    app = create_app(tmp_path / "data", write_rig(tmp_path, tower.endpoints["scpi_tcp"], "scpi"))
    yield app
    if (current := app.state.service.bench.current) is not None:
        current.abort()
        current.result()


@pytest.fixture
def bench(app: FastAPI) -> Iterator[httpx2.Client]:
    with running(app) as address, httpx2.Client(base_url=address, timeout=20) as client:
        yield client


def state(bench: httpx2.Client, wanted: str) -> dict[str, Any]:
    """The state once it is as wanted."""

    def look() -> dict[str, Any] | None:
        now = bench.get(f"{PATH}/current").json()
        assert now["state"] == wanted or not now["done"], now
        return now if now["state"] == wanted else None

    return until(look, limit=20, what=f"state {wanted}")


def follow(bench: httpx2.Client, **headers: str) -> Iterator[dict[str, Any]]:
    with bench.stream("GET", f"{PATH}/current/events", headers=headers) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        for line in answer.iter_lines():
            if line.startswith("data: "):
                yield json.loads(line.removeprefix("data: "))


def test_arm_drop_and_the_run_is_there(bench: httpx2.Client, tower: Emulator) -> None:
    assert bench.get(f"{PATH}/current").json()["state"] == "idle"
    assert bench.get(f"{PATH}/current/events").status_code == 204
    answer = bench.post(PATH, json={"test": TEST, "series": "bench"})
    assert answer.status_code == 202
    assert answer.headers["location"] == answer.json()["links"]["self"]
    second = bench.post(PATH, json={"test": TEST})
    assert (second.status_code, second.json()["error"]["code"]) == (409, "rig-busy")
    truth, events = None, []
    for event in follow(bench):
        events.append(event)
        if event["event"] == "armed":
            truth = tower.do("release")["truth"]
    assert truth is not None
    assert [e["state"] for e in events if e["event"] in ("armed", "saved", "done")] == ["armed", "saved", "saved"]
    run = bench.get(bench.get(f"{PATH}/current").json()["links"]["run"]).json()
    assert (run["series"], run["specimen"]) == ("bench", "s-1")
    assert run["findings"]["F_M"]["value"] == pytest.approx(truth["F_M"], rel=0.02)
    again = list(follow(bench, **{"Last-Event-ID": str(len(events) - 3)}))
    assert again == events[-2:]


def test_disarm_by_delete(bench: httpx2.Client, tower: Emulator) -> None:
    bench.post(PATH, json={"test": TEST})
    state(bench, "armed")
    assert bench.delete(f"{PATH}/current").status_code == 202
    now = state(bench, "disarmed")
    assert now["run"] is None or now["links"]["run"] is None
    until(lambda: bench.get(f"{PATH}/current").json()["done"])
    assert tower.do("status")["state"] == "idle"
    assert bench.get("/api/v1/runs").json()["runs"] == []


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ({"test": "[dart]\nmas_kg = 1"}, "mass_kg"),
        ({"test": "no = toml = at all"}, "TOML"),
        ({}, "test"),
        ({"test": TEST, "series": "--rig"}, "series"),
        ({"test": TEST, "serie": "x"}, "serie"),
    ],
)
def test_a_wrong_order_arms_nothing(bench: httpx2.Client, order: dict[str, str], words: str) -> None:
    answer = bench.post(PATH, json=order)
    assert answer.status_code == 422
    assert words in answer.json()["error"]["text"]
    assert bench.get(f"{PATH}/current").json()["state"] == "idle"


def test_nothing_is_armed_by_get(bench: httpx2.Client) -> None:
    assert bench.get(PATH).status_code == 405
    assert bench.get(f"{PATH}/current").json()["events"] == []


def test_a_service_that_ends_stops_no_drop(app: FastAPI, tower: Emulator) -> None:
    with running(app) as address, httpx2.Client(base_url=address) as bench:
        bench.post(PATH, json={"test": TEST})
        state(bench, "armed")
        follower = follow(bench)
        next(follower)
        app.state.service.closing = True
        list(follower)  # its stream ends with the service, or the service would never end
    tower.do("release")
    assert app.state.service.bench.current.result()["event"] == "done"
    assert len(app.state.service.store.runs()) == 1


def test_what_a_killed_acquisition_left_is_saved_on_request(
    bench: httpx2.Client, tmp_path: Path, tower: Emulator
) -> None:
    killed = Daq("acquire", tmp_path / "rig.toml", tmp_path / "data", "--test", str(write_test(tmp_path)))
    run = killed.until("armed")["run"]
    killed.kill()
    killed.close()
    tower.do("release")
    until(lambda: tower.do("status")["state"] == "held", what="the recorder holds the record")
    assert bench.post(f"{PATH}/recovery").status_code == 202
    assert state(bench, "saved")["run"] == run
    until(lambda: bench.get(f"{PATH}/current").json()["done"])
    assert bench.get(f"/api/v1/runs/{run}").status_code == 200
    bench.post(f"{PATH}/recovery")
    state(bench, "idle")


def test_a_rig_that_another_process_holds_is_shown_and_not_armed(bench: httpx2.Client, tmp_path: Path) -> None:
    with RigLock(load_rig(tmp_path / "rig.toml")[0], "acquire"):
        now = bench.get(f"{PATH}/current").json()
        assert now["state"] == "busy"
        assert "held by process" in now["text"]
        answer = bench.post(PATH, json={"test": TEST})
        assert (answer.status_code, answer.json()["error"]["code"]) == (409, "rig-busy")
    assert bench.get(f"{PATH}/current").json()["state"] == "idle"


def test_without_a_rig_the_routes_say_how_to_get_one(client: httpx2.Client) -> None:
    for method, path in (("POST", PATH), ("GET", f"{PATH}/current"), ("DELETE", f"{PATH}/current")):
        answer = client.request(method, path, json={"test": TEST} if method == "POST" else None)
        assert answer.status_code == 404
        assert "--rig" in answer.json()["error"]["text"]


def test_states_follow_the_events() -> None:
    def after(*events: dict[str, Any]) -> str:
        return told(list(events))["state"]

    assert after() == "starting"
    assert after({"event": "armed"}, {"event": "gate-silent"}) == "armed"
    assert after({"event": "failed", "outcome": "aborted"}) == "disarmed"
    assert after({"event": "failed", "outcome": "interlock"}) == "failed"
    assert after({"event": "saved", "run": "r"}, {"event": "done", "run": "r"}) == "saved"
    assert told([{"event": "progress", "done": 3, "total": 9}])["progress"]["done"] == 3
