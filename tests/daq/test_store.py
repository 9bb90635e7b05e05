"""A run appears whole or not at all, is checked against its checksums, and opens as NeXus."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import h5py
import numpy as np
import pytest

from daq.catalog import Catalog
from daq.errors import RunNotFound, StoreError
from daq.export import export_csv, export_nexus
from daq.importing import import_file
from daq.rig_file import Channel
from daq.run import ChannelData, RunData, new_run_id, now
from daq.run_file import envelope
from daq.store import Store
from daq.test_file import load_test


def counts_run(test_file: Path, points: int = 20_000) -> RunData:
    """A run of seeded counts, as a recorder would give them."""
    test, text = load_test(test_file)
    counts = np.random.default_rng(7).integers(-8192, 8191, points).astype(np.int16)
    channel = Channel(counts_to_unit=0.4, offset=-1.5, certificate="K-17", u={"counts_to_unit": 0.001})
    return RunData(
        run=new_run_id(), series="s", started=now(), source="acquired", dt=2e-6,
        channels=[ChannelData(channel, counts, 14)], test=test, test_text=text, g=9.81, g_source="test file",
        first_sample_ns=-1_000_000, gate_edges_ns=(-30_000_000, -20_000_000), provenance={"recorder": "x"},
    )  # fmt: skip


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return Store(tmp_path / "data")


def test_a_run_comes_back_as_it_went_in(store: Store, cr39: Path) -> None:
    run = counts_run(cr39)
    digest = store.publish(run)
    back = store.read(run.run)
    np.testing.assert_array_equal(back.channels[0].samples, run.channels[0].samples)
    assert back.channels[0].samples.dtype == np.int16
    assert back.channels[0].calibration == run.channels[0].calibration
    for name in ("run", "series", "started", "source", "dt", "test", "test_text", "g", "g_source", "first_sample_ns"):
        assert getattr(back, name) == getattr(run, name), name
    assert (back.gate_edges_ns, back.provenance, back.pretrigger) == (run.gate_edges_ns, run.provenance, 500)
    assert store.sha256(run.run) == digest


def test_the_folder_holds_a_finished_run_and_nothing_else(store: Store, cr39: Path) -> None:
    run = counts_run(cr39)
    store.publish(run)
    folder = store.runs_folder / run.run
    assert sorted(p.name for p in folder.iterdir()) == ["raw.h5", "raw.sha256"]
    assert [p.name for p in store.runs_folder.iterdir()] == [run.run]
    assert not (folder / "raw.h5").stat().st_mode & 0o222, "raw files are read-only"
    subprocess.run(["sha256sum", "-c", "raw.sha256"], cwd=folder, check=True, capture_output=True)


def test_a_run_is_not_written_twice(store: Store, cr39: Path) -> None:
    run = counts_run(cr39)
    digest = store.publish(run)
    with pytest.raises(StoreError):
        store.publish(run)
    assert store.sha256(run.run) == digest


@pytest.mark.parametrize("run", ["no-such-run", "../../etc/passwd", "20260101T000000Z-abcdef", ""])
def test_a_run_that_does_not_exist_is_told(store: Store, run: str) -> None:
    with pytest.raises(RunNotFound, match="no run"):
        store.read(run)


@pytest.mark.parametrize("where", ["data", "attribute", "start"])
def test_verify_finds_a_flipped_bit(store: Store, cr39: Path, where: str) -> None:
    run = counts_run(cr39)
    store.publish(run)
    assert [c.faults for c in store.verify()] == [[]]
    path = store.raw(run.run)
    content = bytearray(path.read_bytes())
    at = {"data": len(content) * 2 // 3, "attribute": content.index(b"K-17"), "start": 4}[where]
    content[at] ^= 1
    path.chmod(0o644)
    path.write_bytes(content)
    (check,) = store.verify()
    assert check.faults


def test_verify_finds_an_answer_of_another_record(store: Store, cr39: Path) -> None:
    run = counts_run(cr39)
    store.publish(run)
    store.add_analysis(run.run, {"raw_sha256": "0" * 64})
    (check,) = store.verify()
    assert "another raw.h5" in check.faults[0]


def test_answers_are_numbered_and_the_same_one_is_written_once(store: Store, cr39: Path) -> None:
    run = counts_run(cr39)
    store.publish(run)
    names = [store.add_analysis(run.run, {"a": n}).name for n in (1, 1, 2)]
    assert names == ["analysis-0001.json", "analysis-0001.json", "analysis-0002.json"]
    assert store.analysis(run.run) == {"a": 2}


def test_what_a_killed_writer_left_is_swept(store: Store, cr39: Path) -> None:
    store.prepare()
    dead = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True)
    stray = store.runs_folder / f".part-20260101T000000Z-abcdef-{dead.stdout.strip()}"
    stray.mkdir()
    (stray / "raw.h5").write_bytes(b"half")
    living = store.runs_folder / f".part-20260101T000000Z-abcdee-{os.getpid()}"
    living.mkdir()
    store.publish(counts_run(cr39))
    assert not stray.exists()
    assert living.exists()


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 256 KiB, a real one."""
    folder = tmp_path / "small"
    folder.mkdir()
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", folder], capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f"no small disk can be mounted here: {done.stderr.strip()}")
    yield folder
    subprocess.run(["umount", folder], check=True)


def test_a_full_disk_is_told_and_leaves_nothing_half_written(small_disk: Path, cr39: Path) -> None:
    store = Store(small_disk)
    run = counts_run(cr39, 1_000_000)
    with pytest.raises(StoreError, match="No space left"):
        store.publish(run)
    assert list(store.runs_folder.iterdir()) == []
    with pytest.raises(StoreError, match=r"0\.3 MB free; a run may take 3\.0 MB"):
        store.check_writable(3_000_000)
    store.publish(counts_run(cr39, 1000))


def test_a_read_only_disk_is_told(small_disk: Path, cr39: Path) -> None:
    Store(small_disk).publish(counts_run(cr39, 1000))
    subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
    store = Store(small_disk)
    with pytest.raises(StoreError, match="Read-only file system"):
        store.publish(counts_run(cr39, 1000))
    with pytest.raises(StoreError, match="cannot be written: Read-only file system"):
        store.check_writable(1000)
    assert [c.faults for c in store.verify()] == [[]]
    assert len(Catalog(store).runs()) == 1, "it is listed all the same, from a catalog in memory"


def test_a_folder_that_cannot_be_made_is_told(tmp_path: Path, cr39: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(StoreError, match="could not be written"):
        Store(tmp_path / "file" / "data").publish(counts_run(cr39))


def test_a_file_that_is_no_run_is_told(store: Store, cr39: Path) -> None:
    run = new_run_id()
    (store.runs_folder / run).mkdir(parents=True)
    with h5py.File(store.runs_folder / run / "raw.h5", "w") as f:
        f.create_group("entry")
    with pytest.raises(StoreError, match="of format None"):
        store.read(run)


def test_the_preview_keeps_every_spike_of_one_sample() -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(size=1_000_000)
    spikes = rng.choice(1_000_000, 200, replace=False)
    values[spikes] += rng.choice([-100, 100], 200)
    kept = envelope(values, 4000)
    assert len(kept) <= 4000
    assert np.all(np.diff(kept) > 0)
    assert values[kept].max() == values.max()
    assert values[kept].min() == values.min()
    stretch = 500
    for s in np.unique(spikes // stretch):
        part = slice(s * stretch, (s + 1) * stretch)
        inside = kept[(kept >= part.start) & (kept < part.stop)]
        assert np.abs(values[inside]).max() == np.abs(values[part]).max()


def test_an_exported_csv_imports_again_to_the_same_samples(store: Store, cr39: Path, tmp_path: Path) -> None:
    run = counts_run(cr39)
    export_csv(run, tmp_path / "out.csv")
    test, text = load_test(cr39)
    again = import_file(tmp_path / "out.csv", test, text, None, {}, "")
    np.testing.assert_allclose(again.channels[0].calibrated(), run.channels[0].calibrated(), rtol=1e-9)
    assert again.dt == pytest.approx(run.dt)


ANSWER = {
    "findings": {"F_M": {"value": 700.0, "unit": "N", "u": 1.0}, "eps_flight": {"value": None, "unit": "1", "u": None}},
    "warnings": [{"code": "no-v0", "text": "words"}],
}


@pytest.mark.parametrize("kind", ["raw", "export"])
def test_nexus_validator_finds_no_error_and_a_default_plot(store: Store, cr39: Path, tmp_path: Path, kind: str) -> None:
    run = counts_run(cr39)
    store.publish(run)
    path = store.raw(run.run)
    if kind == "export":
        path = tmp_path / "out.h5"
        export_nexus(store.read(run.run), json.loads(json.dumps(ANSWER)), path)
    done = subprocess.run(
        [Path(sys.executable).with_name("nxcheck"), path], capture_output=True, text=True, check=False
    )
    report = done.stdout + done.stderr
    assert "Total number of errors: 0" in report, report
    with h5py.File(path) as f:
        entry = f[f.attrs["default"]]
        data = entry[entry.attrs["default"]]
        assert data.attrs["NX_class"] == "NXdata"
        assert len(data[data.attrs["signal"]]) == len(data[data.attrs["axes"]])
        assert all("units" in d.attrs for d in data.values())
        if kind == "export":
            assert entry["analysis/results/F_M"][()] == 700.0
            assert entry["analysis/results/F_M_errors"][()] == 1.0
            assert len(entry["trace/force"]) == run.points
