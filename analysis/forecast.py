"""How long a contact may last, before it has happened: what part of a record to look at first."""

from __future__ import annotations

import math

from analysis.conditions import Impact
from analysis.models import contact_stiffness, plate_stiffness

SOFTEST = 0.5e9
"""Pa: polymers that are hit by a dart are hardly softer."""
SLOWEST = 0.5
"""m/s, taken where nothing says the speed: a slow contact is a long one."""


def longest_contact(impact: Impact, E: float = SOFTEST) -> float:
    """Contact time in s that a conservative impact would have, E (Pa) of the specimen given or taken as low.

    Hertz on a half-space lasts 2.943·α_M/v0 with α_M = (5 m v0²/4 K_i)^(2/5); the plate alone, a spring, half a period,
    π·√(m/K_d); in series their squares add as those of periods do (PHYSICS.md, Models).
    """
    nu = 0.35 if impact.nu is None else impact.nu
    v0 = impact.v0
    if v0 is None and impact.height is not None:
        v0 = math.sqrt(2 * impact.g_falling * impact.height)
    v0 = v0 or SLOWEST
    K_i = contact_stiffness(impact.tip_radius, E, nu)
    alpha_M = (5 * impact.mass * v0**2 / (4 * K_i)) ** 0.4
    contact = 2.9432 * alpha_M / v0
    if impact.support == "rigid" or impact.thickness is None or impact.support_radius is None:
        return contact
    K_d = plate_stiffness(impact.thickness, impact.support_radius, E, nu)
    return math.hypot(contact, math.pi * math.sqrt(impact.mass / K_d))
