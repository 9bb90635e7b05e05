"""What was armed, noted before it is: so that a record found after a crash still has its test."""

import json
import os
from pathlib import Path
from typing import Any

from daq.chunks import Chunks
from daq.errors import StoreError
from daq.recorder import Header


class Journal:
    """The note of one recorder's armed drop, in the data folder; kept by its identity, as ports change their names."""

    def __init__(self, data: Path, identity: str) -> None:
        name = "".join(c if c.isalnum() else "_" for c in identity).strip("_")
        self.path = data / "armed" / f"{name}.json"
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
        part = self.path.with_suffix(f".part-{os.getpid()}")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            with part.open("w") as f:
                json.dump(note, f)
                f.flush()
                os.fsync(f.fileno())
            part.replace(self.path)
        except OSError as e:
            raise StoreError(f"what is armed could not be noted in {self.path.parent}: {e.strerror or e}") from None

    def read(self) -> dict[str, Any] | None:
        try:
            return json.loads(self.path.read_text())
        except FileNotFoundError:
            return None
        except (OSError, ValueError) as e:
            raise StoreError(f"{self.path} cannot be read: {e}") from None

    def remove(self) -> None:
        """The drop is over: nothing of it is left to be done."""
        self.path.unlink(missing_ok=True)
        self.chunks_path.unlink(missing_ok=True)
