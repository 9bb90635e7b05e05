"""What an acquisition is: its states, its settings, and what one INIT sets going."""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

from sim_device.errors import DeviceError
from sim_device.stream import Drop


class State(IntEnum):
    """States of the recorder by their condition register."""

    IDLE = 0
    MEASURING = 24
    ARMED = 40
    FILLING = 72
    HELD = 256


@dataclass(frozen=True)
class Setup:
    """Settings of an acquisition, as after reset."""

    interval_ns: int = 1000
    points: int = 5000
    pretrigger: int = 500
    source: str = "INT"
    level: int = 1000
    slope: str = "POS"
    delay_ns: int = 0

    def changed(self, **changes: Any) -> Setup:
        """A valid setup with some values changed; raises DeviceError −222, −224 or −221."""
        new = replace(self, **changes)
        if new.source not in ("INT", "IMM", "EXT") or new.slope not in ("POS", "NEG"):
            raise DeviceError(-224)
        within = (
            1000 <= new.interval_ns <= 2000
            and 1000 <= new.points <= 1_000_000
            and new.pretrigger >= 0
            and -32768 <= new.level <= 32767
            and 0 <= new.delay_ns <= 1_000_000_000
        )
        if not within or ("pretrigger" in changes and new.pretrigger >= new.points):
            raise DeviceError(-222)
        if new.pretrigger >= new.points:
            raise DeviceError(-221)
        return new

    @property
    def hash(self) -> int:
        """Configuration hash."""
        values = (self.interval_ns, self.points, self.pretrigger, self.source, self.level, self.slope, self.delay_ns)
        return zlib.crc32(",".join(map(str, values)).encode("ascii"))

    @property
    def first_ns(self) -> int:
        """First sample after the trigger, ns."""
        return self.delay_ns - self.pretrigger * self.interval_ns


@dataclass
class Acquisition:
    """What one INIT set going. Times in ns of the monotonic clock; the samples stand at origin + k·interval.

    ``missing`` and ``clock`` are faults: pre-trigger samples that are not there, true over stated interval.
    """

    id: int
    setup: Setup
    origin: float
    edges: list[float] = field(default_factory=list[float])
    trigger: float | None = None
    drop: Drop | None = None
    trigger_after_contact: float = 0.0
    trigger_index: int = 0
    missing: int = 0
    clock: float = 1.0

    @property
    def first_ns(self) -> int:
        """First sample after the trigger, ns; ``missing`` of the pre-trigger samples are not there."""
        return self.setup.first_ns + self.missing * self.setup.interval_ns

    def index_at(self, at: float) -> int:
        """Grid index of the next sample after ``at`` ns."""
        return math.ceil((at - self.origin) / self.setup.interval_ns)
