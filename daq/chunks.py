"""What has been read of a held record, chunk by chunk on disk: a readout that was cut off goes on where it stopped.

Not synced: the recorder still holds the record, and what a power cut takes from here is read again.
"""

import contextlib
import json
import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from daq.errors import StoreError
from daq.recorder import Counts, crc32

_HEAD = struct.Struct("<IIII")
Noted = dict[tuple[int, int], Counts]
"""Chunks by channel and first sample."""


def _whole_chunks(content: bytes, at: int) -> tuple[Noted, int]:
    """Chunks from byte `at` on up to the first that is cut off or damaged, and where that begins."""
    noted: Noted = {}
    while at + _HEAD.size <= len(content):
        channel, start, count, crc = _HEAD.unpack_from(content, at)
        end = at + _HEAD.size + 2 * count
        samples = np.frombuffer(content[at + _HEAD.size : end], dtype="<i2").astype(np.int16)
        if len(samples) != count or crc32(samples) != crc:
            break
        noted[channel, start] = samples
        at = end
    return noted, at


class Chunks:
    """Chunks of one record in `path`. Those of another record found there are thrown away.

    A disk that does not take them costs only the resuming, so that is not an error here.
    """

    def __init__(self, path: Path, record: dict[str, Any]) -> None:
        self.path = path
        self._noted: Noted = {}
        title = json.dumps(record, sort_keys=True).encode() + b"\n"
        self._file: BinaryIO | None = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            kept = self._load(path.read_bytes(), title) if path.exists() else 0
            self._file = path.open("r+b" if kept else "w+b", buffering=0)
            self._file.truncate(kept)
            self._file.seek(kept)
            if not kept:
                self._file.write(title)
        except OSError:
            self._file = None

    def _load(self, content: bytes, title: bytes) -> int:
        """Bytes of `content` that are whole chunks of this record."""
        if not content.startswith(title):
            return 0
        self._noted, kept = _whole_chunks(content, len(title))
        return kept

    @staticmethod
    def look(path: Path) -> tuple[dict[str, Any], Noted]:
        """The record that the chunks at `path` belong to, and those that are whole, while somebody else notes more.

        Raises
        ------
        StoreError : there are none.
        """
        try:
            content = path.read_bytes()
            title, _, _ = content.partition(b"\n")
            return json.loads(title), _whole_chunks(content, len(title) + 1)[0]
        except (OSError, ValueError) as e:
            raise StoreError(f"what was read of the record cannot be looked at in {path}: {e}") from None

    @staticmethod
    def record_in(path: Path) -> dict[str, Any] | None:
        """The record that the chunks at `path` belong to; None if there are none, or not even a title."""
        try:
            with path.open("rb") as f:
                return json.loads(f.readline())
        except (OSError, ValueError):
            return None

    def noted(self) -> list[tuple[tuple[int, int], Counts]]:
        """Channel and first sample of each chunk, and its samples."""
        return list(self._noted.items())

    def add(self, channel: int, start: int, samples: Counts, crc: int) -> None:
        """Note a chunk that has the CRC-32 `crc`."""
        head = _HEAD.pack(channel, start, len(samples), crc)
        if self._file is None:
            return
        try:
            self._file.write(head)
            self._file.write(samples.astype("<i2", copy=False).data)
        except OSError:
            self.close()

    def close(self) -> None:
        """Stop noting; what is noted stays for whoever goes on."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def remove(self) -> None:
        """Nothing more will be asked of them."""
        self.close()
        with contextlib.suppress(OSError):
            self.path.unlink()
