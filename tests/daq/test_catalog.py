"""The catalog is a cache: it lists and filters, and comes back from the files alone."""

from pathlib import Path

import pytest
from test_store import counts_run

from daq.catalog import Catalog
from daq.store import Store


@pytest.fixture
def store(tmp_path: Path, cr39: Path) -> Store:
    store = Store(tmp_path / "data")
    for _ in range(3):
        store.publish(counts_run(cr39, 2000))
    return store


def test_it_lists_newest_first_in_pages(store: Store) -> None:
    runs = store.runs()
    catalog = Catalog(store)
    assert [r.run for r in catalog.runs()] == runs[::-1]
    first = catalog.runs(limit=2)
    assert [r.run for r in first + catalog.runs(after=first[-1].run, limit=2)] == runs[::-1]


def test_it_filters(store: Store) -> None:
    catalog = Catalog(store)
    assert len(catalog.runs({"series": "s", "material": "CR-39"})) == 3
    assert catalog.runs({"series": "other"}) == []
    assert catalog.runs(since="2999") == []
    with pytest.raises(ValueError, match="no filter 'colour'"):
        catalog.runs({"colour": "red"})


@pytest.mark.parametrize("spoil", ["delete", "garbage", "other-version"])
def test_it_is_made_anew_from_the_files(store: Store, spoil: str) -> None:
    before = Catalog(store).runs()
    path = store.folder / "catalog.sqlite"
    if spoil == "delete":
        path.unlink()
    elif spoil == "garbage":
        path.write_bytes(b"no database" * 1000)
    else:
        import sqlite3

        db = sqlite3.connect(path)
        db.execute("ALTER TABLE runs DROP COLUMN batch")
        db.execute("PRAGMA user_version = 99")
        db.close()
    assert Catalog(store).runs() == before
    assert Catalog(store).rebuild() == 3


def test_a_damaged_run_is_listed_with_its_fault(store: Store) -> None:
    run = store.runs()[0]
    path = store.raw(run)
    path.chmod(0o644)
    path.write_bytes(path.read_bytes()[:1000])
    row = next(r for r in Catalog(store).runs() if r.run == run)
    assert "cannot be read" in (row.fault or "")


def test_a_removed_run_leaves_the_list(store: Store) -> None:
    import shutil

    catalog = Catalog(store)
    assert len(catalog.runs()) == 3
    shutil.rmtree(store.runs_folder / store.runs()[0])
    assert len(catalog.runs()) == 2


def test_an_empty_folder_has_no_runs(tmp_path: Path) -> None:
    assert Catalog(Store(tmp_path / "nothing")).runs() == []
