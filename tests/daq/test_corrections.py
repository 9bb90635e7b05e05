"""Corrections of a run's test file: beside the record, in order, never in it."""

from pathlib import Path

import pytest
from records import CR39

from daq.errors import SettingsError, StoreError
from daq.importing import import_file
from daq.store import Store
from daq.test_file import load_test


def kept(folder: Path) -> tuple[Store, str]:
    """A store with one imported run."""
    (folder / "t.toml").write_text(CR39)
    (folder / "d.csv").write_text("time_s,force_N\n" + "".join(f"{k}e-6,{k % 7}\n" for k in range(2000)))
    test, text = load_test(folder / "t.toml")
    run = import_file(folder / "d.csv", test, text, None, {}, "")
    store = Store(folder / "data")
    store.publish(run)
    return store, run.run


def test_a_correction_stands_beside_the_record_and_leaves_it_alone(tmp_path: Path) -> None:
    store, run = kept(tmp_path)
    before = store.sha256(run)
    first = store.correct(run, {"specimen.thickness_mm": 4.7}, "A", 'measured "again"')
    second = store.correct(run, {"specimen.thickness_mm": 4.8, "measured.failed": True}, "B", "once more")
    assert (first.name, second.name) == ("test-0002.toml", "test-0003.toml")
    found = store.read(run)
    assert (found.test.specimen.thickness_mm, found.test.measured.failed) == (4.8, True)
    assert len(found.provenance["corrections"]) == 2
    assert store.sha256(run) == before
    assert all(not check.faults for check in store.verify())
    with pytest.raises(SettingsError, match="thickness_mm"):
        store.correct(run, {"specimen.thickness_mm": -1}, "A", "wrong")
    assert len(store.corrections(run)) == 2


def test_a_spoilt_correction_is_named_with_the_way_out(tmp_path: Path) -> None:
    store, run = kept(tmp_path)
    path = store.correct(run, {"measured.failed": True}, "A", "seen")
    path.chmod(0o644)
    path.write_text("[set\n")
    with pytest.raises(StoreError, match=r"test-0002\.toml .* move it away, the record is whole"):
        store.read(run)
    assert any("test-0002.toml" in fault for check in store.verify() for fault in check.faults)
