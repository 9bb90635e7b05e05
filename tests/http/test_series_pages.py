"""Series over HTTP and on their page."""

from __future__ import annotations

from collections.abc import Callable

import httpx2
from emulator import until
from playwright.sync_api import Page


def test_series_are_listed_with_links(client: httpx2.Client) -> None:
    found = client.get("/api/v1/series").json()["series"]
    assert "other" in {row["series"] for row in found}
    other = next(row for row in found if row["series"] == "other")
    assert other["runs"] == 1
    answer = client.get(other["links"]["self"]).json()
    assert answer["series"] == "other"
    assert len(answer["runs"]) == len(answer["groups"][0]["runs"]) == 1


def test_no_such_series_is_told_with_those_there_are(client: httpx2.Client) -> None:
    answer = client.get("/api/v1/series/nix")
    assert answer.status_code == 404
    assert "'other'" in answer.json()["error"]["text"]


def test_figures_tables_and_the_report(client: httpx2.Client) -> None:
    own = "/api/v1/series/other"
    drawn = client.get(f"{own}/figures/curves")
    assert drawn.headers["content-type"].startswith("image/svg+xml")
    assert client.get(f"{own}/figures/curves", headers={"If-None-Match": drawn.headers["etag"]}).status_code == 304
    assert client.get(f"{own}/figures/failure?format=png").content.startswith(b"\x89PNG")
    assert client.get(f"{own}/figures/nix").status_code == 404
    assert client.get(f"{own}/table").text.splitlines()[0].startswith("run,series,started")
    assert client.get(f"{own}/report", timeout=60).content.startswith(b"%PDF")


def test_the_page_of_a_series(served: tuple[str, list[str]], open_page: Callable[[str], Page]) -> None:
    page = open_page(f"{served[0]}/series/other")
    assert page.locator("h2").first.inner_text() == "other"
    assert "b-1" in page.locator("table").first.inner_text()
    pictures = page.locator("img[src*=figures]")
    for image in pictures.all():
        image.scroll_into_view_if_needed()
        # The page forbids eval, so no function is waited for.
        until(lambda image=image: image.evaluate("i => i.complete && i.naturalWidth > 0"), 60)
    assert pictures.count() == 5
    width = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert width <= 0


def test_a_correction_over_http_changes_the_answer_and_not_the_record(client: httpx2.Client, runs: list[str]) -> None:
    run = runs[0]
    before = client.get(f"/api/v1/runs/{run}").json()
    body = {"set": {"measured.failure_type": "YS"}, "author": "A", "reason": "seen"}
    made = client.post(f"/api/v1/runs/{run}/corrections", json=body)
    assert made.status_code == 201, made.text
    after = client.get(f"/api/v1/runs/{run}").json()
    assert after["findings"]["failure_type_operator"]["value"] == "YS"
    assert after["raw_sha256"] == before["raw_sha256"]
    assert after["corrections"] == ["test-0002.toml"]
    wrong = client.post(f"/api/v1/runs/{run}/corrections", json={**body, "set": {"dart.mass_kg": -1}})
    assert wrong.status_code == 422
    assert "mass_kg" in wrong.json()["error"]["text"]
