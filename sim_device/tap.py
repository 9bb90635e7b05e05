"""A tap on the tup while the dart hangs in its clamp: a short half sine, to see that the chain is alive."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from sim_device.fall import Motion
from sim_device.law import Floats, Law
from sim_device.settings import Rig

LASTS = 1e-3
"""s, a knuckle or a plastic hammer."""
AHEAD = 0.02
"""s from the request to the tap."""


class Tap(Motion):
    """A motion that is none: the dart stays where it hangs."""

    def __init__(self, rig: Rig, peak_N: float) -> None:
        """A tap of ``peak_N`` (negative: a pull)."""
        self.law = Law.of(rig.specimen, rig.dart)
        self.peak = peak_N
        self.t_fall = AHEAD
        height = rig.drop.height_mm
        self._x = -(height * 1e-3 if height is not None else (rig.drop.v0 or 0.0) ** 2 / (2 * 9.80665))

    @property
    def over(self) -> float:
        """When nothing rings any more, s from the tap's begin."""
        return LASTS + 0.05

    def force(self, t: Floats) -> Floats:
        """Force in N at the times ``t`` (n,), s from the tap's begin."""
        inside = (t >= 0) & (t < LASTS)
        return np.where(inside, self.peak * np.sin(math.pi * t / LASTS), 0.0)

    def position(self, t: Floats) -> Floats:
        """Displacement in m (n,): that of the dart in its clamp."""
        return np.full_like(t, self._x)

    def ringings(self, until: float) -> Iterator[tuple[float, float]]:
        """A soft tap sets nothing ringing."""
        return iter(())
