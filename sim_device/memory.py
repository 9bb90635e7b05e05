"""What outlives power: boot counter, record id counter and the held record, in one file written by rename."""

from __future__ import annotations

import json
import os
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FORMAT = "droptower emulator state 1"


class StateError(Exception):
    """A state file that cannot be trusted; the text says why and what to do."""


@dataclass
class Record:
    """A complete record; ``samples`` is (channels, points), edges are in ns from the trigger."""

    id: int
    boot: int
    hash: int
    interval_ns: int
    first_ns: int
    trigger_us: int
    bits: int
    samples: NDArray[np.int16]
    edges_ns: list[int] = field(default_factory=list[int])
    crcs: dict[tuple[int, int, int], int] = field(default_factory=dict[tuple[int, int, int], int])

    @property
    def points(self) -> int:
        """Samples a channel."""
        return int(self.samples.shape[1])

    @property
    def channels(self) -> int:
        """Number of channels."""
        return int(self.samples.shape[0])

    def crc(self, channel: int, start: int = 0, count: int | None = None) -> int:
        """CRC-32 of samples of channel index ``channel``, as little-endian bytes."""
        end = self.points if count is None else start + count
        span = channel, start, end
        if span not in self.crcs:
            if len(self.crcs) >= 64:
                self.crcs.clear()
            self.crcs[span] = zlib.crc32(self.samples[channel, start:end].astype("<i2").tobytes())
        return self.crcs[span]


class Memory:
    """Counters and held record; every change is on disk before its method returns, if there is a file."""

    def __init__(self, path: Path | None) -> None:
        """Read the file, if any.

        Raises
        ------
        StateError
            The file is there but damaged or of another make. It is left as it is.
        """
        self.path = path
        self.boot = 0
        self.last_id = 0
        self.held: Record | None = None
        if path is not None and path.exists():
            self._load(path)

    def _load(self, path: Path) -> None:
        try:
            data = path.read_bytes()
            if len(data) < 4 or zlib.crc32(data[:-4]) != int.from_bytes(data[-4:], "little"):
                raise ValueError("its check sum is wrong")
            line, _, body = data[:-4].partition(b"\n")
            header: dict[str, Any] = json.loads(line)
            if header.pop("format") != FORMAT:
                raise ValueError("it is of another format")
            self.boot, self.last_id = int(header["boot"]), int(header["last_id"])
            if (held := header["held"]) is not None:
                shape = held.pop("channels"), held.pop("points")
                self.held = Record(samples=np.frombuffer(body, "<i2").reshape(shape).astype(np.int16), **held)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise StateError(
                f"state file {path} cannot be used: {error}. It may hold a record: move it away to start afresh"
            ) from error

    def started(self) -> None:
        """Count a start of the device."""
        self.boot += 1
        self.save()

    def new_id(self) -> int:
        """Id for an INIT that was accepted."""
        self.last_id += 1
        self.save()
        return self.last_id

    def hold(self, record: Record | None) -> None:
        """Keep a record until it is acknowledged, or let it go."""
        self.held = record
        self.save()

    def save(self) -> None:
        """Write the file: temporary file, sync, rename, sync of the folder."""
        if self.path is None:
            return
        held: dict[str, Any] | None = None
        body = b""
        if self.held is not None:
            held = {key: value for key, value in vars(self.held).items() if key not in ("samples", "crcs")}
            held |= {"channels": self.held.channels, "points": self.held.points}
            body = self.held.samples.astype("<i2").tobytes()
        header = {"format": FORMAT, "boot": self.boot, "last_id": self.last_id, "held": held}
        data = json.dumps(header).encode() + b"\n" + body
        temporary = self.path.with_name(self.path.name + ".tmp")
        with temporary.open("wb") as file:
            file.write(data)
            file.write(zlib.crc32(data).to_bytes(4, "little"))
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(self.path)
        folder = os.open(self.path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
