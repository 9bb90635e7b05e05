"""The catalog: a SQLite cache over the run files, that can be thrown away at any time."""

import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from typing import Any

from daq.errors import StoreError
from daq.store import Store

_SCHEMA = """
CREATE TABLE IF NOT EXISTS runs (
    run TEXT PRIMARY KEY, series TEXT, started TEXT, source TEXT, specimen TEXT, material TEXT, batch TEXT,
    points INTEGER, sample_rate_Hz REAL, sha256 TEXT, missing INTEGER, fault TEXT
);
CREATE INDEX IF NOT EXISTS by_series ON runs (series, run);
"""
VERSION = 2
FILTERS = ("series", "specimen", "material", "batch", "source")


@dataclass(frozen=True)
class Row:
    """A run as the catalog lists it; `missing` samples could not be had, `fault` says why its file cannot be read."""

    run: str
    series: str | None
    started: str | None
    source: str | None
    specimen: str | None
    material: str | None
    batch: str | None
    points: int | None
    sample_rate_Hz: float | None
    sha256: str | None
    missing: int | None
    fault: str | None


class Catalog:
    """Lists and filters the runs of a store. A folder that cannot be written is catalogued in memory."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._path = store.folder / "catalog.sqlite"
        self._memory: sqlite3.Connection | None = None

    def runs(
        self, where: dict[str, str] | None = None, since: str | None = None, after: str | None = None, limit: int = 100
    ) -> list[Row]:
        """Runs newest first: those with the values of `where` (keys of FILTERS), started at `since` or later, and older
        than run `after` in the list."""
        tests, values = ["1"], list[Any]()
        for key, value in (where or {}).items():
            if key not in FILTERS:
                raise ValueError(f"no filter {key!r}; known are {', '.join(FILTERS)}")
            tests.append(f"{key} = ?")
            values.append(value)
        for test, value in (("started >= ?", since), ("run < ?", after)):
            if value is not None:
                tests.append(test)
                values.append(value)
        sql = f"SELECT * FROM runs WHERE {' AND '.join(tests)} ORDER BY run DESC LIMIT ?"
        with closing(self._connect()) as db:
            return [Row(*r) for r in db.execute(sql, [*values, limit])]

    def forget(self, run: str) -> None:
        """Read a run anew at the next look: it was corrected."""
        with closing(self._connect(sync=False)) as db, db:
            db.execute("DELETE FROM runs WHERE run = ?", (run,))

    def rebuild(self) -> int:
        """Throw the cache away and read every run file; the number of runs."""
        with closing(self._connect(sync=False)) as db:
            db.execute("DELETE FROM runs")
            return self._sync(db)

    def _connect(self, sync: bool = True) -> sqlite3.Connection:
        try:
            db = self._open(str(self._path)) if self._store.folder.is_dir() else self._open(":memory:")
            if sync:
                self._sync(db)
            return db
        except sqlite3.DatabaseError as e:
            if not _cannot_write(e):
                self._path.unlink(missing_ok=True)  # a damaged cache is made anew
                return self._fresh(str(self._path))
            return self._fresh(":memory:")

    def _fresh(self, path: str) -> sqlite3.Connection:
        try:
            db = self._open(path)
            self._sync(db)
            return db
        except sqlite3.Error as e:
            raise StoreError(f"no catalog can be made of {self._store.folder}: {e}") from None

    def _open(self, path: str) -> sqlite3.Connection:
        db = sqlite3.connect(path, timeout=10)
        if db.execute("PRAGMA user_version").fetchone()[0] not in (0, VERSION):
            db.execute("DROP TABLE IF EXISTS runs")
        db.executescript(_SCHEMA)
        db.execute(f"PRAGMA user_version = {VERSION}")
        return db

    def _sync(self, db: sqlite3.Connection) -> int:
        """Bring the table in line with the folder; the number of runs."""
        there = set(self._store.runs())
        known = {r[0] for r in db.execute("SELECT run FROM runs")}
        with db:
            db.executemany("DELETE FROM runs WHERE run = ?", [(r,) for r in known - there])
            rows = self._rows(sorted(there - known))
            db.executemany(f"INSERT OR REPLACE INTO runs VALUES ({','.join('?' * 12)})", rows)
        return len(there)

    def _rows(self, runs: list[str]) -> Iterator[tuple[Any, ...]]:
        for run in runs:
            try:
                data = self._store.read(run)
            except StoreError as e:
                yield (run, *[None] * 10, str(e))
                continue
            test = data.test
            yield (
                run, data.series, data.started, data.source, test.specimen.id, test.specimen.material,
                test.operator.batch, data.points, round(1 / data.dt, 6), self._store.sha256(run), data.missing, None,
            )  # fmt: skip


def _cannot_write(error: sqlite3.DatabaseError) -> bool:
    return any(word in str(error) for word in ("readonly", "unable to open", "locked", "disk is full", "disk I/O"))


def as_json(row: Row) -> dict[str, Any]:
    return json.loads(json.dumps(row.__dict__))
