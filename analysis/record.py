"""One record as the sensor saw it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """Calibrated force over time, with what is known of the recorder.

    force : (n,) N, sensor reading, not corrected for the tip mass
    dt : s, sampling interval; rails : N, readings at the two ends of the converter; lsb : N, one count
    time_constant : s, of the charge amplifier
    gate_edges : s, on the record's axis (first sample = 0): two falling, then two rising if it rebounded to the beam
    gate_on_record_clock : False where only differences between edges mean anything
    pretrigger : samples before the trigger; acceleration : (n,) m/s², second channel, of unknown sign
    """

    force: Array
    dt: float
    rails: tuple[float, float] | None = None
    lsb: float | None = None
    time_constant: float | None = None
    gate_edges: tuple[float, ...] = ()
    gate_on_record_clock: bool = True
    pretrigger: int | None = None
    acceleration: Array | None = None
