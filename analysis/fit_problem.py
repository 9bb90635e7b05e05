"""A model, a record and the nuisances between them: residuals and their exact derivatives.

Parameters, in this order: ln E, c = 1/C_i, C_d (or C), v0, t0, b, then for each ringing mode its cosine and sine, its
frequency and the log of its decay. v0 is held by what the gate says, b by the samples before contact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analysis.conditions import Impact
from analysis.fit_window import Window
from analysis.models import Kind, layer, overhang, plate_stiffness, tip_stiffness
from analysis.record import Array

LN_E, FLOW, DAMPER, V0, T0, LEVEL, MODES = range(7)
PER_MODE = 4
SLOWEST = 4.0
"""Periods of a ringing in a contact, at the least: what is slower is the contact's own shape."""
_FROM_REST = 0.2
"""Of its amplitude: what the cosine of a ringing may be; the sensor is at rest before contact."""
Corrected = Literal["overhang", "finite-thickness"]
"""What a model can be corrected for."""
Flags = NDArray[np.bool_]
FREE: dict[Kind, tuple[int, ...]] = {
    "conservative": (LN_E,),
    "series": (LN_E, FLOW),
    "parallel": (LN_E, DAMPER),
    "flexed": (LN_E, FLOW, DAMPER),
}


@cache
def compiled() -> Callable[[Array, Array, Array, Array], float]:
    """The kernel; the first call loads it (a second from its cache, ten without)."""
    from analysis.kernel import contact

    return contact


@dataclass(frozen=True)
class Problem:
    """What `residuals` needs. ``modes``: N, of ringing; ``noise``: N, of a point."""

    kind: Kind
    impact: Impact
    window: Window
    noise: float
    modes: tuple[float, ...] = ()
    corrections: tuple[Corrected, ...] = ()

    @property
    def free(self) -> Flags:
        """(p,) bool: parameters that are fitted."""
        on = np.zeros(MODES + PER_MODE * len(self.modes), dtype=bool)
        on[list(FREE[self.kind])] = True
        on[V0] = self.window.v0.u > 0
        on[T0:] = True
        return on

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest (p,) values."""
        n = MODES + PER_MODE * len(self.modes)
        low, high = np.full(n, -np.inf), np.full(n, np.inf)
        low[FLOW] = low[DAMPER] = 0.0
        low[V0] = 0.1 * self.window.v0.value
        for k in range(MODES, n, PER_MODE):
            low[k + 2], high[k + 2] = SLOWEST / self.window.length, 0.4 / self.window.step
            low[k + 3], high[k + 3] = np.log(2 * self.window.step), np.log(30 * self.window.length)
        return low, high

    def constants(self, x: Array) -> Array:
        """(14,) what the kernel takes."""
        i = self.impact
        E, nu = float(np.exp(x[LN_E])), i.nu
        assert nu is not None, "the caller has seen to it"
        K, share = tip_stiffness(i.tip_radius, E, nu, i.tip_E, i.tip_nu)
        q = 0.0
        if self.kind == "flexed":
            assert i.thickness is not None
            assert i.support_radius is not None
            q = 1 / plate_stiffness(i.thickness, i.support_radius, E, nu)
            if "overhang" in self.corrections:
                assert i.diameter is not None
                q /= overhang(i.diameter / 2, i.support_radius, nu)
        beside = x[DAMPER] if self.kind == "parallel" else 0.0
        lag = x[DAMPER] * q if self.kind == "flexed" else 0.0
        base = (0.0, 0.0, 0.0, 0.0)
        if "finite-thickness" in self.corrections:
            assert i.thickness is not None
            by = float(np.sqrt(i.tip_radius)) / i.thickness
            base = tuple(k * by**n for n, k in enumerate(layer(nu), 1))
        return np.array([i.mass, i.g, i.friction / i.mass, K, x[FLOW], q, lag, beside, x[V0], share, *base])

    def contact(self, x: Array, t: Array, slopes: Array | None = None) -> Array:
        """Contact force in N at ``t`` (n,), s on the record's axis; its derivatives into ``slopes`` (n, 5)."""
        force = np.empty(t.size)
        compiled()(self.constants(x), t - x[T0], force, np.empty((0, 5)) if slopes is None else slopes)
        return force

    def ringing(self, x: Array, t: Array) -> Array:
        """Force of the ringing in N at ``t`` (n,)."""
        total = np.zeros(t.size)
        for k in range(MODES, x.size, PER_MODE):
            total += self._mode(x, k, t)[0]
        return total

    @staticmethod
    def _mode(x: Array, k: int, t: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Of one mode: its wave, the sine, the cosine, how the wave changes with the phase ωs, and the time s.

        The sensor is at rest when contact begins: the cosine comes in over a radian, so that no sample jumps with t0.
        """
        since = np.maximum(t - x[T0], 0.0)
        omega = 2 * np.pi * x[k + 2]
        wave: NDArray[np.complex128] = np.exp((-np.exp(-x[k + 3]) + 1j * omega) * since)
        fading = np.exp(-omega * since)
        on = t > x[T0]
        sine, cosine = wave.imag, wave.real * (1 - fading)
        turned = x[k + 1] * wave.real + x[k] * (wave.real * fading - wave.imag * (1 - fading))
        return x[k] * cosine + x[k + 1] * sine, sine, cosine, np.where(on, turned, 0.0), since

    def residuals(self, x: Array) -> tuple[Array, Array]:
        """(n + r,) weighted residuals and their (n + r, p) derivatives.

        The last r are those of v0, of the zero level, and of each mode's cosine, which rest before contact forbids.
        """
        w = self.window
        slopes = np.empty((w.t.size, 5))
        model = self.contact(x, w.t, slopes)
        n = w.t.size
        J = np.zeros((n + 2 + len(self.modes), x.size))
        part = J[:n]
        part[:, LN_E], part[:, FLOW], part[:, DAMPER], part[:, V0] = slopes[:, :4].T
        part[:, T0] = -slopes[:, 4]
        part[:, LEVEL] = 1.0
        model += x[LEVEL]
        for k in range(MODES, x.size, PER_MODE):
            wave, sine, cosine, turned, since = self._mode(x, k, w.t)
            model += wave
            decay, omega = np.exp(x[k + 3]), 2 * np.pi * x[k + 2]
            part[:, k], part[:, k + 1] = cosine, sine
            part[:, k + 2] = 2 * np.pi * since * turned
            part[:, k + 3] = wave * since / decay
            part[:, T0] += wave / decay - omega * turned
        weight = w.kept / self.noise
        r = np.zeros(len(J))
        r[:n] = (model - w.force) * weight
        part *= weight[:, None]
        if w.v0.u > 0:
            r[n], J[n, V0] = (x[V0] - w.v0.value) / w.v0.u, 1 / w.v0.u
        r[n + 1], J[n + 1, LEVEL] = x[LEVEL] / w.u_level, 1 / w.u_level
        for j, amplitude in enumerate(self.modes):
            k = MODES + PER_MODE * j
            r[n + 2 + j], J[n + 2 + j, k] = x[k] / (_FROM_REST * amplitude), 1 / (_FROM_REST * amplitude)
        return r, J

    def with_mode(self, x: Array, frequency: float, decay: float, amplitude: float) -> tuple[Problem, Array]:
        """One ringing mode more, without its amplitude in x yet."""
        return replace(self, modes=(*self.modes, amplitude)), np.concatenate((x, [0.0, 0.0, frequency, np.log(decay)]))


if __name__ == "__main__":  # at set-up: compiled once, read from its cache ever after
    compiled()(
        np.array([1.0, 9.8, 0.0, 1e8, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
        np.zeros(1),
        np.zeros(1),
        np.zeros((1, 5)),
    )
