"""What an impact was made with: dart, specimen, support, speed and gate, in SI units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

STANDARD_GRAVITY = 9.80665


@dataclass(frozen=True)
class GateSetup:
    """A photogate and the flag that passes it.

    flag_width : m; u_flag_width, u_edge : m, standard uncertainties of the width and of where each edge
    switches; gap : m, beam height above first contact; clock : s, standard uncertainty of one stamp.
    """

    flag_width: float
    u_flag_width: float = 2e-5
    u_edge: float = 3e-5
    gap: float | None = None
    clock: float = 1e-6


@dataclass(frozen=True)
class Impact:
    """Conditions of an impact.

    mass : kg, the whole falling mass; tip_mass : kg, the part of it below the sensor
    tip_radius, thickness, support_radius : m; nu : 1, Poisson's ratio of the specimen
    v0 : m/s, speed at first contact when given outright; height : m, drop height
    g : m/s²; friction : N, guide friction, against the motion; catcher : the rebounding dart is caught
    tip_E : Pa, of the tip, None: rigid; tip_nu : 1; yield_stress : Pa, of the specimen; diameter : m, of a plate
    u_thickness, u_nu, u_tip_radius, u_support_radius,
    u_v0, u_height, u_mass, u_tip_mass : standard uncertainties in the unit of the quantity
    u_gain : 1, relative standard uncertainty of the force scale
    """

    mass: float
    tip_radius: float
    thickness: float | None
    nu: float | None
    support: Literal["ring", "rigid"]
    support_radius: float | None
    shape: str = "plate"
    tip_mass: float = 0.0
    v0: float | None = None
    u_v0: float | None = None
    height: float | None = None
    u_height: float | None = None
    g: float = STANDARD_GRAVITY
    catcher: bool = False
    friction: float = 0.0
    gate: GateSetup | None = None
    u_mass: float = 0.0
    u_tip_mass: float = 0.0
    u_gain: float = 0.0
    u_thickness: float = 0.0
    u_nu: float = 0.0
    u_tip_radius: float = 0.0
    u_support_radius: float = 0.0
    tip_E: float | None = None
    tip_nu: float = 0.3
    yield_stress: float | None = None
    diameter: float | None = None

    @property
    def g_falling(self) -> float:
        """m/s², acceleration of the falling dart: g − f/m."""
        return self.g - self.friction / self.mass

    @property
    def g_rising(self) -> float:
        """m/s², deceleration of the rising dart: g + f/m."""
        return self.g + self.friction / self.mass
