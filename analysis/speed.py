"""Impact and rebound speed by every route that a rig offers."""

from __future__ import annotations

import math
from dataclasses import dataclass

from analysis.conditions import GateSetup, Impact
from analysis.record import Record


@dataclass(frozen=True)
class Speed:
    """A speed, m/s, and its standard uncertainty, m/s."""

    value: float
    u: float


def height_speed(impact: Impact) -> Speed | None:
    """√(2·(g − f/m)·h) from the drop height."""
    if impact.height is None or not impact.height > 0 or not impact.g_falling > 0:
        return None
    v0 = math.sqrt(2 * impact.g_falling * impact.height)
    return Speed(v0, impact.g_falling * (impact.u_height or 0.0) / v0)


def gate_speed(record: Record, impact: Impact, t_contact: float, u_contact: float) -> Speed | None:
    """Impact speed by the photogate: w/Δt is the speed at mid-time, carried to contact by g − f/m."""
    passage = _passage(record, impact.gate, 0)
    if impact.gate is None or passage is None:
        return None
    speed, mid = passage
    if record.gate_on_record_clock:
        if not mid < t_contact:
            return None
        gained = impact.g_falling * (t_contact - mid)
        return Speed(speed.value + gained, math.hypot(speed.u, impact.g_falling * u_contact))
    if impact.gate.gap is None:
        return None
    v0 = math.sqrt(speed.value**2 + 2 * impact.g_falling * impact.gate.gap)
    return Speed(v0, speed.u * speed.value / v0)


def gate_rebound(record: Record, impact: Impact, t_end: float, u_end: float) -> Speed | None:
    """Rebound speed by the photogate, carried back to the contact height by g + f/m."""
    passage = _passage(record, impact.gate, 2)
    if impact.gate is None or passage is None:
        return None
    speed, mid = passage
    if record.gate_on_record_clock:
        if not mid > t_end:
            return None
        lost = impact.g_rising * (mid - t_end)
        return Speed(speed.value + lost, math.hypot(speed.u, impact.g_rising * u_end))
    if impact.gate.gap is None:
        return None
    v1 = math.sqrt(speed.value**2 + 2 * impact.g_rising * impact.gate.gap)
    return Speed(v1, speed.u * speed.value / v1)


def flight_rebound(impact: Impact, t_nc: float, u_t_nc: float) -> Speed | None:
    """Rebound speed from the time between contacts, P2 (6): g·t_nc/2 without friction.

    With guide friction the rise and the fall differ: t_nc = v1·(1/g_r + 1/√(g_r·g_f)), g_r = g + f/m, g_f = g − f/m.
    """
    rising, falling = impact.g_rising, impact.g_falling
    if not falling > 0 or not t_nc > 0:
        return None
    per_second = 1 / (1 / rising + 1 / math.sqrt(rising * falling))
    return Speed(per_second * t_nc, per_second * u_t_nc)


def _passage(record: Record, gate: GateSetup | None, first: int) -> tuple[Speed, float] | None:
    edges = record.gate_edges[first : first + 2]
    if gate is None or len(edges) < 2 or not all(math.isfinite(e) for e in edges):
        return None
    passed = edges[1] - edges[0]
    if not passed > 0 or not gate.flag_width > 0:
        return None
    value = gate.flag_width / passed
    width = math.hypot(gate.u_flag_width, math.sqrt(2) * gate.u_edge) / gate.flag_width
    return Speed(value, value * math.hypot(width, math.sqrt(2) * gate.clock / passed)), (edges[0] + edges[1]) / 2
