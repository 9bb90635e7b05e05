"""All model-free findings of one record."""

from __future__ import annotations

import math

import numpy as np

from analysis import checks, failure, restitution
from analysis.conditions import Impact
from analysis.events import Events, locate
from analysis.findings import Answer, Findings
from analysis.kinematics import Kinematics, empty, integrate
from analysis.peak import find_peak
from analysis.record import Record


def analyze(record: Record, impact: Impact) -> Findings:
    """Findings of `record`: every symbol present, None where unknown, with a caution that says why.

    Raises ValueError for arguments that cannot be meant: dt ≤ 0, mass ≤ 0, tip mass not below it, force not 1-D.
    """
    checks.arguments(record, impact)
    answer = Answer()
    if not checks.usable(record, answer):
        return answer.done()
    with np.errstate(all="ignore"):
        events = locate(record, impact)
        if events is None or checks.reversed_polarity(record):
            checks.no_contact(record, answer)
            return answer.done()
        outcome = failure.outcome_of(record, impact, events)
        events = outcome.events
        _events(record, impact, events, answer)
        restitution.evaluate(record, impact, events, answer)
        failure.evaluate(impact, outcome, answer)
        checks.after(record, impact, events, answer)
    return answer.done()


def kinematics(record: Record, impact: Impact) -> Kinematics:
    """Force, speed, displacement and energy over the contact, for plots; empty where `analyze` finds no contact."""
    checks.arguments(record, impact)
    if not checks.usable(record, Answer()):
        return empty()
    with np.errstate(all="ignore"):
        events = locate(record, impact)
        if events is None or events.start is None or checks.reversed_polarity(record):
            return empty()
        v0 = restitution.speed_at_contact(record, impact, events, Answer())
        end = events.end.t if events.end is not None else float(events.t[-1])
        return integrate(
            events.t, events.force, events.start.t, end, impact.mass, v0.value if v0 else math.nan, impact.g
        )


def apart(u_start: float, u_end: float) -> float:
    """Standard uncertainty of the time between two ends of one contact.

    Where real shapes lack of the law of `onset`, they lack of it at both ends, outward or inward: correlation 0.5.
    """
    return math.sqrt(u_start**2 + u_end**2 + u_start * u_end)


def _events(record: Record, impact: Impact, events: Events, answer: Answer) -> None:
    level = events.contact.level
    answer.set("baseline", level.value, level.u)
    answer.set("noise", level.noise)
    answer.set("F_M_raw", float(events.force[events.peak]))
    if events.ringing is not None:
        answer.set("ringing_Hz", events.ringing.frequency)
        answer.set("ringing_decay", events.ringing.decay)
        answer.set("ringing_amplitude", float(np.hypot(*events.ringing.pair)))
    length = (events.end.t if events.end else events.t[-1]) - (events.start.t if events.start else events.t[0])
    peak = find_peak(events.t, events.force, events.peak, events.noise, 0.15 * length, events.ringing)
    gain = impact.u_gain * peak.force
    answer.set("F_M", peak.force, math.hypot(peak.u_force, events.u_level, gain))
    if events.start is not None:
        answer.set("t_contact", events.start.t, events.start.u)
        answer.set("t_M", peak.t - events.start.t, math.hypot(peak.u_t, events.start.u))
        if events.end is not None:
            answer.set("t_c", events.end.t - events.start.t, apart(events.start.u, events.end.u))
    answer.set("bounces", events.bounces)
    if events.second is not None:
        answer.set("t_second", events.second.t, events.second.u)
        after = 1e3 * (events.second.t - events.t[0])
        text = (
            f"the dart hit the specimen again {after:.0f} ms after the first contact: marks and damage may be of "
            "either hit; a catcher prevents it"
        )
        answer.warn("second-hit", text)
        if events.end is not None:
            answer.set("t_nc", events.second.t - events.end.t, math.hypot(events.second.u, events.end.u))
