"""The list of runs, one run's answer, its files."""

import base64
import hashlib
import io
import json
import math
from typing import Any

import h5py
import httpx2
import pytest


def test_runs_come_newest_first_with_links_that_lead_somewhere(client: httpx2.Client, runs: list[str]) -> None:
    body = client.get("/api/v1/runs").json()
    assert [r["run"] for r in body["runs"]] == runs
    assert body["links"]["next"] is None
    for link in body["runs"][-1]["links"].values():
        assert client.get(link).status_code == 200


def test_pages_of_the_list_join_without_gap_or_double(client: httpx2.Client, runs: list[str]) -> None:
    seen: list[str] = []
    following: str | None = "/api/v1/runs?limit=2"
    pages = 0
    while following is not None:
        body = client.get(following).json()
        assert len(body["runs"]) <= 2
        seen += [r["run"] for r in body["runs"]]
        following = body["links"]["next"]
        pages += 1
    assert seen == runs
    assert pages == 3


def test_next_keeps_the_filters(client: httpx2.Client) -> None:
    body = client.get("/api/v1/runs", params={"series": "speed", "limit": 1}).json()
    assert [r["specimen"] for r in body["runs"]] == ["a-2"]
    body = client.get(body["links"]["next"]).json()
    assert [r["specimen"] for r in body["runs"]] == ["a-1"]
    assert body["links"]["next"] is None


@pytest.mark.parametrize(
    ("query", "found"),
    [
        ("specimen=b-1", ["b-1"]),
        ("material=PETG", ["a-2"]),
        ("batch=none", []),
        ("source=acquired", []),
        ("since=2020-01-01&series=other", ["b-1"]),
        ("since=2099-01-01T00:00:00Z", []),
    ],
)
def test_filters(client: httpx2.Client, query: str, found: list[str]) -> None:
    assert [r["specimen"] for r in client.get(f"/api/v1/runs?{query}").json()["runs"]] == found


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("limit=1001", ["limit", "1000"]),
        ("limit=0", ["limit"]),
        ("serie=x", ["'serie'", "did you mean 'series'"]),
        ("since=yesterday", ["since", "2026-11-20"]),
        ("after=../etc", ["after", "links.next"]),
        ("source=made-up", ["source", "acquired"]),
    ],
)
def test_a_wrong_query_is_told_with_the_limit_or_the_right_name(
    client: httpx2.Client, query: str, words: list[str]
) -> None:
    answer = client.get(f"/api/v1/runs?{query}")
    assert answer.status_code == 422
    text = answer.json()["error"]["text"]
    assert all(word in text for word in words), text


def test_a_run_tells_findings_conditions_and_links(client: httpx2.Client, runs: list[str]) -> None:
    body = client.get(f"/api/v1/runs/{runs[-1]}").json()
    assert body["findings"]["F_M"]["value"] == pytest.approx(1050, rel=0.01)
    assert body["findings"]["F_M"]["unit"] == "N"
    assert body["findings"]["v0"]["value"] == 2.0
    assert (body["specimen"], body["points"], body["series"]) == ("a-1", 6000, "speed")
    assert body["sample_rate_Hz"] == pytest.approx(1e6)
    assert body["conditions"]["dart"]["u_mass_kg"] == 0.0005
    for name, link in body["links"].items():
        assert client.get(link).status_code == 200, name


def _no_nan(text: str) -> Any:
    def refuse(name: str) -> float:
        raise AssertionError(f"{name} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_a_record_without_a_contact_is_answered_with_null_and_warnings(client: httpx2.Client, runs: list[str]) -> None:
    body = _no_nan(client.get(f"/api/v1/runs/{runs[1]}").text)
    assert body["findings"]["F_M"]["value"] is None
    assert body["warnings"]
    contact = _no_nan(client.get(f"/api/v1/runs/{runs[1]}/contact").text)
    assert contact["t"] == []


def test_contact_gives_the_loop(client: httpx2.Client, runs: list[str]) -> None:
    body = _no_nan(client.get(f"/api/v1/runs/{runs[-1]}/contact?points=500").text)
    lengths = {len(body[k]) for k in ("t", "force", "v", "alpha", "energy")}
    assert len(lengths) == 1
    assert 250 < lengths.pop() <= 500
    assert body["t"][0] == 0
    assert body["t"][-1] == pytest.approx(2.9e-3, rel=0.01)
    assert max(body["force"]) == pytest.approx(1050, rel=0.01)
    assert body["v"][0] == 2.0


@pytest.mark.parametrize("path", ["", "/force", "/envelope?format=json", "/contact", "/raw"])
def test_who_has_the_answer_is_told_304(client: httpx2.Client, runs: list[str], path: str) -> None:
    url = f"/api/v1/runs/{runs[-1]}{path}"
    etag = client.get(url).headers["etag"]
    again = client.get(url, headers={"If-None-Match": etag})
    assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", etag)
    assert client.get(url, headers={"If-None-Match": '"another"'}).status_code == 200


@pytest.mark.parametrize("run", ["20261120T100000Z-ffffff", "..%2F..%2Fetc", "nonsense", "catalog.sqlite"])
def test_an_unknown_run_is_404_with_words(client: httpx2.Client, run: str) -> None:
    for path in ("", "/force", "/envelope", "/contact", "/raw", "/export?format=h5"):
        answer = client.get(f"/api/v1/runs/{run}{path}")
        assert answer.status_code == 404
        assert set(answer.json()["error"]) == {"code", "text"}


def test_the_raw_file_comes_with_its_digest(client: httpx2.Client, runs: list[str]) -> None:
    answer = client.get(f"/api/v1/runs/{runs[0]}/raw")
    digest = hashlib.sha256(answer.content)
    assert answer.headers["repr-digest"] == f"sha-256=:{base64.b64encode(digest.digest()).decode()}:"
    listed = {r["run"]: r["sha256"] for r in client.get("/api/v1/runs").json()["runs"]}
    assert listed[runs[0]] == digest.hexdigest()


def test_exports_hold_every_sample(client: httpx2.Client, runs: list[str]) -> None:
    csv = client.get(f"/api/v1/runs/{runs[-1]}/export?format=csv").text.splitlines()
    assert csv[0] == "time_s,force_N"
    assert len(csv) == 6001
    with h5py.File(io.BytesIO(client.get(f"/api/v1/runs/{runs[-1]}/export").content)) as f:
        assert len(f["entry/trace/force"]) == 6000
        assert math.isclose(f["entry/analysis/results/F_M"][()], 1050, rel_tol=0.01)
    assert client.get(f"/api/v1/runs/{runs[-1]}/export?format=xls").status_code == 422


def test_the_fit_is_served_as_numbers_and_as_a_figure(client: httpx2.Client, runs: list[str]) -> None:
    run = next(r for r in runs if client.get(f"/api/v1/runs/{r}").json()["fit"] is not None)
    body = client.get(f"/api/v1/runs/{run}/fit").json()
    assert body["fit"]["parameters"]["E"]["unit"] == "Pa"
    other = client.get(f"/api/v1/runs/{run}/fit", params={"model": "conservative"}).json()
    assert other["fit"]["model"] == "conservative"
    assert client.get(f"/api/v1/runs/{run}").json()["fit"]["model"] != "conservative", (
        "the answer kept is the support's"
    )
    figure = client.get(f"/api/v1/runs/{run}/fit.svg")
    assert figure.headers["content-type"].startswith("image/svg+xml")
    assert figure.text.rstrip().endswith("</svg>")
    curves = client.get(f"/api/v1/runs/{run}/fit/curves").json()
    parts = curves["elements"]
    total = [sum(parts[k][i] for k in ("alpha_1", "alpha_2", "alpha_3")) for i in range(len(parts["t"]))]
    assert total == pytest.approx(parts["alpha"], abs=1e-8)
    assert len(curves["record"]["force"]) == len(curves["record"]["model"])
    again = client.get(f"/api/v1/runs/{run}/fit.svg", headers={"If-None-Match": figure.headers["etag"]})
    assert again.status_code == 304


def test_a_run_without_a_fit_says_why(client: httpx2.Client, runs: list[str]) -> None:
    run = next(r for r in runs if client.get(f"/api/v1/runs/{r}").json()["fit"] is None)
    body = client.get(f"/api/v1/runs/{run}/fit").json()
    assert body["fit"] is None
    assert "not-fitted" in [w["code"] for w in body["warnings"]]
    figure = client.get(f"/api/v1/runs/{run}/fit.svg")
    assert figure.status_code == 404
    assert figure.json()["error"]["code"] == "not-fitted"
