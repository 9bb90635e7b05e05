"""A model, a record and the nuisances between them: residuals and their exact derivatives.

Parameters, in this order: ln E, c = 1/C_i, C_d (or C), v0, t0, b, then for each ringing mode its cosine and sine, its
frequency and the log of its decay. v0 is held by what the gate says, b by the samples before contact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from analysis.conditions import Impact
from analysis.fit_window import Window
from analysis.models import Kind, layer, overhang, plate_stiffness, tip_stiffness
from analysis.record import Array

LN_E, FLOW, DAMPER, V0, T0, LEVEL, MODES = range(7)
PER_MODE = 4
SLOWEST = 2.5
"""Periods of a ringing in a contact, at the least: what is slower is the contact's own shape."""
_HARDLY = 1e-9
"""kg/s."""
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


_NONE = np.empty((0, 0))


@cache
def kernel() -> Any:
    """The compiled functions; the first call loads them (a second from their cache, ten without)."""
    import analysis.kernel

    return analysis.kernel


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
        # Not quite 0: the kernel tells by it that a dashpot is there, and how the force would follow it.
        beside = max(float(x[DAMPER]), _HARDLY) if self.kind == "parallel" else 0.0
        lag = x[DAMPER] * q if self.kind == "flexed" else 0.0
        base = (0.0, 0.0, 0.0, 0.0)
        if "finite-thickness" in self.corrections:
            assert i.thickness is not None
            by = float(np.sqrt(i.tip_radius)) / i.thickness
            base = tuple(k * by**n for n, k in enumerate(layer(nu), 1))
        return np.array([i.mass, i.g, i.friction / i.mass, K, x[FLOW], q, lag, beside, x[V0], share, *base])

    def contact(self, x: Array, t: Array) -> Array:
        """Contact force in N at ``t`` (n,), s on the record's axis."""
        force = np.empty(t.size)
        kernel().contact(self.constants(x), t - x[T0], force, _NONE)
        return force

    def ringing(self, x: Array, t: Array) -> Array:
        """Force of the ringing in N at ``t`` (n,), evenly spaced."""
        total, step = np.zeros(t.size), float(t[1] - t[0])
        for k in range(MODES, x.size, PER_MODE):
            unused = np.empty((5, t.size))
            kernel().ringing(t, step, *_wave(x, k), total, unused[:4], unused[4])
        return total

    def residuals(self, x: Array) -> tuple[Array, Array]:
        """(n + r,) weighted residuals and their (p, n + r) derivatives.

        The last r are those of v0, of the zero level, and of each mode's cosine, which rest before contact forbids.
        """
        w, n = self.window, self.window.t.size
        r, J = np.zeros(n + 2 + len(self.modes)), np.zeros((x.size, n + 2 + len(self.modes)))
        part, model = J[:, :n], r[:n]
        kernel().contact(self.constants(x), w.t - x[T0], model, part[:LEVEL])
        part[T0] *= -1
        part[LEVEL] = 1.0
        model += x[LEVEL]
        for k in range(MODES, x.size, PER_MODE):
            kernel().ringing(w.t, w.step, *_wave(x, k), model, part[k : k + 4], part[T0])
        model -= w.force
        weight = w.kept / self.noise if w.left_out is not None else 1 / self.noise
        model *= weight
        part *= weight
        if w.v0.u > 0:
            r[n], J[V0, n] = (x[V0] - w.v0.value) / w.v0.u, 1 / w.v0.u
        r[n + 1], J[LEVEL, n + 1] = x[LEVEL] / w.u_level, 1 / w.u_level
        for j, amplitude in enumerate(self.modes):
            k = MODES + PER_MODE * j
            r[n + 2 + j], J[k, n + 2 + j] = x[k] / (_FROM_REST * amplitude), 1 / (_FROM_REST * amplitude)
        return r, J

    def with_mode(self, x: Array, frequency: float, decay: float, amplitude: float) -> tuple[Problem, Array]:
        """One ringing mode more, without its amplitude in x yet."""
        return replace(self, modes=(*self.modes, amplitude)), np.concatenate((x, [0.0, 0.0, frequency, np.log(decay)]))


def _wave(x: Array, k: int) -> tuple[float, ...]:
    """t0, cosine, sine, frequency and decay of the mode that begins at ``k``."""
    return (*(float(v) for v in x[[T0, k, k + 1, k + 2]]), float(np.exp(x[k + 3])))


if __name__ == "__main__":  # at set-up: compiled once, read from its cache ever after
    some = np.zeros(2)
    ball = np.array([1.0, 9.8, 0.0, 1e8, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    for slopes in (_NONE, np.zeros((8, 3))[:5, :2]):  # its two layouts in memory
        kernel().contact(ball, some, np.zeros(2), slopes)
        kernel().contact(ball, some, np.zeros(3)[:2], slopes)
    for rows in (np.zeros((5, 2)), np.zeros((5, 3))[:, :2]):
        kernel().ringing(some, 1e-6, 0.0, 1.0, 1.0, 1e4, 1e-3, np.zeros(2), rows[:4], rows[4])
    kernel().path(np.arange(2.0), some, 1.0, 1.0, 9.8, *np.zeros((4, 2)))
