"""What faults make of a record between converter and memory."""

from __future__ import annotations

import numpy as np

from sim_device.faults import Faults
from sim_device.stream import Counts


def flawed(counts: Counts, bits: int, faults: Faults) -> Counts:
    """Counts (channels, n) after the faults in force that sit in the recorder."""
    if (fault := faults.strikes("saturation")) is not None:
        counts = saturated(counts, bits, fault.options["share"])
    if (fault := faults.strikes("stuck_bit")) is not None:
        counts = with_stuck_bit(counts, int(fault.options["bit"]), bool(fault.options["at"]))
    if (fault := faults.strikes("dropped_samples")) is not None:
        counts = without(counts, int(fault.options["at"]), int(fault.options["size"]))
    return counts


def with_stuck_bit(counts: Counts, bit: int, at: bool) -> Counts:
    """Counts with one bit of each stuck at 0 or 1."""
    words = counts.view(np.uint16)
    mask = np.uint16(1 << bit)
    return (words | mask if at else words & ~mask).view(np.int16)


def saturated(counts: Counts, bits: int, share: float) -> Counts:
    """Counts of channel 1 beyond ``share`` of the range at the rail of ``bits``."""
    high = 2 ** (bits - 1)
    out = counts.copy()
    out[0, counts[0] > share * high] = high - 1
    out[0, counts[0] < -share * high] = -high
    return out


def without(counts: Counts, at: int, size: int) -> Counts:
    """Counts with ``size`` of them missing from ``at`` on; the last one fills the end."""
    kept = np.delete(counts, slice(at, at + size), axis=1)
    return np.pad(kept, ((0, 0), (0, counts.shape[1] - kept.shape[1])), mode="edge")
