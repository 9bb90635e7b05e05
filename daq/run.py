"""A run: what one drop left, as arrays and settings, before and after it is a file."""

import platform
import secrets
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from daq.rig_file import Channel, RigFile
from daq.test_file import TestFile

STANDARD_G = 9.80665
RUN_ID = r"\d{8}T\d{6}Z-[0-9a-f]{6}"
"""Run ids are of this pattern and never paths."""


@dataclass(frozen=True)
class ChannelData:
    """Samples of one channel: int16 counts of a recorder (`bits` of them used), or float64 as a file gave them.

    gaps : (start, count) of samples that could not be had; they stand as 0 counts
    """

    calibration: Channel
    samples: NDArray[Any]
    bits: int | None = None
    gaps: tuple[tuple[int, int], ...] = ()

    def calibrated(self, part: slice | NDArray[np.int64] = slice(None)) -> NDArray[np.float64]:
        """Samples in the channel's unit, all or a part (slice, or indices (n,)); NaN in the gaps."""
        scale = self.calibration
        values = np.asarray(self.samples[part], dtype=np.float64) * scale.scale + scale.offset
        if self.gaps:
            at = np.arange(len(self.samples))[part]
            for start, count in self.gaps:
                values[(at >= start) & (at < start + count)] = np.nan
        return values


@dataclass(frozen=True)
class RunData:
    """Times in s; gate edges in ns against the trigger, which stands `-first_sample_ns` after the first sample.

    gate_on_clock : False where only the time between two edges means anything
    """

    run: str
    series: str | None
    started: str
    source: Literal["acquired", "imported"]
    dt: float
    channels: list[ChannelData]
    test: TestFile
    test_text: str
    g: float
    g_source: str
    first_sample_ns: int | None = None
    gate_edges_ns: tuple[int, ...] = ()
    gate_on_clock: bool = True
    rig: RigFile | None = None
    rig_text: str | None = None
    provenance: dict[str, Any] = field(default_factory=dict[str, Any])

    @property
    def points(self) -> int:
        return len(self.channels[0].samples)

    @property
    def missing(self) -> int:
        """Samples that could not be had, over all channels."""
        return sum(count for channel in self.channels for _, count in channel.gaps)

    @property
    def pretrigger(self) -> int | None:
        """Samples before the trigger, if there was one."""
        return None if self.first_sample_ns is None else max(0, round(-self.first_sample_ns * 1e-9 / self.dt))

    def channel(self, quantity: str) -> ChannelData | None:
        """The first channel of a quantity."""
        return next((c for c in self.channels if c.calibration.quantity == quantity), None)


def new_run_id() -> str:
    """An id that sorts by time and that no other run has."""
    return f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}-{secrets.token_hex(3)}"


def now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def resolve_g(test: TestFile, rig: RigFile | None) -> tuple[float, str]:
    """Gravity in m/s² and where it comes from: test file over rig file over 9.80665."""
    if test.environment.g is not None:
        return test.environment.g, "test file"
    if rig is not None and rig.tower.g is not None:
        return rig.tower.g, "rig file"
    return STANDARD_G, "standard gravity"


def software() -> dict[str, str]:
    """What wrote a file: for its provenance."""
    names = ("droptower", "numpy", "h5py", "pyserial", "pymodbus")
    return {**{n: version(n) for n in names}, "python": platform.python_version(), "host": platform.node()}
