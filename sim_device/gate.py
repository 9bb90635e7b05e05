"""The photogate: when the dart's flag breaks and frees the beam."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim_device.fall import LONGEST_MOTION, Motion
from sim_device.settings import Gate

MOST_EDGES = 8


@dataclass(frozen=True)
class Edge:
    """An edge in s from first contact (true motion, jitter included), and whether the beam is free after it."""

    time: float
    free: bool


def edges(motion: Motion, gate: Gate, rng: np.random.Generator) -> list[Edge]:
    """Every edge of a drop in order, eight at the most.

    The beam is broken while the tip is within half a flag of ``gap_mm`` above contact. An edge's jitter is one of
    position, carried to time by the dart's speed there.
    """
    width = (gate.flag_width_mm + gate.width_error_mm) * 1e-3
    lead, trail = -gate.gap_mm * 1e-3 - width / 2, -gate.gap_mm * 1e-3 + width / 2
    found: list[Edge] = []
    flown = 0
    while len(found) < MOST_EDGES and flown < len(motion.flights):
        flight = motion.flights[flown]
        low, high = flight.apex, motion.contacts[flown][0] - flight.start if flown < len(motion.contacts) else np.inf
        reaches = flight.position(low) <= trail
        if reaches and flown >= len(motion.contacts):
            motion.extend(flight.start + 2.5 * flight.apex)
            high = motion.over - flight.start
        crossings = sorted((t, level) for level in (lead, trail) for t in flight.passes(level) if 0 < t <= high)
        for t, level in crossings if reaches else []:
            if motion.catcher and flown > 0 and t > flight.apex:
                break
            speed = flight.speed(t)
            moved = t + float(rng.normal()) * gate.edge_sd_mm * 1e-3 / max(abs(speed), 0.05)
            found.append(Edge(flight.start + moved, (level == trail) == (speed > 0)))
        flown += 1
        if flight.start + flight.apex > LONGEST_MOTION:
            break
    return sorted(found, key=lambda edge: edge.time)[:MOST_EDGES]
