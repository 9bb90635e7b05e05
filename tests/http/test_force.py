"""Samples: slices as in Python, every form, limits that name the way out, envelopes that miss no peak."""

import io

import httpx2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from records import half_sine
from services import LONG, SPIKE

from api.http.samples import RAW_BELOW
from daq.run_file import envelope


@pytest.fixture
def url(runs: list[str]) -> str:
    return f"/api/v1/runs/{runs[-1]}/force"


@pytest.fixture
def whole(client: httpx2.Client, url: str) -> np.ndarray:
    return np.load(io.BytesIO(client.get(url, params={"format": "npy"}).content))


def test_force_is_what_was_recorded_in_newtons(whole: np.ndarray) -> None:
    assert whole.dtype == np.float64
    assert np.abs(whole - half_sine()[1]).max() < 12


@pytest.mark.parametrize(
    "text", ["0:100", ":50", "5990:", "-10:", "-100:-90", "::7", "100:4000:13", "4000:100", "0:999999999", ":"]
)
def test_slices_are_those_of_python(client: httpx2.Client, url: str, whole: np.ndarray, text: str) -> None:
    body = client.get(url, params={"slice": text}).json()
    expected = whole[slice(*(int(part) if part else None for part in text.split(":")))]
    assert body["values"] == expected.tolist()
    assert body["unit"] == "N"
    if len(expected):
        assert expected[-1] == whole[body["start"] + (len(expected) - 1) * body["step"]]


@pytest.mark.parametrize("text", ["5", "a:b", "1:2:3:4", "::0", "::-1", "1.5:3", "", "9" * 30 + ":"])
def test_a_bad_slice_is_told(client: httpx2.Client, url: str, text: str) -> None:
    answer = client.get(url, params={"slice": text})
    assert answer.status_code == 422
    assert "slice" in answer.json()["error"]["text"]


def test_every_form_holds_the_same(client: httpx2.Client, url: str, whole: np.ndarray) -> None:
    part = whole[1000:1200:2]
    ask = {"slice": "1000:1200:2"}
    csv = client.get(url, params=ask | {"format": "csv"})
    assert csv.headers["content-type"].startswith("text/csv")
    table = np.loadtxt(csv.text.splitlines(), delimiter=",", skiprows=1)
    assert csv.text.startswith("time_s,force_N\n")
    np.testing.assert_allclose(table, np.column_stack([np.arange(1000, 1200, 2) * 1e-6, part]), rtol=1e-9)
    octets = client.get(url, params=ask, headers={"Accept": "application/octet-stream"})
    np.testing.assert_array_equal(np.frombuffer(octets.content, "<f4"), part.astype("<f4"))
    named = {k: float(octets.headers[f"droptower-{k}"]) for k in ("dt", "start", "step")}
    assert named == {"dt": pytest.approx(1e-6), "start": 1000, "step": 2}


@pytest.mark.parametrize(
    ("accept", "kind"),
    [
        ("*/*", "application/json"),
        ("text/csv", "text/csv"),
        ("text/html, text/csv;q=0.5, */*;q=0.1", "text/csv"),
        ("application/*;q=0.2, application/x-npy", "application/x-npy"),
        ("application/json;q=0, */*", "text/csv"),
    ],
)
def test_accept_chooses(client: httpx2.Client, url: str, accept: str, kind: str) -> None:
    answer = client.get(url, params={"slice": "0:5"}, headers={"Accept": accept})
    assert answer.headers["content-type"].partition(";")[0] == kind


def test_format_goes_over_accept(client: httpx2.Client, url: str) -> None:
    answer = client.get(url, params={"slice": "0:5", "format": "csv"}, headers={"Accept": "application/json"})
    assert answer.headers["content-type"].startswith("text/csv")


@pytest.mark.parametrize("ask", [{"params": {"format": "xml"}}, {"headers": {"Accept": "image/png"}}])
def test_what_there_is_not_is_406_and_lists_what_there_is(client: httpx2.Client, url: str, ask: dict) -> None:
    answer = client.get(url, **ask)
    assert answer.status_code == 406
    assert all(name in answer.json()["error"]["text"] for name in ("json", "csv", "npy", "octet-stream"))


def test_too_many_samples_as_text_name_the_ways_out(client: httpx2.Client, runs: list[str]) -> None:
    url = f"/api/v1/runs/{runs[0]}/force"
    answer = client.get(url)
    assert answer.status_code == 413
    assert all(word in answer.json()["error"]["text"] for word in ("200000", "slice", "envelope", "format=npy"))
    assert len(client.get(url, params={"slice": ":200000"}).json()["values"]) == 200_000
    assert len(np.load(io.BytesIO(client.get(url, params={"format": "npy"}).content))) == LONG
    body = client.get(url, params={"points": 1000}).json()
    assert (len(body["values"]), body["step"]) == (1000, 300)


def test_the_envelope_of_a_long_record_keeps_its_one_spike(client: httpx2.Client, runs: list[str]) -> None:
    answer = client.get(f"/api/v1/runs/{runs[0]}/envelope")
    index, force = np.frombuffer(answer.content, "<f4").reshape(-1, 2).T
    assert len(index) <= 2000
    assert (np.diff(index) > 0).all()
    assert index[force.argmax()] == SPIKE
    assert answer.headers["droptower-raw"] == "false"


def test_a_short_slice_comes_back_whole(client: httpx2.Client, runs: list[str]) -> None:
    url = f"/api/v1/runs/{runs[0]}/envelope"
    body = client.get(url, params={"slice": f"{SPIKE - 100}:{SPIKE + 100}", "format": "json"}).json()
    assert body["raw"] is True
    assert body["index"] == list(range(200))
    assert body["start"] + body["index"][int(np.argmax(body["values"]))] == SPIKE
    assert client.get(url, params={"slice": f":{RAW_BELOW}", "format": "json"}).json()["raw"] is False
    assert client.get(url, params={"slice": "::2"}).status_code == 422


@given(
    n=st.integers(20_000, 200_000),
    points=st.integers(10, 5000),
    spikes=st.lists(st.floats(0, 1, exclude_max=True), min_size=1, max_size=5, unique=True),
    up=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_an_envelope_shows_every_one_sample_spike(n: int, points: int, spikes: list[float], up: bool) -> None:
    values = np.random.default_rng(n).normal(0, 1, n)
    places = [int(s * n) for s in spikes]
    values[places] = 100.0 if up else -100.0
    index = envelope(values, points)
    assert len(index) <= points
    shown = index[np.abs(values[index]) == 100.0]
    width = -(-n // (points // 2))
    assert all(np.abs(shown - place).min() < width for place in places)
