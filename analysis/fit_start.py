"""Where a fit begins: parameters by a regression that solves nothing, ringing by the spectrum of what is left."""

from __future__ import annotations

import numpy as np

from analysis.fit_problem import DAMPER, FLOW, LN_E, MODES, SLOWEST, T0, V0, Problem
from analysis.models import overhang, plate_stiffness, tip_stiffness
from analysis.record import Array

_SHARE = 0.1
"""Of F_M: the regression looks at what is above."""
_NEAR = 1e-3
"""Of E: the regression's own error is ten times as large."""
_ENOUGH = 300
"""Points."""
_LAG = 0.003
"""Of the contact's length: C_d/K_d to begin with."""
_DECAYS = (0.03, 0.07, 0.15, 0.3, 0.7, 1.5)
"""Of the contact's length."""
_TOP = 30e3
"""Hz."""
_SURE = 30.0
"""Drop of χ² that noise alone does not give over the frequencies and decays tried."""


def start_of(problem: Problem) -> Array:
    """(p,) parameters to begin with, ringing left out.

    Of the integrals of the record, α = (F/K_i)^(2/3) + c·∫F dt + F/K_d; beside the spring, F = K_i·α^(3/2) + C·v.
    """
    w, i = problem.window, problem.impact
    inside = (w.t > w.start) & (w.t < w.start + w.length)
    since, pushed = w.t[inside] - w.start, w.force[inside]
    impulse = np.cumsum(pushed) * w.step
    speed = w.v0.value + i.g * since - impulse / i.mass
    depth = np.cumsum(speed) * w.step
    on = np.flatnonzero(w.kept[inside] & (pushed > _SHARE * pushed.max()) & (depth > 0))
    on = on[:: max(1, on.size // _ENOUGH)]
    F, J, v, alpha = pushed[on], impulse[on], speed[on], depth[on]
    assert i.nu is not None, "the caller has seen to it"
    x = np.zeros(MODES)
    x[LN_E], x[V0], x[T0] = np.log(3e9), w.v0.value, w.start
    if problem.kind == "parallel":
        per_GPa = tip_stiffness(i.tip_radius, 1e9, i.nu)[0]
        a, b = np.linalg.lstsq(np.column_stack((per_GPa * alpha**1.5, v)), F, rcond=None)[0]
        x[LN_E], x[DAMPER] = np.log(1e9 * max(a, 1e-3)), max(b, 0.0)
        return x
    flows = problem.kind != "conservative"
    bends = problem.kind == "flexed"
    pressing = F ** (2 / 3)
    for _ in range(20):
        E = float(np.exp(x[LN_E]))
        stiffness, share = tip_stiffness(i.tip_radius, E, i.nu, i.tip_E, i.tip_nu)
        pressed, bent = pressing * stiffness ** (-2 / 3), np.zeros(F.size)
        if bends:
            assert i.thickness is not None
            assert i.support_radius is not None
            K_d = plate_stiffness(i.thickness, i.support_radius, E, i.nu)
            if "overhang" in problem.corrections:
                assert i.diameter is not None
                K_d *= overhang(i.diameter / 2, i.support_radius, i.nu)
            bent, x[DAMPER] = F / K_d, _LAG * w.length * K_d
        by_E, missing = -2 / 3 * share * pressed - bent, alpha - pressed - bent - x[FLOW] * J
        EE, EJ, JJ = by_E @ by_E, by_E @ J, J @ J
        determinant = EE * JJ - EJ * EJ if flows else 1.0
        step = (
            ((by_E @ missing) * JJ - (J @ missing) * EJ) / determinant if flows else (by_E @ missing) / EE,
            ((J @ missing) * EE - (by_E @ missing) * EJ) / determinant if flows else 0.0,
        )
        x[LN_E] += min(max(step[0], -1.0), 1.0)
        x[FLOW] += step[1]
        if abs(step[0]) < _NEAR:
            break
    x[FLOW] = max(x[FLOW], 0.0)
    return x


def ringing_in(problem: Problem, left: Array, t0: float) -> tuple[float, float, float] | None:
    """Frequency (Hz), decay (s) and amplitude (N) of the ringing in what a fit ``left`` (n,) N; None without."""
    w = problem.window
    since = w.t - t0
    on = since > 0
    left = np.where(w.kept, left, 0.0)[on]
    since = since[on]
    size = 1 << int(np.ceil(np.log2(2 * since.size)))
    frequency = np.fft.rfftfreq(size, w.step)
    band = (frequency > SLOWEST / w.length) & (frequency < min(_TOP, 0.25 / w.step))
    if not band.any():
        return None
    best = (0.0, 0.0, 0.0, 0.0)
    for decay in (share * w.length for share in _DECAYS):
        fading = np.exp(-since / decay)
        weight = 0.5 * float(fading @ fading)
        size_at = np.abs(np.fft.rfft(left * fading, size)[band])
        top = int(np.argmax(size_at))
        height = float(size_at[top])
        best = max(best, (height**2 / weight, float(frequency[band][top]), decay, height / weight))
    return best[1:] if best[0] > _SURE * problem.noise**2 else None
