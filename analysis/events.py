"""First contact, its end, and the second contact of one record, with the corrected force between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.baseline import Level
from analysis.conditions import Impact
from analysis.contact import Contact, find_contact
from analysis.kinematics import running
from analysis.onset import Edge, Rise, clean_edge, fit_edge
from analysis.record import Array, Record
from analysis.ringing import Ringing, find_ringing
from analysis.second import find_second
from analysis.speed import gate_speed, height_speed


@dataclass(frozen=True)
class Events:
    """What happened when.

    force : (n,) N, contact force (zero level, droop and tip mass corrected), from sample `first` of the record on
    t : (n,) s on the record's axis; noise : N, of that force; u_level : N, of its zero level
    start, end : the two ends of contact (None: not in the record); second : onset of the second contact
    bounces : contacts after the first; None where its end is not in the record
    peak : index of the largest sample in `force`
    """

    contact: Contact
    first: int
    t: Array
    force: Array
    noise: float
    u_level: float
    start: Edge | None
    end: Edge | None
    second: Edge | None
    peak: int
    ringing: Ringing | None
    bounces: int | None = None


def quantisation(record: Record) -> float:
    """N, standard deviation of rounding to one count."""
    return (record.lsb or 0.0) / np.sqrt(12)


def locate(record: Record, impact: Impact) -> Events | None:
    """Find the events of `record`, or None where there is no contact."""
    contact = find_contact(record.force, record.dt, quantisation(record), record.pretrigger)
    if contact is None:
        return None
    begin = contact.start if contact.start is not None else 0
    stop = contact.end if contact.end is not None else record.force.size
    margin = max(2 * (stop - begin), 64)
    first, last = max(0, begin - margin), min(record.force.size, stop + margin)
    tip = impact.mass / (impact.mass - impact.tip_mass)
    t = np.arange(first, last, dtype=np.float64) * record.dt
    force = corrected(record, contact.level, first, last, begin) * tip
    noise = max(contact.level.noise * tip, 1e-7 * float(force.max()))
    ringing = find_ringing(t, force, begin * record.dt, stop * record.dt, noise)
    peak = contact.peak - first
    events = Events(contact, first, t, force, noise, contact.level.u * tip, None, None, None, peak, ringing)
    length = (stop - begin) * record.dt
    v0 = _speed(record, impact, begin * record.dt)
    start = None if contact.start is None else edge(events, impact, v0, begin - first, peak, length, ending=False)
    end = None if contact.end is None else edge(events, impact, v0, stop - first, peak, length, ending=True)
    events = replace(events, start=start, end=end)
    return _with_bounces(record, impact, events)


def _speed(record: Record, impact: Impact, contact: float) -> float | None:
    """Speed at contact, m/s, as near as it is known before the contact is."""
    if impact.v0:
        return impact.v0
    speed = gate_speed(record, impact, contact, 0.0) or height_speed(impact)
    return None if speed is None or not speed.value > 0 else speed.value


def _with_bounces(record: Record, impact: Impact, events: Events) -> Events:
    """The events with the onset of the second contact, s on the record's axis, and the number of bounces."""
    floor = quantisation(record)
    contact = events.contact
    begin, stop = contact.start, contact.end
    if begin is None or stop is None:
        return events
    tip = impact.mass / (impact.mass - impact.tip_mass)
    impulse = float(np.sum(events.force[begin - events.first : stop - events.first])) * record.dt / tip
    found = find_second(record.force, record.dt, contact, impulse, floor, record.time_constant)
    if found is None:
        return replace(events, bounces=0)
    offset, piece, second, bounces = found
    assert second.start is not None
    end = second.end if second.end is not None else piece.size
    again = Events(
        contact=second,
        first=offset,
        t=(offset + np.arange(piece.size, dtype=np.float64)) * record.dt,
        force=piece - second.level.value,
        noise=max(second.level.noise, 1e-7 * float(piece.max())),
        u_level=second.level.u,
        start=None,
        end=None,
        second=None,
        peak=second.peak,
        ringing=None,
    )
    onset = edge(again, impact, impact.v0, second.start, second.peak, (end - second.start) * record.dt, ending=False)
    return replace(events, second=onset, bounces=bounces)


def corrected(record: Record, level: Level, first: int, last: int, begin: int) -> Array:
    """Samples first…last without zero level and charge-amplifier droop: F_meas + (1/τ)∫F_meas dt from contact on."""
    force = record.force[first:last] - level.value
    if record.time_constant is not None and record.time_constant > 0:
        from_contact = force[begin - first :]
        time = np.arange(from_contact.size, dtype=np.float64) * record.dt
        from_contact += running(from_contact, time) / record.time_constant
    return force


def edge(
    events: Events, impact: Impact, v0: float | None, at: int, peak: int, length: float, ending: bool
) -> Edge | None:
    """Sub-sample onset or end near sample `at` of the contact that peaks at sample `peak` and lasts `length` s."""
    t, force = events.t, events.force
    if ending:
        t, force, at, peak = -t[::-1], force[::-1], t.size - 1 - at, t.size - 1 - peak
    step = float(t[1] - t[0])
    top = float(force[peak])
    last = min(at + int(length / step) + 1, force.size)
    impulse = float(np.sum(np.maximum(force[at:last], 0))) * step
    restored = impulse / (impact.mass * v0) if v0 else 1.85
    restored = min(max(restored, 1.3), 2.0)
    # J = m·v0·(1 + ε) = m·v1·(1 + ε)/ε: the impulse itself says what m·v is, unless the specimen failed.
    eps = restored - 1
    slowing = restored / impulse / (eps if ending else 1.0)
    if v0 and not ending:
        slowing = min(slowing, 1.1 / (impact.mass * v0))
    # What yields for good under about 0.7·F_M cannot cost more energy than is lost.
    yields = (1 - eps) * impulse / (1.4 * top) / (eps if ending else 1.0)
    limit = min(0.4, max(0.003, 30 * events.noise / top)) * top
    high = at + int(np.argmax(force[at : peak + 1] >= limit))
    high = min(max(high, at + 5), peak)
    low = max(0, at - max(4, high - at))
    if high - low < 8:
        return None
    if events.noise < 1e-5 * top:
        clean = clean_edge(t, force, high, events.noise)
        if clean is not None:
            return replace(clean, t=-clean.t) if ending else clean
    window = slice(low, high + 1)
    found = fit_edge(
        Rise(
            t[window],
            force[window],
            float(t[at]),
            max(float(force[high]), limit),
            top,
            events.noise,
            events.u_level,
            yields,
            impulse,
            slowing,
            ending,
            events.ringing,
        )
    )
    return replace(found, t=-found.t) if ending else found
