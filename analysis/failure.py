"""Whether, when and how the specimen failed, with load, displacement and energy there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from analysis.checks import saturated
from analysis.complete import Failure, complete_failure
from analysis.conditions import Impact
from analysis.events import Events
from analysis.findings import Answer
from analysis.first_contact import start_before
from analysis.kinematics import Kinematics, integrate
from analysis.partial import Doubt, Partial, partial_failure
from analysis.puncture import put_puncture
from analysis.record import Record
from analysis.restitution import speed_at_contact
from analysis.speed import Speed

NOT_OF_A_FAILED_ONE = (
    "t_c", "J", "eps_published", "eps_exact", "eps_flight", "eps_gate", "v1", "alpha_M", "alpha_r", "E_diss"
)  # fmt: skip
"""Findings that a specimen without rebound has not."""


@dataclass(frozen=True)
class Outcome:
    """What became of the specimen, as far as force and speed say.

    events : with first contact as what precedes the break has it; v0 : None: not known
    complete, part : None: not seen
    """

    events: Events
    v0: Speed | None
    complete: Failure | None = None
    part: Partial | Doubt | None = None

    @property
    def broke(self) -> float | None:
        """s on the record's axis: from when on the specimen is not what it was; None: it is."""
        if isinstance(self.part, Partial):
            return self.part.loss.t
        return None if self.complete is None else self.complete.t


def outcome_of(record: Record, impact: Impact, events: Events) -> Outcome:
    """What became of the specimen; of a saturated record nothing can be said."""
    v0 = speed_at_contact(record, impact, events, Answer())
    if v0 is None or events.start is None or saturated(record, events) is not None:
        return Outcome(events, v0)
    complete = complete_failure(events, impact, v0)
    part = partial_failure(events, impact, v0.value, None if complete is None else complete.t)
    found = Outcome(events, v0, complete, part)
    if found.broke is None:
        return found
    events = replace(events, start=start_before(events, impact, v0.value, found.broke))
    return replace(found, events=events, v0=speed_at_contact(record, impact, events, Answer()))


def evaluate(impact: Impact, outcome: Outcome, answer: Answer) -> None:
    """Say whether the specimen failed, and put what belongs to it into the answer; unknown where it cannot be told."""
    events, v0, part = outcome.events, outcome.v0, outcome.part
    if v0 is None or events.start is None:
        return
    if outcome.complete is not None:
        _complete(impact, events, v0, outcome.complete, part, answer)
        return
    eps, u = answer.get("eps_exact")
    if eps is not None and eps < 0:
        put_puncture(impact, events, v0, answer)
    if eps is None or not 0 < eps < 1 + 3 * u + 1e-3:
        return
    v1, u_v1 = answer.get("v1")
    rebounds = 0.5 * (1 + math.erf((v1 or 0.0) / max(u_v1, 1e-9) / math.sqrt(2)))
    answer.say("failed", isinstance(part, Partial) and part.cracked)
    answer.set("confidence", rebounds)
    if isinstance(part, Partial):
        _partial(impact, events, v0, part, answer)
    elif part is not None:
        answer.set("confidence", min(rebounds, 0.5))
        answer.warn(
            "crack-uncertain",
            f"{1e3 * (part.loss.t - events.start.t):.3f} ms after contact {part.loss.share:.0%} of the load seems "
            "lost at once, but the specimen is as stiff after it as before: it rings or shakes, and a crack would "
            "not show for sure. Look at the specimen.",
        )


def _complete(
    impact: Impact, events: Events, v0: Speed, found: Failure, part: Partial | Doubt | None, answer: Answer
) -> None:
    assert events.start is not None
    answer.forget(NOT_OF_A_FAILED_ONE)
    answer.say("failed", True)
    answer.say("failure_kind", "complete")
    at = (found.t, found.u_t, found.F, found.u_F)
    _put(impact, events, v0, at, answer, ("F_failure", "alpha_failure", "E_failure"))
    t_failure, u_t = found.t - events.start.t, math.hypot(found.u_t, events.start.u)
    answer.set("t_failure", t_failure, u_t)
    answer.set("confidence", found.confidence)
    answer.set("F_M", found.F, found.u_F)
    answer.set("t_M", t_failure, u_t)
    answer.set("l_M", *answer.get("alpha_failure"))
    answer.set("E_M", *answer.get("E_failure"))
    first = part.loss if isinstance(part, Partial) and part.cracked else found
    _put(impact, events, v0, (first.t, first.u_t, first.F, first.u_F), answer, ("F_D", "l_D", "E_D"))
    put_puncture(impact, events, v0, answer, found.t)
    answer.warn(
        "specimen-failed",
        f"The specimen failed {1e3 * t_failure:.3f} ms after contact at {found.F:.0f} N: the load was "
        "lost at once and the dart went on. F_M, t_M, l_M and E_M are those at failure; there is no restitution.",
    )


def _partial(impact: Impact, events: Events, v0: Speed, part: Partial, answer: Answer) -> None:
    assert events.start is not None
    loss = part.loss
    when = f"{1e3 * (loss.t - events.start.t):.3f} ms after contact, at {loss.F:.0f} N,"
    answer.set("confidence", part.confidence)
    if not part.cracked:
        answer.warn(
            "specimen-slipped",
            f"{when} {loss.share:.0%} of the load was lost at once, and the specimen was as stiff after it as before: "
            "it slipped in its support and did not crack. alpha_r and E_diss hold the way it slipped.",
        )
        return
    at = (loss.t, loss.u_t, loss.F, loss.u_F)
    answer.say("failure_kind", "partial")
    answer.set("t_failure", loss.t - events.start.t, math.hypot(loss.u_t, events.start.u))
    answer.set("load_lost", loss.share, loss.u_share)
    for names in (("F_failure", "alpha_failure", "E_failure"), ("F_D", "l_D", "E_D")):
        _put(impact, events, v0, at, answer, names)
    answer.warn(
        "specimen-cracked",
        f"{when} the specimen cracked: {loss.share:.0%} of its stiffness was gone from then on. It held, and the dart "
        "came back; ε, E_diss and alpha_r are of a specimen that cracked.",
    )


def _put(
    impact: Impact, events: Events, v0: Speed, at: tuple[float, float, float, float], answer: Answer,
    names: tuple[str, str, str],
) -> None:  # fmt: skip
    """Load, displacement and energy at ``at``: t, u_t (s on the record's axis), F, u_F (N).

    α = ∫v dt and E = ∫F·v dt (P1: E_a′ is the area under F–α up to failure).
    """
    assert events.start is not None
    t, u_t, F, u_F = at
    since, u_since = t - events.start.t, math.hypot(u_t, events.start.u)
    path = _path(impact, events, v0, t)
    alpha, energy = float(path.alpha[-2]), float(path.energy[-2])
    answer.set(names[0], F, u_F)
    answer.set(names[1], alpha, math.hypot(v0.u * since, float(path.v[-2]) * u_since))
    by_force = 0.3 * u_F / max(F, 1e-9)
    answer.set(names[2], energy, energy * math.hypot(v0.u / v0.value, impact.u_gain, by_force))


def _path(impact: Impact, events: Events, v0: Speed, end: float) -> Kinematics:
    assert events.start is not None
    return integrate(events.t, events.force, events.start.t, end, impact.mass, v0.value, impact.g)
