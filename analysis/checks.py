"""What must be right before an answer means anything, and what is said when it is not."""

from __future__ import annotations

import math

import numpy as np

from analysis.baseline import typical_level
from analysis.conditions import Impact
from analysis.contact import find_contact
from analysis.events import Events, quantisation
from analysis.findings import Answer
from analysis.record import Array, Record

SURE = 3.0  # combined standard uncertainties beyond which a disagreement is said
_UNLIKE = 4.0  # reduced χ² of an edge
_ABSURD = 1e12  # N
FROM_PEAK = ("F_M", "t_M", "J", "eps_published", "eps_exact", "v1", "alpha_M", "alpha_r", "E_M", "l_M", "E_diss")


def arguments(record: Record, impact: Impact) -> None:
    """Raise ValueError for arguments that cannot be meant."""
    if np.ndim(record.force) != 1:
        raise ValueError(f"force must have one dimension, it has {np.ndim(record.force)}")
    for name, value in {"dt": record.dt, "mass": impact.mass, "g": impact.g}.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} must be above 0, it is {value}")
    if not 0 <= impact.tip_mass < impact.mass:
        raise ValueError(f"tip_mass must be from 0 to below mass ({impact.mass} kg), it is {impact.tip_mass} kg")


def usable(record: Record, answer: Answer) -> bool:
    """Whether every sample is a number."""
    force = record.force
    with np.errstate(all="ignore"):
        # One undefined sample makes largest and smallest so, too.
        ends = (float(force.max()), float(force.min())) if force.size else (0.0, 0.0)
    finite = math.isfinite(ends[0]) and math.isfinite(ends[1])
    huge = finite and max(ends[0], -ends[1]) > _ABSURD
    if finite and not huge:
        return True
    answer.warn(
        "not-finite",
        f"{np.count_nonzero(~np.isfinite(record.force))} of {record.force.size} force samples are not numbers"
        f"{', or above 10¹² N' if huge else ''}, so nothing is derived: export the record again.",
    )
    return False


def reversed_polarity(record: Record) -> bool:
    """Whether the record's largest pulse points down."""
    force = record.force
    if force.size == 0:
        return False
    zero = typical_level(force, record.pretrigger)
    if zero - float(force.min()) < 1.5 * (float(force.max()) - zero):
        return False
    return find_contact(-force, record.dt, quantisation(record), record.pretrigger) is not None


def no_contact(record: Record, answer: Answer) -> None:
    """Say that there is no contact, or that it points the wrong way."""
    if reversed_polarity(record):
        answer.warn(
            "reversed-polarity",
            "The largest pulse is negative: force must push the dart back with a positive sign. Turn the sign of the "
            "channel's scale and import again.",
        )
        return
    answer.warn(
        "no-contact",
        "No contact stands out from the noise (8 standard deviations): check trigger, cable and the channel's range, "
        "and drop again.",
    )


def after(record: Record, impact: Impact, events: Events, answer: Answer) -> None:
    """Cautions that need the findings."""
    if not events.contact.real_level:
        answer.warn(
            "no-pretrigger",
            "There are too few samples before contact for a zero level; the level after contact, or else the commonest "
            "level, stands in: record at least 1 ms before contact.",
        )
    if events.start is None or events.end is None:
        where = "begins" if events.start is None else "ends"
        answer.warn(
            "contact-cut-off",
            f"The record {where} within the contact, so that contact time, impulse and restitution are not known: "
            "record a longer window, or trigger with more samples before contact.",
        )
    else:
        _edges(events.start.chi2, 0.0 if answer.values["failed"].value else events.end.chi2, answer)
    _saturation(record, events, answer)
    _level_moved(events, answer)
    _restitution(answer)
    _energy(impact, answer)


def _edges(start: float, end: float, answer: Answer) -> None:
    """Reduced χ² of the two ends of contact; that of a failed specimen is none."""
    worst = max(start, end)
    if worst > _UNLIKE:
        which = "first contact" if start > end else "end of contact"
        answer.warn(
            "edge-unlike-contact",
            f"Force around the {which} does not rise like a contact (reduced χ² {worst:.3g}, "
            f"limit {_UNLIKE:g}): something touched earlier, stuck or rang. Its time is less sure than its u says.",
        )


def _saturation(record: Record, events: Events, answer: Answer) -> None:
    why = saturated(record, events)
    if why is not None:
        answer.forget(FROM_PEAK)
        answer.warn(
            "saturated",
            f"The record is saturated: {why}. F_M_raw is a lower bound of the peak, and what rests on the peak or the "
            "impulse is not given: choose a larger range and drop again.",
        )


def saturated(record: Record, events: Events) -> str | None:
    """What shows that the contact is cut off at the end of the range, in words; None if it is not."""
    first = events.first
    part = record.force[first : first + events.force.size]
    if record.rails is not None:
        half = 0.5 * (record.lsb or 0.0) + 1e-9 * abs(record.rails[1] - record.rails[0])
        low, high = min(record.rails), max(record.rails)
        touching = int(np.count_nonzero((part >= high - half) | (part <= low + half)))
        if touching:
            return f"{touching} samples of the contact are at the end of the range ({low:.6g} to {high:.6g} N)"
    flat = flat_top(part, events.peak, record.lsb or 0.0, events.contact.level.noise)
    if flat:
        return f"the top is flat over {flat} equal samples at {float(part[events.peak]):.6g} N"
    return None


def flat_top(force: Array, peak: int, lsb: float, noise: float) -> int:
    """Length of a flat top that the flanks say is clipped, or 0.

    The parabola through a flank of the plateau's own length on either side must stand above the plateau by more than
    four times noise and step together.
    """
    top = force[peak]
    at_top = np.concatenate(([0], (force == top).astype(np.int8), [0]))
    begins, ends = np.flatnonzero(np.diff(at_top) == 1), np.flatnonzero(np.diff(at_top) == -1)
    longest = int(np.argmax(ends - begins))
    first, last = int(begins[longest]), int(ends[longest])
    width = last - first
    if width < 3:
        return 0
    flank = max(width, 8)
    near = np.concatenate((np.arange(max(0, first - flank), first), np.arange(last, min(force.size, last + flank))))
    if near.size < 8:
        return 0
    levels = np.diff(np.unique(force[near]))
    step = max(lsb, float(levels.min()) if levels.size else 0.0)
    x = (near - (first + last - 1) / 2) / flank
    fitted = float(np.polynomial.polynomial.polyfit(x, force[near], 2)[0])
    # On a noise-free top each level is held for as long as the curvature allows: that is quantisation, not clipping.
    return width if fitted - float(top) > 4 * (noise / np.sqrt(near.size / 8) + step) else 0


def _level_moved(events: Events, answer: Answer) -> None:
    if events.end is None or events.start is None or not events.contact.real_level:
        return
    length = events.end.t - events.start.t
    late = events.force[events.t > events.end.t + 0.3 * length]
    if late.size < 16:
        return
    moved = float(late.mean())
    top = float(events.force[events.peak])
    if abs(moved) > max(0.01 * top, 5 * events.u_level, 5 * events.noise / math.sqrt(late.size)):
        answer.warn(
            "baseline-moved",
            f"After contact the zero level is {moved:+.3g} N off ({100 * moved / top:+.1f} % of the peak): check the "
            "charge amplifier's time constant and the cable; 1 % moves eps_exact by about 0.03.",
        )


def _restitution(answer: Answer) -> None:
    eps, u = answer.get("eps_exact")
    v0, _ = answer.get("v0")
    if eps is None or v0 is None or -SURE * u - 1e-3 <= eps <= 1 + SURE * u + 1e-3:
        return
    hint = "check mass, v0 and the force scale"
    if 1 + eps < 0.02:
        hint = "the impulse is far too small: is the force in kN where N is meant, or the mass in g"
    elif eps > 20:
        hint = "the impulse is far too large: is the mass in kg, the force in N and v0 in m/s"
    answer.warn(
        "restitution-impossible",
        f"eps_exact = {eps:.4g} ± {u:.2g} lies outside 0 to 1, which no impact can: {hint}.",
    )


def _energy(impact: Impact, answer: Answer) -> None:
    v0, _ = answer.get("v0")
    lost, _ = answer.get("E_diss")
    left, _ = answer.get("alpha_r")
    own, u_own = answer.get("v1")
    if v0 is None or lost is None or left is None or own is None:
        return
    for symbol, name in (("v1_gate", "photogate"), ("v1_flight", "flight time")):
        v1, u_v1 = answer.get(symbol)
        if v1 is None or (symbol == "v1_flight" and impact.catcher):
            continue
        balance = impact.mass * ((v0**2 - v1**2) / 2 + impact.g * left)
        # v0 enters both sides: what differs is v1, so its two values carry the uncertainty.
        u = impact.mass * max(abs(v1), abs(own)) * math.hypot(u_v1, u_own)
        if abs(balance - lost) > SURE * u + 1e-3 * impact.mass * v0**2 / 2:
            answer.warn(
                "energy-does-not-close",
                f"The force record says {lost:.4g} J were lost, v0 with the rebound by {name} ({v1:.4g} m/s against "
                f"{own:.4g} m/s from the impulse) says {balance:.4g} J, further apart than {SURE:g} combined "
                f"uncertainties ({u:.2g} J): check force scale, mass, v0 and zero level.",
            )
