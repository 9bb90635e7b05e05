"""A data folder: runs that appear whole or not at all, answers beside them, checks of both."""

import hashlib
import json
import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from daq import run_file
from daq.corrections import corrected, correction_text
from daq.errors import RunNotFound, StoreError
from daq.run import RUN_ID, RunData
from daq.test_file import override

_BESIDE = re.compile(r"(analysis|test)-(\d{4})\.(json|toml)")


@dataclass(frozen=True)
class Check:
    """What `verify` found of one run; `faults` is empty if all is well."""

    run: str
    sha256: str | None
    faults: list[str]


class Store:
    """The runs under `DIR/runs`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.runs_folder = folder / "runs"

    # -- writing -----------------------------------------------------------------------------------------------------

    def publish(self, run: RunData) -> str:
        """Write a run, sync it, let it appear by one rename, and read it back from the disk; the file's SHA-256.

        Raises
        ------
        StoreError : the folder is full, read-only or gives back something else than was written. Nothing half-written
            is left; the samples are still the caller's.
        """
        content = run_file.image(run)
        digest = hashlib.sha256(content).hexdigest()
        part = self.runs_folder / f".part-{run.run}-{os.getpid()}"
        try:
            self.prepare()
            part.mkdir()
            _write(part / "raw.h5", content)
            _write(part / "raw.sha256", f"{digest}  raw.h5\n".encode())
            _sync_folder(part)
            part.rename(self.runs_folder / run.run)
            _sync_folder(self.runs_folder)
        except OSError as e:
            shutil.rmtree(part, ignore_errors=True)
            raise StoreError(f"the run could not be written to {self.folder}: {e.strerror or e}") from None
        del content  # as large as the record, and not needed to read back
        self._read_back(run, digest)
        return digest

    def prepare(self) -> None:
        """Make the folder and sweep what a killed writer left.

        Raises
        ------
        OSError : it cannot be made or written.
        """
        self.runs_folder.mkdir(parents=True, exist_ok=True)
        for stray in self.runs_folder.glob(".part-*"):
            owner = stray.name.rpartition("-")[2]
            if not (owner.isdigit() and Path(f"/proc/{owner}").exists()):
                shutil.rmtree(stray, ignore_errors=True)

    def check_writable(self, size: int) -> None:
        """That a run of `size` bytes would fit.

        Raises
        ------
        StoreError : the folder cannot be written or has too little space.
        """
        probe = self.runs_folder / f".part-probe-{os.getpid()}"
        try:
            self.prepare()
            _write(probe, b"probe")
            probe.unlink()
            free = shutil.disk_usage(self.runs_folder).free
        except OSError as e:
            raise StoreError(f"data folder {self.folder} cannot be written: {e.strerror or e}") from None
        if free < size:
            raise StoreError(
                f"data folder {self.folder} has {free / 1e6:.1f} MB free; a run may take {size / 1e6:.1f} MB"
            )

    def _read_back(self, run: RunData, digest: str) -> None:
        path = self.raw(run.run)
        fd = os.open(path, os.O_RDONLY)
        try:
            os.posix_fadvise(fd, 0, 0, os.POSIX_FADV_DONTNEED)  # so that the disk answers and not the cache
        finally:
            os.close(fd)
        if self.sha256(run.run) != digest:
            raise StoreError(f"{path} reads back different from what was written: the disk is not to be trusted")
        run_file.read(path)

    def add_analysis(self, run: str, answer: dict[str, Any]) -> Path:
        """Put an answer beside its run, numbered, written once; one that the newest already gives is not written again.

        Raises
        ------
        StoreError : the folder cannot be written.
        """
        numbered = self._beside(run, "analysis")
        if numbered and json.loads(numbered[-1].read_text()) == answer:
            return numbered[-1]
        return self._add(run, "analysis", "json", json.dumps(answer, indent=1).encode() + b"\n")

    def correct(self, run: str, values: dict[str, Any], author: str, reason: str) -> Path:
        """Put a correction of the test file beside a run; `values` by dotted key.

        Raises
        ------
        RunNotFound : no such run. SettingsError : a value is not allowed. StoreError : the folder cannot be written.
        """
        override(self.read(run).test, values, "the correction")
        return self._add(run, "test", "toml", correction_text(run, values, author, reason).encode())

    def _add(self, run: str, kind: str, suffix: str, content: bytes) -> Path:
        """Write the next numbered file beside a run, once. The test file in raw.h5 counts as the first of its kind."""
        numbered = self._beside(run, kind)
        number = int(numbered[-1].stem.rpartition("-")[2]) + 1 if numbered else 2 if kind == "test" else 1
        folder = self.runs_folder / run
        while True:
            path = folder / f"{kind}-{number:04d}.{suffix}"
            part = folder / f".part-{path.name}-{os.getpid()}"
            try:
                _write(part, content)
                os.link(part, path)  # fails where another process has just taken the number
                _sync_folder(folder)
                return path
            except FileExistsError:
                number += 1
            except OSError as e:
                raise StoreError(f"{path.name} could not be written to {folder}: {e.strerror or e}") from None
            finally:
                part.unlink(missing_ok=True)

    # -- reading -----------------------------------------------------------------------------------------------------

    def runs(self) -> list[str]:
        """Ids of all runs, oldest first."""
        try:
            names = [p.name for p in self.runs_folder.iterdir()]
        except FileNotFoundError:
            return []
        except OSError as e:
            raise StoreError(f"data folder {self.folder} cannot be read: {e.strerror or e}") from None
        return sorted(n for n in names if re.fullmatch(RUN_ID, n))

    def raw(self, run: str) -> Path:
        """The raw file of a run.

        Raises
        ------
        RunNotFound : there is none of that id.
        """
        if not re.fullmatch(RUN_ID, run) or not (path := self.runs_folder / run / "raw.h5").is_file():
            raise RunNotFound(f"no run {run!r} in {self.folder}; it holds {len(self.runs())} runs")
        return path

    def read(self, run: str) -> RunData:
        """A run with its corrections.

        Raises
        ------
        RunNotFound : no such run. StoreError : its file, or a correction, is damaged.
        """
        found = run_file.read(self.raw(run))
        return corrected(found, [(p.name, p.read_text(encoding="utf-8")) for p in self.corrections(run)])

    def corrections(self, run: str) -> list[Path]:
        """Corrections of a run's test file, in order."""
        return self._beside(run, "test")

    def sha256(self, run: str) -> str:
        """SHA-256 of the raw file as it is now."""
        with self.raw(run).open("rb") as f:
            return hashlib.file_digest(f, "sha256").hexdigest()

    def analysis(self, run: str) -> dict[str, Any] | None:
        """The newest answer, or None if the run was never analysed."""
        self.raw(run)
        numbered = self._beside(run, "analysis")
        return json.loads(numbered[-1].read_text()) if numbered else None

    def _beside(self, run: str, kind: str) -> list[Path]:
        """Numbered files of a kind beside a run, in order."""
        every = (self.runs_folder / run).glob(f"{kind}-*")
        return sorted(p for p in every if _BESIDE.fullmatch(p.name))

    def verify(self) -> Iterator[Check]:
        """Check every run: raw file against its SHA-256 and the samples' CRC-32, answers against the raw file."""
        for run in self.runs():
            yield self._verify(run)

    def _verify(self, run: str) -> Check:
        faults: list[str] = []
        try:
            digest = self.sha256(run)
            stated = (self.runs_folder / run / "raw.sha256").read_text().split()[0]
            if digest != stated:
                faults.append(f"raw.h5 has SHA-256 {digest}, raw.sha256 states {stated}")
            if (inside := self.read(run).run) != run:
                faults.append(f"raw.h5 says it is run {inside}")
            for path in self._beside(run, "analysis"):
                if json.loads(path.read_text()).get("raw_sha256") != digest:
                    faults.append(f"{path.name} was made from another raw.h5")
        except (StoreError, OSError, IndexError, ValueError) as e:
            faults.append(str(e))
            return Check(run, None, faults)
        return Check(run, digest, faults)


def _write(path: Path, content: bytes) -> None:
    """Write a new read-only file and sync it. An fsync that failed is never tried again."""
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o444)
    try:
        view = memoryview(content)
        while view:
            view = view[os.write(fd, view) :]
        os.fsync(fd)
    finally:
        os.close(fd)


def _sync_folder(path: Path) -> None:
    fd = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)
