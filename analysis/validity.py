"""Is the model valid here? Each check: a value, the limit it is held against, a word, and what it means.

Sources: Hertz and yield, Tabor, *The Hardness of Metals* (1951): mean pressure at full plasticity 3·σ_y, dynamic
hardness. Layer of finite thickness that slides on its base: Dimitriadis et al., Biophys. J. 82 (2002) 2798, (15).
Overhang, membrane, small deflection: Timoshenko and Woinowsky-Krieger, *Theory of Plates and Shells*, 16, 100.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from analysis.findings import Caution
from analysis.fit import Fit
from analysis.fit_intervals import interval
from analysis.fit_problem import DAMPER, FLOW, LN_E, T0
from analysis.models import on_layer, overhang
from analysis.record import Array
from analysis.rupture import plate_stress

WITHIN, BEYOND, CORRECTED, UNKNOWN, TOLD = "within", "beyond", "corrected", "not known", "told"
THIN, SMALL_DEFLECTION, MEMBRANE, OVERHANG = 0.2, 0.5, 0.05, 0.02
READ_AS_DAMPER, FIRST_MODE, DENSITY = 0.23, 0.285, 1300.0
"""C_d over √(M₁·K_d) that a fit reads out of a plate with mass alone (`bench/plate.py`: up to 0.21, with 0 to 5 % of
damping); M₁ over the plate's mass inside its ring; kg/m³, of polymers."""
HALF_SPACE = 0.02
"""Of F: what a layer's base may add before E reads high for it."""


@dataclass(frozen=True)
class Check:
    """``limit`` None: the number is told, nothing is held against it."""

    name: str
    value: float | None
    unit: str
    limit: float | None
    text: str
    corrected: bool = False

    @property
    def word(self) -> str:
        """within, beyond, corrected, not known or told."""
        if self.value is None:
            return UNKNOWN
        if self.corrected:
            return CORRECTED
        return TOLD if self.limit is None else WITHIN if self.value <= self.limit else BEYOND


@dataclass(frozen=True)
class Peak:
    """At maximum force: F N, α₁ and α₃ m, t_M s; J N·s and v1 m/s of the whole contact."""

    F: float
    alpha_1: float
    alpha_3: float
    t_M: float
    J: float
    v1: float


def peak_of(fit: Fit) -> Peak:
    """The peak of the fitted contact, as far as the record was seen."""
    constants = fit.problem.constants(fit.best.x)
    m, g, K, q, beside, v0 = (float(constants[k]) for k in (0, 1, 3, 5, 7, 8))
    t: Array = (np.arange(8000) + 0.5) / 8000 * 2 * fit.problem.window.length
    F = fit.problem.contact(fit.best.x, t + fit.best.x[T0])
    F[t + fit.best.x[T0] > fit.problem.window.reach] = 0.0
    top = int(np.argmax(F))
    J = float(F.sum() * (t[1] - t[0]))
    length = float(t[np.flatnonzero(F > 0)[-1]])
    alpha_1 = (float(F[top]) / K) ** (2 / 3) if beside == 0 else v0 * float(t[top])
    return Peak(float(F[top]), alpha_1, float(F[top]) * q, float(t[top]), J, J / m - v0 - g * length)


def validity(fit: Fit) -> tuple[list[dict[str, Any]], list[Caution]]:
    """All checks of a fit as JSON, and a caution for each that is beyond its limit."""
    checks = list(_checks(fit, peak_of(fit)))
    rows = [
        {"check": c.name, "value": c.value, "unit": c.unit, "limit": c.limit, "word": c.word, "text": c.text}
        for c in checks
    ]
    return rows, [
        Caution(f"beyond-{c.name}", f"{c.text}: {c.value:.3g} {c.unit}, the limit is {c.limit:.3g}".replace(" 1,", ","))
        for c in checks
        if c.word == BEYOND
    ]


def _checks(fit: Fit, peak: Peak) -> Iterator[Check]:
    impact, kind, done = fit.problem.impact, fit.problem.kind, fit.problem.corrections
    E, r, d = float(np.exp(fit.best.x[LN_E])), impact.tip_radius, impact.thickness
    assert impact.nu is not None, "it was fitted"
    a = math.sqrt(r * peak.alpha_1)
    full = None if impact.yield_stress is None else 3 * impact.yield_stress
    text = "mean contact pressure F/(πa²) past 3·σ_y: the contact has yielded, E is fitted beyond Hertz's range"
    yield Check("contact-pressure", peak.F / (math.pi * a * a), "Pa", full, text)
    if kind == "flexed" and d is not None and impact.support_radius is not None:
        yield from _plate(fit, peak, E, d, impact.support_radius, impact.nu)
    else:
        yield Check("strain-rate", 0.2 * a / (r * peak.t_M), "1/s", None, "of the indentation, 0.2·a/(r·t_M)")
        if d is not None:
            share = on_layer(math.sqrt(r * peak.alpha_1) / d, impact.nu) - 1
            text = "share of F_M that the base under the specimen adds: E reads higher by more than it"
            yield Check("finite-thickness", share, "1", HALF_SPACE, text, "finite-thickness" in done)
    if d is not None:
        yield Check("thickness-over-contact-radius", d / a, "1", None, "thickness over contact radius")
    depth = peak.J * float(fit.best.x[FLOW])
    if depth > 0 and kind != "parallel" and fit.problem.window.whole and peak.v1 > 0:
        work = 0.5 * impact.mass * (fit.problem.window.v0.value**2 - 0.375 * peak.v1**2)
        text = "dynamic hardness (Tabor), energy over the volume π·r·α_perm² of the mark"
        yield Check("dynamic-hardness", work / (math.pi * r * depth**2), "Pa", None, text)


def _plate(fit: Fit, peak: Peak, E: float, d: float, R: float, nu: float) -> Iterator[Check]:
    text = "thickness over support diameter: thick for plate theory"
    yield Check("thin-plate", d / (2 * R), "1", THIN, text)
    ratio = peak.alpha_3 / d
    text = "deflection over thickness: large for plate theory, the plate stretches as well"
    yield Check("deflection", ratio, "1", SMALL_DEFLECTION, text)
    stretch = 0.272 * ratio**2
    text = "share of the plate's force that stretching of its middle carries: E reads high by it at the peak"
    yield Check("membrane", stretch / (1 + stretch), "1", MEMBRANE, text)
    diameter = fit.problem.impact.diameter
    stiffer = None if diameter is None else overhang(diameter / 2, R, nu) - 1
    text = "stiffening of the plate by what overhangs its ring: E reads high by it"
    yield Check("overhang", stiffer, "1", OVERHANG, text, "overhang" in fit.problem.corrections)
    inertia = READ_AS_DAMPER * math.sqrt(FIRST_MODE * DENSITY * math.pi * R**2 * d * peak.F / peak.alpha_3)
    text = (
        f"C_d that the mass of the plate would explain ({DENSITY:g} kg/m³), the record's C_d is not surely above: it "
        "need not be of the material, and E may read up to 1.5 % low"
    )
    yield Check("plate-inertia", inertia, "kg/s", interval(fit, DAMPER)[1], text)
    yield Check(
        "strain-rate",
        plate_stress(peak.F, d, R, nu) / (E * peak.t_M),
        "1/s",
        None,
        "of the plate's lower face, σ/(E·t_M)",
    )
