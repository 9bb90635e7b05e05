"""What was armed, noted before it is: so that a record found after a crash still has its test."""

import json
import os
from pathlib import Path
from typing import Any

from daq.errors import StoreError


class Journal:
    """The note of one rig's armed drop, in the data folder."""

    def __init__(self, data: Path, port: str) -> None:
        name = "".join(c if c.isalnum() else "_" for c in port).strip("_")
        self.path = data / "armed" / f"{name}.json"

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
        self.path.unlink(missing_ok=True)
