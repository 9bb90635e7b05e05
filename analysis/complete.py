"""Complete failure in one record: the load is lost at once, and the dart goes on into the specimen.

Two things have to come together. The impulse falls short: at the end of contact the dart still moves down, which no
intact specimen leaves it. And the load falls from most of its value to nothing within some tens of microseconds, which
neither the contact itself nor the ringing of the head does; a record in the wrong unit has the first, not the second.
No filter touches the record: time and load come from a fit of the corner itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from analysis.conditions import Impact
from analysis.events import Events
from analysis.record import Array
from analysis.speed import Speed

_LOOK, _BEFORE, _AFTER = 60e-6, 120e-6, 30e-6
"""s: in which the load has to be lost; looked at before and after the corner."""
_LOST = 0.6
"""Of the load at the corner, within `_LOOK`. Ringing of 15 % swings by 0.3 of it at the most."""
_SURE = 4.0
"""Standard uncertainties by which the dart has to be moving down when the load is gone."""
_LEAST = 0.03
"""Of v0: the same, whatever the uncertainty."""
_DECAYS = (2e-6, 5e-6, 10e-6, 20e-6)
"""s, in which the load falls to 1/e."""
_LAW, _WIDER = 0.5e-6, 1.4
"""What the law of the corner lacks: s, and by how much it makes the load less sure (`bench/failure.py`)."""
_LONG = 500e-6
"""s before the corner from which the load there is told, ringing taken out."""
_RINGS = np.arange(3e3, 18e3, 500.0)
"""Hz."""


@dataclass(frozen=True)
class Failure:
    """t : s on the record's axis, when the load begins to fall; F : N, contact force there; u_t, u_F of them
    confidence : 0 to 1, that the dart went on
    """

    t: float
    u_t: float
    F: float
    u_F: float
    confidence: float


def complete_failure(events: Events, impact: Impact, v0: Speed) -> Failure | None:
    """The complete failure of a specimen, or None. Not of a saturated record: its impulse is short as well."""
    if events.start is None or events.end is None:
        return None
    t, force = events.t, events.force
    inside = (t > events.start.t) & (t < events.end.t)
    if np.count_nonzero(inside) < 32:
        return None
    step = float(t[1] - t[0])
    J = float(force[inside].sum()) * step
    down = v0.value + impact.g * (events.end.t - events.start.t) - J / impact.mass
    u = math.hypot(v0.u, impact.u_gain * J / impact.mass, 0.002 * v0.value)
    if not down > max(_SURE * u, _LEAST * v0.value):
        return None
    corner = _corner(t, force, events)
    if corner is None:
        return None
    t_f, u_t = _refined(t, force, corner, events.noise)
    F, u_F = _load(t, force, t_f, events)
    return Failure(t_f, u_t, F, math.hypot(_WIDER * u_F, impact.u_gain * F), float(ndtr(down / max(u, 1e-9))))


def _corner(t: Array, force: Array, events: Events) -> int | None:
    """The sample after which the load is lost most suddenly, if it is lost."""
    assert events.start is not None
    assert events.end is not None
    step = float(t[1] - t[0])
    look = max(2, round(_LOOK / step))
    few = max(1, look // 6)
    mean = np.convolve(force, np.ones(few) / few, mode="valid")  # mean[i]: of force[i : i + few]
    first = max(int(np.searchsorted(t, events.start.t)), 0)
    last = min(int(np.searchsorted(t, events.end.t)) + look, mean.size - look - few)
    if last - first < look:
        return None
    before, after = mean[first : last - few], mean[first + few + look : last + look]
    n = min(before.size, after.size)
    fall = before[:n] - after[:n]
    at = int(np.argmax(fall))
    if fall[at] < _LOST * before[at] or before[at] < 8 * events.noise:
        return None
    # The steepest place within; the corner is where it begins.
    piece = force[first + at : first + at + 2 * few + look]
    low = np.flatnonzero(piece < 0.8 * before[at])
    return first + at + (int(low[0]) if low.size else few)


def _refined(t: Array, force: Array, corner: int, noise: float) -> tuple[float, float]:
    """When the load begins to fall, s, and its standard uncertainty: a parabola up to there, an exponential after."""
    step = float(t[1] - t[0])
    low, high = max(0, corner - round(_BEFORE / step)), min(t.size, corner + max(4, round(_AFTER / step)))
    x, y = t[low:high] - t[corner], force[low:high]
    grid = np.arange(-12e-6, 8e-6, 0.25e-6) if step <= 5e-6 else np.linspace(-4 * step, 3 * step, 81)
    table = np.empty((len(_DECAYS), grid.size))
    for j, decay in enumerate(_DECAYS):
        for k, at in enumerate(grid):
            table[j, k] = _left(x - at, y, decay)
    best = table.min(axis=0)
    k = int(np.argmin(best))
    s2 = max(noise**2, float(best[k]) / max(x.size - 5, 1))
    near = grid[best < best[k] + s2]
    return float(t[corner] + grid[k]), math.hypot(float(np.ptp(near)) / 2, _LAW, 0.3 * step)


def _left(s: Array, y: Array, decay: float) -> float:
    """Sum of squares that the corner's law leaves: a + b·s + c·s² for s < 0, a·e^(−s/decay) after."""
    before = np.minimum(s, 0.0)
    basis = np.column_stack((np.exp(-np.maximum(s, 0.0) / decay), before, before * before))
    scale = np.sqrt((basis * basis).sum(axis=0))
    a, *_ = np.linalg.lstsq(basis / scale, y, rcond=None)
    rest = y - basis / scale @ a
    return float(rest @ rest)


def _load(t: Array, force: Array, t_f: float, events: Events) -> tuple[float, float]:
    """Contact force at ``t_f``, N, and its standard uncertainty: smooth before it, but for one decaying ringing."""
    assert events.start is not None
    step = float(t[1] - t[0])
    begin = max(events.start.t + 20e-6, t_f - _LONG)
    some = (t >= begin) & (t < t_f - 0.5 * step)
    if np.count_nonzero(some) < 12:
        some = (t >= t_f - 12 * step) & (t < t_f - 0.5 * step)
        value = float(np.polynomial.polynomial.polyfit(t[some] - t_f, force[some], 1)[0])
        return value, events.noise
    x, y = (t[some] - t_f) / (t_f - begin), force[some]
    degree = 4 if x.size > 60 else 2
    smooth = np.vander(x, degree + 1, increasing=True)
    best = (math.inf, 0.0, 0.0)
    for frequency in _RINGS[(t_f - begin) * _RINGS > 1.5]:
        phase = 2 * np.pi * frequency * (t[some] - t_f)
        fading = np.exp(-(t[some] - t_f) / 0.6e-3)
        basis = np.column_stack((smooth, fading * np.cos(phase), fading * np.sin(phase)))
        a, *_ = np.linalg.lstsq(basis, y, rcond=None)
        rest = y - basis @ a
        chi2 = float(rest @ rest)
        if chi2 < best[0]:
            s2 = max(chi2 / max(x.size - basis.shape[1], 1), events.noise**2)
            best = (chi2, float(a[0]), math.sqrt(s2 * float(np.linalg.pinv(basis.T @ basis)[0, 0])))
    if not math.isfinite(best[0]):
        a, *_ = np.linalg.lstsq(smooth, y, rcond=None)
        rest = y - smooth @ a
        s2 = max(float(rest @ rest) / max(x.size - degree - 1, 1), events.noise**2)
        return float(a[0]), math.sqrt(s2 * float(np.linalg.inv(smooth.T @ smooth)[0, 0]))
    return best[1], best[2]
