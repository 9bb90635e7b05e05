"""First contact of a record whose specimen fails, cracks or slips: what comes after it rings anew and misleads.

The ringing is told from what precedes the break, or by frequency and decay from the free ringing after the contact.
Strong ringing leaves the onset several minima, half a period apart, so the search begins at several places.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from analysis.conditions import Impact
from analysis.events import Events, edge
from analysis.onset import Edge
from analysis.record import Array
from analysis.ringing import Ringing, find_ringing

_LATER = (0.0, 15e-6, 30e-6, 45e-6, 60e-6)
"""s after the first estimate: where the search begins. Ringing makes a contact seem early, never late."""
_BETTER = 0.95
"""Times the reduced χ² so far: what another onset has to come to."""
_TAIL = 3e-3
"""s of free ringing that are looked at."""


def start_before(events: Events, impact: Impact, v0: float, broke: float) -> Edge:
    """First contact, from what precedes ``broke`` (s on the record's axis)."""
    assert events.start is not None
    t, best = events.t, events.start
    stop, at = (int(np.searchsorted(t, when)) for when in (broke, best.t))
    step = float(t[1] - t[0])
    for ringing in _ringings(events, broke, stop):
        alone = replace(events, ringing=ringing)
        for later in _LATER:
            begin = at + int(later / step)
            if begin >= stop - 8:
                continue
            found = edge(alone, impact, v0, begin, stop - 1, broke - events.start.t, ending=False)
            if found is not None and math.isfinite(found.chi2) and found.chi2 < _BETTER * best.chi2:
                best = found
    return best


def _ringings(events: Events, broke: float, stop: int) -> Iterator[Ringing | None]:
    """No ringing, that before the break, and that after the contact as it was before the break."""
    assert events.start is not None
    t, force, start = events.t, events.force, events.start.t
    yield None
    before = find_ringing(t[:stop], force[:stop], start, broke, events.noise)
    if before is not None:
        yield before
    if events.end is None:
        return
    last = events.second.t - 50e-6 if events.second is not None else float(t[-1])
    tail = (t > events.end.t + 20e-6) & (t < last)
    if np.count_nonzero(tail) < 200:
        return
    free = find_ringing(t[tail], force[tail], float(t[tail][0]), min(last, float(t[tail][0]) + _TAIL), events.noise)
    if free is not None:
        as_before = _as_before(free, t[:stop], force[:stop], start, events.noise)
        if as_before is not None:
            yield as_before


def _as_before(ringing: Ringing, t: Array, force: Array, start: float, noise: float) -> Ringing | None:
    """The same frequency and decay with the amplitudes of the stretch up to the end of ``t`` (n,)."""
    within = t > start + 50e-6
    if np.count_nonzero(within) < 40:
        return None
    x, y = t[within] - start, force[within]
    omega, fading = 2 * np.pi * ringing.frequency, np.exp(-x / ringing.decay)
    columns = np.column_stack((np.vander(x / x[-1], 5), fading * np.cos(omega * x), fading * np.sin(omega * x)))
    a, *_ = np.linalg.lstsq(columns, y, rcond=None)
    rest = y - columns @ a
    s2 = max(noise**2, float(rest @ rest) / (x.size - 7))
    u = 1.5 * np.sqrt(np.diag(np.linalg.pinv(columns.T @ columns))[-2:] * s2)
    return Ringing(ringing.frequency, ringing.decay, start, *(np.asarray(p, dtype=np.float64) for p in (a[-2:], u)))
