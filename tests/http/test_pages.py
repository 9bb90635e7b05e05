"""The pages in a real browser."""

from collections.abc import Callable
from pathlib import Path

from emulator import Emulator
from fastapi import FastAPI
from playwright.sync_api import Page, expect
from rigs import TEST, write_rig
from services import LONG, SPIKE, drop, publish

from api.http.service import create_app

Open = Callable[[str], Page]
Serve = Callable[[FastAPI], str]


def test_the_list_shows_runs_and_analyses_the_rest(open_page: Open, serve_app: Serve, tmp_path: Path) -> None:
    ids = publish(tmp_path, [drop(i, specimen__id=f"s-{i}") for i in range(3)])
    address = serve_app(create_app(tmp_path))
    page = open_page(address)
    expect(page.locator("#runs tbody tr")).to_have_count(3)
    expect(page.locator("#runs tbody tr").first).to_contain_text(ids[0])
    expect(page.locator("[data-unanalysed]")).to_have_count(0)
    expect(page.locator("#runs tbody tr").last).to_contain_text("2.000")
    page.get_by_label("Specimen").fill("s-1")
    page.get_by_role("button", name="Filter").click()
    expect(page.locator("#runs tbody tr")).to_have_count(1)
    page.get_by_role("link", name=ids[1]).click()
    expect(page.locator("h1")).to_contain_text("s-1")


def test_a_run_is_drawn_with_its_findings(open_page: Open, served: tuple[str, list[str]]) -> None:
    address, runs = served
    page = open_page(f"{address}/runs/{runs[-1]}")
    for plot in ("#force", "#alpha", "#loop"):
        expect(page.locator(f"{plot}.js-plotly-plot .scatterlayer path.js-line")).to_have_count(1)
        assert page.evaluate(f"document.querySelector('{plot}').data[0].x.length") > 100
    row = page.locator("tr#F_M")
    expect(row).to_contain_text("maximum force")
    expect(row.locator("td").last).to_have_text("N")
    expect(page.locator("tr#t_c td").last).to_have_text("ms")
    assert page.locator("tr#F_M a").get_attribute("title")
    expect(page.get_by_text("Unchanged")).to_be_visible()
    expect(page.locator(".conditions")).to_contain_text("mass_kg")
    with page.expect_download() as download:
        page.get_by_role("link", name="CSV").click()
    assert download.value.path().read_text().startswith("time_s,force_N")


def test_zoom_fetches_what_is_in_view(open_page: Open, served: tuple[str, list[str]]) -> None:
    address, runs = served
    page = open_page(f"{address}/runs/{runs[0]}")
    page.get_by_role("button", name="Whole record").click()
    expect(page.locator("#force")).to_have_attribute("data-loaded", f"0:{LONG}")
    assert page.evaluate("Math.max(...document.querySelector('#force').data[0].y)") == 2000
    assert page.evaluate("document.querySelector('#force').data[0].x.length") <= 4000
    box = page.locator("#force .nsewdrag").bounding_box()
    assert box is not None
    with page.expect_response(lambda r: "/envelope?" in r.url):
        middle = box["y"] + box["height"] / 2
        place = box["x"] + box["width"] * SPIKE / LONG
        page.mouse.move(place - 10, middle)
        page.mouse.down()
        page.mouse.move(place + 10, middle, steps=4)
        page.mouse.up()
    expect(page.locator("#force")).not_to_have_attribute("data-loaded", f"0:{LONG}")
    found = page.evaluate("(({x, y}) => [x.length, Math.max(...y)])(document.querySelector('#force').data[0])")
    assert found[0] > 5000, "samples instead of an envelope"
    assert found[1] == 2000


def test_warnings_are_words(open_page: Open, served: tuple[str, list[str]]) -> None:
    address, runs = served
    page = open_page(f"{address}/runs/{runs[1]}")
    expect(page.get_by_role("region", name="Warnings")).to_be_visible()
    expect(page.get_by_text("No contact was found")).to_have_count(2)


def test_the_docs_are_drawn_from_what_is_installed(open_page: Open, served: tuple[str, list[str]]) -> None:
    page = open_page(f"{served[0]}/docs")
    expect(page.locator("#swagger")).to_contain_text("/api/v1/runs/{run}/envelope")


def test_an_empty_folder_says_what_to_do(open_page: Open, serve_app: Serve, tmp_path: Path) -> None:
    address = serve_app(create_app(tmp_path / "new"))
    page = open_page(address)
    expect(page.get_by_text("droptower import")).to_be_visible()
    expect(page.get_by_text("droptower acquire")).to_be_visible()
    publish(tmp_path / "new", [drop()])
    expect(page.locator("#newest .js-plotly-plot")).to_be_visible(timeout=8000)


def test_at_the_bench_a_drop_is_armed_dropped_and_on_screen(
    open_page: Open, serve_app: Serve, tmp_path: Path, tower: Emulator
) -> None:
    tower.fresh()
    rig = write_rig(tmp_path, tower.endpoints["scpi_tcp"], "scpi")
    app = create_app(tmp_path / "data", rig)
    address = serve_app(app)
    page = open_page(address)
    banner = page.locator("#banner")
    expect(banner).to_contain_text("NOT ARMED")
    page.get_by_label("Test file").fill(TEST)
    page.locator("#order").get_by_label("Series").fill("bench")
    page.get_by_role("button", name="ARM", exact=True).click()
    expect(banner).to_contain_text("ARMED – DROP NOW", timeout=15_000)
    expect(page.get_by_role("button", name="ARM", exact=True)).to_be_disabled()
    page.get_by_role("button", name="DISARM").click()
    expect(banner).to_contain_text("DISARMED", timeout=15_000)
    page.get_by_role("button", name="ARM", exact=True).click()
    expect(banner).to_contain_text("ARMED – DROP NOW", timeout=15_000)
    tower.do("release")
    expect(banner).to_contain_text("SAVED", timeout=15_000)
    run = app.state.service.store.runs()[-1]
    expect(banner).to_contain_text(run)
    expect(page.locator("#newest .js-plotly-plot .scatterlayer path.js-line")).to_have_count(1)
    expect(page.locator("#newest .js-plotly-plot")).to_have_attribute("data-run", run)
    expect(page.locator("#runs tbody tr")).to_have_count(1)
    app.state.service.bench.current.result()


def test_the_bench_shows_what_is_told_and_the_contact_before_the_rest(
    open_page: Open, serve_app: Serve, tmp_path: Path
) -> None:
    with Emulator("--seed", "7", "--baud", "460800") as tower:
        tower.do("catcher", on=True)
        tower.do("height", v0=1.39)
        rig = write_rig(tmp_path, tower.endpoints["scpi_pty"], "scpi", samples=100_000)
        app = create_app(tmp_path / "data", rig)
        page = open_page(serve_app(app))
        banner = page.locator("#banner")
        page.get_by_label("Test file").fill(TEST)
        page.get_by_role("button", name="ARM", exact=True).click()
        expect(banner).to_contain_text("ARMED – DROP NOW", timeout=15_000)
        expect(page.get_by_role("list", name="Told before arming")).to_contain_text("the catcher is on")
        tower.do("release")
        expect(page.locator("#early")).to_contain_text("F_M 71", timeout=15_000)
        expect(page.locator("#pace")).to_contain_text("kB/s")
        expect(banner).to_have_attribute("data-state", "reading")
        expect(banner).to_contain_text("SAVED", timeout=15_000)
        expect(page.locator("#early")).to_be_hidden()
        app.state.service.bench.current.result()
        # The specimen was hit: the page asks, and takes no for an answer.
        asked: list[str] = []
        page.on("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
        page.get_by_role("button", name="ARM", exact=True).click()
        expect(page.locator("#order-error")).to_contain_text("was hit before")
        assert "Hit it again?" in asked[0]


def test_the_bench_hits_a_specimen_again_if_it_is_told_to(
    open_page: Open, serve_app: Serve, tmp_path: Path, tower: Emulator
) -> None:
    tower.fresh()
    publish(tmp_path / "data", [drop(specimen__id="s-1")])
    app = create_app(tmp_path / "data", write_rig(tmp_path, tower.endpoints["scpi_tcp"], "scpi"))
    page = open_page(serve_app(app))
    page.on("dialog", lambda dialog: dialog.accept())
    page.get_by_label("Test file").fill(TEST)
    page.get_by_role("button", name="ARM", exact=True).click()
    expect(page.locator("#banner")).to_contain_text("ARMED – DROP NOW", timeout=15_000)
    app.state.service.bench.current.abort()
    app.state.service.bench.current.result()
