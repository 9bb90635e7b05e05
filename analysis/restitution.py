"""Impulse, restitution, displacement and energy with their uncertainties."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from analysis.conditions import Impact
from analysis.events import Events
from analysis.fall import fall_time
from analysis.findings import Answer
from analysis.kinematics import integrate
from analysis.record import Record
from analysis.speed import Speed, flight_rebound, gate_rebound, gate_speed, height_speed

_GUIDE = 0.08  # by which free fall overstates v0 on a guided rig
_NAMES = {"height": "drop height", "fall": "fall time"}
_AGREE = 3.0  # combined standard uncertainties


def speed_at_contact(record: Record, impact: Impact, events: Events, answer: Answer) -> Speed | None:
    """v0 by the first route there is: given, gate, height, fall. Cautions where two routes disagree."""
    routes: dict[str, Speed] = {}
    if impact.v0 is not None and math.isfinite(impact.v0) and impact.v0 > 0:
        routes["given"] = Speed(impact.v0, impact.u_v0 or 0.0)
    if events.start is not None:
        gate = gate_speed(record, impact, events.start.t, events.start.u)
        if gate is not None:
            routes["gate"] = gate
            answer.set("v0_gate", gate.value, gate.u)
        elif impact.gate is not None:
            answer.warn(
                "gate-unread",
                f"There is a gate but its {len(record.gate_edges)} edges give no speed: it takes two falling edges in "
                "order and before contact, a flag width, and off the record's clock the height above contact (gap).",
            )
    height = height_speed(impact)
    if height is not None:
        routes["height"] = height
        answer.set("v0_height", height.value, height.u)
    if events.start is not None:
        fall = fall_time(record, events.start.t, impact.g)
        if fall is not None:
            answer.set("t_fall", *fall)
            routes["fall"] = Speed(impact.g_falling * fall[0], impact.g_falling * fall[1])
            answer.set("v0_fall", routes["fall"].value, routes["fall"].u)
    if not routes:
        return None
    chosen = next(iter(routes))
    for other in list(routes)[1:]:
        a, b = routes[chosen], routes[other]
        # Height and fall time know nothing of a guide whose friction was not given: up to 8 % high is no finding.
        allowed = _GUIDE * b.value if impact.friction == 0 and other in ("height", "fall") and b.value > a.value else 0
        if abs(a.value - b.value) > _AGREE * math.hypot(a.u, b.u) + allowed + 1e-3 * a.value:
            answer.warn(
                "v0-routes-disagree",
                f"v0 is {a.value:.4g} m/s ({chosen}) and {b.value:.4g} m/s ({other}), further apart than "
                f"{_AGREE:g} combined uncertainties: check the gate's flag, the height and the guide's friction.",
            )
    if chosen in ("height", "fall") and impact.friction == 0:
        answer.warn(
            f"v0-from-{chosen}",
            f"v0 = {routes[chosen].value:.4g} m/s comes from the {_NAMES[chosen]} "
            "without guide friction, so 1 to 8 % high on guided rigs: use a gate, or give the friction.",
        )
    return routes[chosen]


def evaluate(record: Record, impact: Impact, events: Events, answer: Answer) -> None:
    """Everything that needs the impulse or v0."""
    v0 = speed_at_contact(record, impact, events, answer)
    if v0 is None:
        answer.warn("no-v0", "The speed at contact is not known: give v0, a drop height or a gate with its flag.")
    else:
        answer.set("v0", v0.value, v0.u)
    if events.start is None:
        return
    nominal = _quantities(impact, events, v0, answer)
    spread = dict.fromkeys(nominal, 0.0)
    for changed in _perturbed(impact, events, v0, answer):
        for symbol in nominal.keys() & changed.keys():
            value = changed[symbol]
            spread[symbol] = math.hypot(spread[symbol], value - nominal[symbol])
    for symbol, noise in _noise(impact, events, v0).items():
        spread[symbol] = math.hypot(spread[symbol], noise)
    for symbol, value in nominal.items():
        answer.set(symbol, value, spread[symbol])
    if v0 is None:
        return
    t_nc, u_t_nc = answer.get("t_nc")
    if t_nc is not None and not impact.catcher:
        flight = flight_rebound(impact, t_nc, u_t_nc)
        if flight is not None:
            answer.set("v1_flight", flight.value, flight.u)
            _ratio(answer, "eps_flight", flight, v0)
    if events.end is not None:
        rebound = gate_rebound(record, impact, events.end.t, events.end.u)
        if rebound is not None:
            answer.set("v1_gate", rebound.value, rebound.u)
            _ratio(answer, "eps_gate", rebound, v0)


def _ratio(answer: Answer, symbol: str, v1: Speed, v0: Speed) -> None:
    answer.set(symbol, v1.value / v0.value, math.hypot(v1.u, v1.value / v0.value * v0.u) / v0.value)


def _quantities(
    impact: Impact,
    events: Events,
    v0: Speed | None,
    answer: Answer,
    *,
    gain: float = 1.0,
    level: float = 0.0,
    mass: float = 0.0,
    tip: float = 0.0,
    speed: float = 0.0,
    start: float = 0.0,
    end: float = 0.0,
) -> dict[str, float]:
    """Quantities with each input shifted by the amount given."""
    assert events.start is not None
    m, m_tip = impact.mass + mass, impact.tip_mass + tip
    factor = gain * (m / (m - m_tip)) / (impact.mass / (impact.mass - impact.tip_mass))
    t0 = events.start.t + start
    t1 = events.end.t + end if events.end is not None else float(events.t[-1])
    v = v0.value + speed if v0 is not None else math.nan
    path = integrate(events.t, (events.force - level) * factor, t0, t1, m, v, impact.g)
    found: dict[str, float] = {}
    if events.end is not None:
        found["J"] = path.impulse
    t_m, _ = answer.get("t_M")
    if v0 is not None:
        if t_m is not None:
            found["l_M"] = float(np.interp(t_m - start, path.t, path.alpha))
            found["E_M"] = float(np.interp(t_m - start, path.t, path.energy))
        if events.end is not None or float(path.v[-1]) < 0:
            found["alpha_M"] = float(path.alpha.max())
        if events.end is not None:
            duration = t1 - t0
            found["eps_published"] = found["J"] / (m * v) - 1
            found["eps_exact"] = found["eps_published"] - impact.g * duration / v
            found["v1"] = -float(path.v[-1])
            found["E_diss"] = float(path.energy[-1])
            found["alpha_r"] = float(path.alpha[-1])
    return found


def _perturbed(impact: Impact, events: Events, v0: Speed | None, answer: Answer) -> Iterator[dict[str, float]]:
    assert events.start is not None
    shifts = {
        "gain": impact.u_gain,
        "level": events.u_level,
        "mass": impact.u_mass,
        "tip": impact.u_tip_mass,
        "speed": v0.u if v0 is not None else 0.0,
        "start": events.start.u,
        "end": events.end.u if events.end is not None else 0.0,
    }
    for name, shift in shifts.items():
        if shift > 0:
            yield _quantities(impact, events, v0, answer, **{name: 1 + shift if name == "gain" else shift})


def _noise(impact: Impact, events: Events, v0: Speed | None) -> dict[str, float]:
    """White noise of the samples in between, carried through the integrals."""
    if events.start is None or events.end is None:
        return {}
    duration = events.end.t - events.start.t
    u_j = events.noise * math.sqrt(float(events.t[1] - events.t[0]) * max(duration, 0.0))
    if events.ringing is not None:
        # Ringing is left in J, but it is the head's, not the specimen's: what it can add counts as uncertain.
        u_j = math.hypot(u_j, float(np.hypot(*events.ringing.pair)) / (2 * math.pi * events.ringing.frequency))
    found = {"J": u_j}
    if v0 is not None:
        per_mass = u_j / impact.mass
        found |= {
            "v1": per_mass,
            "eps_exact": per_mass / v0.value,
            "eps_published": per_mass / v0.value,
            # δα = (1/m)∫(t_c − s)·δF ds; δE = ∫w·δF ds with w = v(s) − (J − J(s))/m, close to −v1 throughout
            "alpha_r": per_mass * duration / math.sqrt(3),
            "E_diss": u_j * v0.value,
        }
    return found
