"""Lumped models of a contact: Hertzian spring, plate, and dashpots in series or beside them (P1 (8)–(16), P2 (7)–(14)).

One form serves the flexed plate, the series dashpot, the conservative model and every limit between them. With
c = 1/C_i, q = 1/K_d and θ = C_d·q, any of which may be 0, δ = α₁ + α₃ and F = K_i·max(α₁, 0)^(3/2):

    v' = g − F/m,   δ' = v − c·F,   θ·α₁' = θ·(v − c·F) + δ − α₁ − q·F

θ = 0 makes the last line algebraic: a plate without damper, exactly. The parallel dashpot has F = K_i·α^(3/2) + C·v.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Kind = Literal["conservative", "parallel", "series", "flexed"]


def contact_stiffness(tip_radius: float, E: float, nu: float) -> float:
    """K_i in N/m^1.5 of a sphere of radius r (m) on a half-space: 4/3·√r·E/(1 − ν²) (P1 (16)); E in Pa."""
    return 4 / 3 * math.sqrt(tip_radius) * E / (1 - nu**2)


def tip_stiffness(
    tip_radius: float, E: float, nu: float, tip_E: float | None = None, tip_nu: float = 0.3
) -> tuple[float, float]:
    """K_i in N/m^1.5 under a tip that may be compliant (P2 (8)), and the share of ln E in ln K_i (1 under a rigid one).

    4/3·√r/((1 − ν₁²)/E₁ + (1 − ν₂²)/E₂); E, tip_E in Pa, tip_E None: rigid.
    """
    own = (1 - nu**2) / E
    both = own + (0.0 if tip_E is None else (1 - tip_nu**2) / tip_E)
    return 4 / 3 * math.sqrt(tip_radius) / both, own / both


def plate_stiffness(thickness: float, support_radius: float, E: float, nu: float) -> float:
    """K_d in N/m of a round plate, simply supported: 4π/3·d³E/((1 − ν)(3 + ν)R²) (P1 (14)); m, Pa."""
    return 4 * math.pi / 3 * thickness**3 / ((1 - nu) * (3 + nu) * support_radius**2) * E


def overhang(b: float, R: float, nu: float) -> float:
    """K_d of a plate of radius ``b`` on a ring of radius ``R`` (m) over that of one that ends at the ring.

    w = FR²/(16πD)·[2 + (1 − ν)/(1 + ν)·(R/b)²] (Timoshenko and Woinowsky-Krieger, *Theory of Plates and Shells*, 16).
    """
    share = (1 - nu) / (1 + nu)
    return (2 + share) / (2 + share * (R / max(b, R)) ** 2)


def layer(nu: float) -> tuple[float, float, float, float]:
    """Coefficients of χ … χ⁴, χ = √(r·α₁)/h, in the force of a layer that slides on a rigid base over a half-space's.

    Dimitriadis et al., Biophys. J. 82 (2002) 2798, (15).
    """
    a = -0.347 * (3 - 2 * nu) / (1 - nu)
    b = 0.056 * (5 - 2 * nu) / (1 - nu)
    pi = math.pi
    return (
        -2 * a / pi,
        4 * a**2 / pi**2,
        -8 / pi**3 * (a**3 + 4 * pi**2 / 15 * b),
        16 * a / pi**4 * (a**3 + 3 * pi**2 / 5 * b),
    )


def on_layer(chi: float, nu: float) -> float:
    """Force on a layer over that on a half-space."""
    return 1 + sum(k * chi**n for n, k in enumerate(layer(nu), 1))


def hunt_crossley(restitution: float, v0: float) -> float:
    """χ in s/m of F = K_i·α^(3/2)·(1 + χ·v): 1.5·(1 − ε)/v0 (Hunt and Crossley, J. Appl. Mech. 42 (1975) 440)."""
    return 1.5 * (1 - restitution) / v0


@dataclass(frozen=True)
class Model:
    """Constants of a contact, SI.

    mass : kg; K_i : N/m^1.5; K_d : N/m, inf on a rigid support; C_i : kg/s in series, inf without; C_d : kg/s of the
    plate; C : kg/s beside the spring (parallel); chi : s/m of a dashpot that grows with it, F = K_i·α^(3/2)·(1 + χ·v)
    (parallel; Hunt and Crossley); g : m/s²
    """

    kind: Kind
    mass: float
    K_i: float
    K_d: float = math.inf
    C_i: float = math.inf
    C_d: float = 0.0
    C: float = 0.0
    chi: float = 0.0
    g: float = 9.80665

    def __post_init__(self) -> None:
        """Refuse what no contact has.

        Raises
        ------
        ValueError : names the constant and its limit.
        """
        for name in ("mass", "K_i", "K_d", "C_i"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} has to be above 0, not {getattr(self, name):g}")
        for name in ("C_d", "C", "chi", "g"):
            if not (0 <= getattr(self, name) < math.inf):
                raise ValueError(f"{name} has to be 0 or more, and finite, not {getattr(self, name):g}")

    @property
    def flow(self) -> float:
        """c = 1/C_i."""
        return 1 / self.C_i

    @property
    def bending(self) -> float:
        """q = 1/K_d."""
        return 1 / self.K_d

    @property
    def lag(self) -> float:
        """θ = C_d/K_d, s."""
        return self.C_d * self.bending
