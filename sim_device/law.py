"""Constants of dart and specimen, and the force of the contact from them (PHYSICS.md, Models)."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sim_device.plate import Layer, Mode, modes_of
from sim_device.settings import Dart, Specimen

Floats = NDArray[np.float64]

GIVES_WAY = 10e-6
"""s, time constant with which a specimen loses stiffness, K_i and K_d alike: by a crack in part, by failure all."""
SLIPS = 40e-6
"""s, time constant with which a specimen that slips comes to rest."""
LEAST_LAG = 1e-10
"""s; a plate that follows faster (C_d/K_d) is taken to follow at once. That moves ε by less than 1e-6, and the rounding
of α₁ alone would keep the integrator from ever getting through."""


@dataclass(frozen=True)
class Law:
    """Constants of dart and specimen.

    m : kg; friction : N; K_i : N/m^1.5 (P1 eq. 16); K_d : N/m, inf when rigid (P1 eq. 14); C_i : kg/s, inf without
    dashpot; C_d : kg/s; modes : of a plate with mass, damping : ζ of each
    layer : of a specimen of finite thickness, None for a half-space
    fail_N, crack_N, slip_N : N at which it fails, cracks, slips; inf: never
    crack_loss : of its stiffness that a crack takes; slip : m that it gives way.
    """

    m: float
    friction: float
    K_i: float
    K_d: float
    C_i: float
    C_d: float
    fail_N: float = math.inf
    modes: tuple[Mode, ...] = ()
    damping: float = 0.0
    layer: Layer | None = None
    crack_N: float = math.inf
    crack_loss: float = 0.0
    slip_N: float = math.inf
    slip: float = 0.0

    @classmethod
    def of(cls, specimen: Specimen, dart: Dart) -> Law:
        """The law of a specimen under a dart."""
        E, nu = specimen.E_GPa * 1e9, specimen.nu
        d, R = specimen.thickness_mm * 1e-3, specimen.support_radius_mm * 1e-3
        ring = specimen.kind == "ring"
        dashpot = specimen.C_i if ring else specimen.C
        tip = dart.tip_radius_mm * 1e-3
        return cls(
            m=dart.mass_kg,
            friction=dart.friction_N,
            K_i=4 / 3 * math.sqrt(tip) * E / (1 - nu**2),
            K_d=4 * math.pi / 3 * d**3 / ((1 - nu) * (3 + nu) * R**2) * E if ring else math.inf,
            C_i=math.inf if dashpot is None else dashpot,
            C_d=specimen.C_d if ring else 0.0,
            fail_N=math.inf if specimen.fail_N is None else specimen.fail_N,
            modes=modes_of(specimen.modes, E, nu, d, R, specimen.density_kg_m3) if ring else (),
            damping=specimen.modal_damping,
            layer=None if ring or not specimen.finite else Layer(tip, d, nu),
            crack_N=math.inf if specimen.crack_N is None else specimen.crack_N,
            crack_loss=specimen.crack_loss,
            slip_N=math.inf if specimen.slip_N is None else specimen.slip_N,
            slip=specimen.slip_mm * 1e-3,
        )

    def after(self, *, cracked: bool, slipped: bool) -> Law:
        """The law of the next hit: a specimen cracks once, and slips once."""
        kept = 1 - self.crack_loss if cracked else 1.0
        return replace(
            self,
            K_i=self.K_i * kept,
            K_d=self.K_d * kept,
            crack_N=math.inf if cracked else self.crack_N,
            slip_N=math.inf if slipped else self.slip_N,
        )

    @property
    def bends(self) -> bool:
        """Whether α₃ is a state of its own; else (C_d = 0, or as good as) it follows from the force at once."""
        return math.isfinite(self.K_d) and self.C_d > LEAST_LAG * self.K_d and not self.modes

    @property
    def at_once(self) -> float:
        """m/N, bending that follows the force at once: all of a massless plate's, the rest of one with modes."""
        return max(0.0, 1 / self.K_d - sum(1 / (m.M * m.omega**2) for m in self.modes))

    def gap(self, y: Floats) -> Floats:
        """δ in m of states (4 + 2n, …): what the tip is in the surface that it would meet without force."""
        return y[0] - y[2] - y[3] - y[4::2].sum(axis=0)

    def spring(self, alpha1: Floats) -> Floats:
        """F in N at α₁ ≥ 0 (n,), m."""
        F = self.K_i * alpha1**1.5
        return F if self.layer is None else F * np.vectorize(self.layer.factor)(alpha1)

    def spring_at(self, alpha1: float) -> float:
        """``spring`` for one value."""
        F = self.K_i * alpha1 * math.sqrt(alpha1)
        return F if self.layer is None else F * self.layer.factor(alpha1)

    def indentation(self, delta: Floats) -> Floats:
        """α₁ in m from δ = α₁ + α₃ in m, where α₃ = F/K_d at once (C_d = 0), its share of it (modes) or 0 (rigid).

        With u = √α₁ that is K u³/K_d + u² = δ, convex in u, so Newton from √δ comes down to the root.
        """
        delta = np.maximum(delta, 0.0)
        if math.isinf(self.K_d):
            return delta
        ratio = self.K_i * self.at_once
        u = np.sqrt(delta)
        for _ in range(60):
            step = (ratio * u**3 + u * u - delta) / np.maximum(3 * ratio * u * u + 2 * u, 1e-300)
            u = u - step
            if np.all(np.abs(step) <= 1e-15 * np.abs(u) + 1e-300):
                break
        return u * u

    def indentation_of(self, delta: float) -> float:
        """``indentation`` for one value, without numpy's overhead on scalars."""
        if delta <= 0 or math.isinf(self.K_d):
            return max(delta, 0.0)
        ratio, u = self.K_i * self.at_once, math.sqrt(delta)
        for _ in range(60):
            step = (ratio * u**3 + u * u - delta) / (3 * ratio * u * u + 2 * u)
            u -= step
            if abs(step) <= 1e-15 * u:
                break
        return u * u
