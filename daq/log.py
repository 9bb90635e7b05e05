"""The log of a data folder: every acquisition's events but its progress, one JSON line each, a file a month.

A drop that leaves no run leaves its outcome here. A disk that takes no line stops nothing.
"""

import contextlib
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

QUIET = ("progress",)
"""Events that are not logged."""


class Log:
    """Appends to `DIR/log/YYYY-MM.jsonl`; each line says which rig and specimen it is about."""

    def __init__(self, data: Path, **about: Any) -> None:
        self._folder, self._about = data / "log", about

    def __call__(self, event: dict[str, Any]) -> None:
        """One line, whole or not at all."""
        if event["event"] in QUIET:
            return
        line = json.dumps({**event, **self._about}).encode() + b"\n"
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            with (self._folder / f"{datetime.now(UTC):%Y-%m}.jsonl").open("ab", buffering=0) as file:
                file.write(line)
