"""Puncture after ISO 6603-2: where the force has fallen to half of its maximum; and a proposed type of failure.

The standard's types: YD, yielding (zero slope at maximum force) and deep drawing; YS, yielding and stable cracking; YU,
yielding and unstable cracking; NY, no yielding. The standard has the operator decide with the specimen in hand, and so
do we; the rules here are what a record alone can say.
"""

from __future__ import annotations

import math

import numpy as np

from analysis.conditions import Impact
from analysis.events import Events
from analysis.findings import Answer
from analysis.kinematics import integrate
from analysis.speed import Speed

_HALF = 0.5
_TAIL = 0.25
"""Of the way to F_M, from which the slope there is told."""
_ZERO = 0.3
"""Of F_M/l_M: slopes below it count as zero. A rising record has 1 and more."""
_SUDDEN = 60e-6
"""s from maximum to half of it: a crack that runs by itself."""
_DRAWN = 1.3
"""l_P over l_M from which a fall counts as drawing."""


def put_puncture(impact: Impact, events: Events, v0: Speed, answer: Answer, corner: float | None = None) -> None:
    """F_P, l_P, E_P and a proposed failure_type of a specimen that the dart has gone through.

    corner : s on the record's axis, where a sudden loss begins; None: the load is lost bit by bit, and what counts is
    the largest force. Nothing is put where the force does not fall to half of its maximum.
    """
    if events.start is None or events.end is None:
        return
    few = max(1, round(4e-6 / float(events.t[1] - events.t[0])))
    smooth = np.convolve(events.force, np.ones(few) / few, mode="same")
    top = events.peak if corner is None else int(np.searchsorted(events.t, corner))
    F_M, u_F = answer.get("F_M")
    if F_M is None or not F_M > 0 or not events.t[0] < events.t[top] < events.t[-1]:
        return
    low = np.flatnonzero(smooth[top:] <= _HALF * F_M)
    if low.size == 0:
        return
    half = float(events.t[top + int(low[0])])
    end = min(half + 2e-4, float(events.t[-1]))
    path = integrate(events.t, events.force, events.start.t, end, impact.mass, v0.value, impact.g)
    at = int(np.searchsorted(path.t, half - events.start.t))
    peak = max(2, int(np.searchsorted(path.t, float(events.t[top]) - events.start.t)))
    l_P, l_M = float(path.alpha[at]), float(path.alpha[peak])
    since = half - events.start.t
    answer.set("F_P", _HALF * F_M, _HALF * u_F)
    answer.set("l_P", l_P, math.hypot(v0.u * since, float(path.v[at]) * events.start.u))
    answer.set("E_P", float(path.energy[at]), float(path.energy[at]) * math.hypot(v0.u / v0.value, impact.u_gain))
    tail = slice(int(np.searchsorted(path.alpha[: peak + 1], (1 - _TAIL) * l_M)), peak + 1)
    if tail.stop - tail.start < 8:
        return
    slope = float(np.polyfit(path.alpha[tail], path.force[tail], 1)[0]) * l_M / F_M
    if corner is None or half - float(events.t[top]) > _SUDDEN:
        answer.say("failure_type", "YD" if l_P > _DRAWN * l_M else "YS")
    else:
        answer.say("failure_type", "NY" if slope > _ZERO else "YU")
