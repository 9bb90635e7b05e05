"""What a specimen is beyond the massless plate and the half-space: a plate with mass, a layer of finite thickness."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any


@dataclass(frozen=True)
class Mode:
    """An axisymmetric mode: M kg at the plate's middle, omega rad/s."""

    M: float
    omega: float


@cache
def shapes(count: int, nu: float) -> tuple[tuple[float, float], ...]:
    """λ and ∫φ²dA/(πR²) of the first modes of a simply supported round plate, φ = 1 in the middle.

    φ = J₀(λρ) − J₀(λ)/I₀(λ)·I₀(λρ) with J₁(λ)/J₀(λ) + I₁(λ)/I₀(λ) = 2λ/(1 − ν): Leissa, *Vibration of Plates*, 2.1.2.
    """
    from scipy.integrate import quad
    from scipy.optimize import brentq
    from scipy.special import ive, jv

    def edge(x: float) -> float:  # the equation times J₀
        return float(jv(1, x) + jv(0, x) * (ive(1, x) / ive(0, x) - 2 * x / (1 - nu)))

    found: list[tuple[float, float]] = []
    for k in range(count):
        found_at: Any = brentq(edge, 1.0 + k * math.pi, 1.0 + (k + 1) * math.pi, xtol=1e-14)
        root = float(found_at)
        share = float(jv(0, root) / ive(0, root)) * math.exp(-root)

        def shape(rho: float, root: float = root, share: float = share) -> float:
            return float(jv(0, root * rho) - share * ive(0, root * rho) * math.exp(root * rho))

        def weighted(rho: float, shape: Callable[[float], float] = shape) -> float:
            return 2 * rho * shape(rho) ** 2

        area: Any = quad(weighted, 0, 1, epsabs=1e-12)[0]
        found.append((root, float(area) / shape(0) ** 2))
    return tuple(found)


def modes_of(count: int, E: float, nu: float, d: float, R: float, density: float) -> tuple[Mode, ...]:
    """The first modes of a plate: thickness d, radius R (m), density kg/m³."""
    D = E * d**3 / (12 * (1 - nu**2))
    per_area = density * d
    return tuple(
        Mode(per_area * math.pi * R**2 * area, root**2 / R**2 * math.sqrt(D / per_area))
        for root, area in shapes(count, nu)
    )


@dataclass(frozen=True)
class Layer:
    """A layer of thickness h (m) that slides on a rigid base, under a tip of radius r (m).

    Its force over that of a half-space: Dimitriadis et al., Biophys. J. 82 (2002) 2798, (15).
    """

    r: float
    h: float
    nu: float

    def factor(self, alpha1: float) -> float:
        """F over K_i·α₁^1.5."""
        a = -0.347 * (3 - 2 * self.nu) / (1 - self.nu)
        b = 0.056 * (5 - 2 * self.nu) / (1 - self.nu)
        x = math.sqrt(self.r * max(alpha1, 0.0)) / (self.h * math.pi)
        third = -8 * (a**3 + 4 * math.pi**2 / 15 * b)
        fourth = 16 * a * (a**3 + 3 * math.pi**2 / 5 * b)
        return 1 + x * (-2 * a + x * (4 * a * a + x * (third + x * fourth)))
