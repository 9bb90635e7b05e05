"""What was armed, noted before it is: so that a record found after a crash still has its test."""

import contextlib
import json
import os
from pathlib import Path
from typing import Any

from daq.chunks import Chunks
from daq.errors import StoreError
from daq.recorder import Header


def file_name(identity: str) -> str:
    """A recorder's identity as the name of a file."""
    return "".join(c if c.isalnum() else "_" for c in identity).strip("_")


def put_down(path: Path, content: dict[str, Any]) -> None:
    """Write a small JSON file whole and synced, or leave the old one.

    Raises
    ------
    StoreError : the folder cannot be written.
    """
    part = path.with_name(f"{path.name}.part-{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("w") as f:
            json.dump(content, f)
            f.flush()
            os.fsync(f.fileno())
        part.replace(path)
    except OSError as e:
        raise StoreError(f"{path.name} could not be written in {path.parent}: {e.strerror or e}") from None


class Journal:
    """The note of one recorder's armed drop, in the data folder; kept by its identity, as ports change their names."""

    def __init__(self, data: Path, identity: str) -> None:
        self.path = data / "armed" / f"{file_name(identity)}.json"
        self.chunks_path = self.path.with_suffix(".chunks")

    def chunks(self, header: Header) -> Chunks:
        """What was read of a record of this recorder so far, and the place to note more."""
        return Chunks(self.chunks_path, header.as_json())

    def write(self, note: dict[str, Any]) -> None:
        """Put the note down, synced.

        Raises
        ------
        StoreError : the folder cannot be written.
        """
        try:
            put_down(self.path, note)
        except StoreError as e:
            raise StoreError(f"what is armed could not be noted: {e}") from None

    def read(self) -> dict[str, Any] | None:
        try:
            return json.loads(self.path.read_text())
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as e:
            raise StoreError(f"{self.path} cannot be read: {e}") from None

    def remove(self) -> None:
        """The drop is over: nothing of it is left to be done. A note that cannot be removed does no harm."""
        with contextlib.suppress(OSError):
            self.path.unlink(missing_ok=True)
            self.chunks_path.unlink(missing_ok=True)
