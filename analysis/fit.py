"""E and the damper coefficients of one record, with intervals, by least squares on a lumped model.

The start of contact, the zero level, v0 and the ringing of head and plate are fitted with them: left out, each leaks
into the dampers (docs/fits.md). The whole contact is taken, with what lies before and after.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from analysis.conditions import Impact
from analysis.events import locate
from analysis.failure import outcome_of
from analysis.fit_problem import MODES, T0, Corrected, Problem
from analysis.fit_start import ringing_in, start_of
from analysis.fit_window import Window, until, window_of
from analysis.levenberg import Optimum, minimise
from analysis.models import Kind
from analysis.record import Array, Record

_MODES = 2
_RISING = 0.9
"""Of a contact that is cut off: where its greatest force may lie, at the latest."""
_ALONG = 1.5
"""Of white noise: correlation of what is left, past which the intervals are widened by it."""
_UNRESTED = 1.5
"""Standard deviations of a cosine past which the start of contact is looked for elsewhere,"""
_SHIFTS = (-0.2, -0.1, 0.1, 0.2)
"""so many of the ringing's periods away."""
_WORTH = 20.0
"""Drop of χ² that a ringing mode has to bring, for its four parameters."""


class NotFitted(ValueError):
    """Why a record is not fitted, in words for the operator."""


@dataclass(frozen=True)
class Fit:
    """A problem at its best point. noise : N, of a point, as the residuals have it; widened : times the white noise."""

    problem: Problem
    best: Optimum
    widened: float

    @property
    def left(self) -> Array:
        """(n,) N, data less model."""
        return -self.best.residuals[: self.problem.window.t.size] * self.problem.noise

    @property
    def bic(self) -> float:
        """Schwarz's criterion, up to what is the same for every model of one window."""
        n = int(self.problem.window.kept.sum())
        left = self.left[self.problem.window.kept]
        return n * float(np.log(left @ left / n)) + int(self.problem.free.sum()) * float(np.log(n))


def fit_record(
    record: Record, impact: Impact, kind: Kind | None = None, corrections: tuple[Corrected, ...] = ()
) -> Fit:
    """Fit ``kind``, or the model of the support, to a record; ``corrections`` of the model are named in its answer.

    Raises
    ------
    NotFitted : says why not, and what to do.
    """
    events = locate(record, impact)
    if events is None or events.start is None:
        raise NotFitted("no model is fitted: the record holds no contact with its beginning")
    outcome = outcome_of(record, impact, events)
    events, v0 = outcome.events, outcome.v0
    if v0 is None:
        raise NotFitted("no model is fitted: the speed at contact is not known; give v0, a drop height or a gate")
    kind = kind or ("flexed" if impact.support == "ring" else "series")
    _allowed(impact, kind, corrections)
    window = window_of(record, events, v0)
    if outcome.broke is not None:
        window = until(window, outcome.broke)
    _closes(window, impact)
    return fit_window(window, impact, kind, corrections)


def _allowed(impact: Impact, kind: Kind, corrections: tuple[Corrected, ...]) -> None:
    if impact.shape != "plate":
        raise NotFitted(f"no model is fitted: the specimen's shape is {impact.shape!r}, the models are of plates")
    wanted = {"tip_radius": impact.tip_radius, "nu": impact.nu}
    if kind == "flexed":
        wanted |= {"thickness": impact.thickness, "support_radius": impact.support_radius}
    if "overhang" in corrections:
        if kind != "flexed":
            raise NotFitted(f"no model is fitted: overhang is a plate's, the {kind} model has none")
        wanted |= {"diameter": impact.diameter}
    if "finite-thickness" in corrections:
        if kind == "flexed":
            raise NotFitted("no model is fitted: finite thickness is of a specimen on a rigid support, not of a plate")
        wanted |= {"thickness": impact.thickness}
    for name, value in wanted.items():
        if value is None:
            raise NotFitted(f"no model is fitted: the {kind} model needs {name}")
        if name != "nu" and not value > 0:
            raise NotFitted(f"no model is fitted: {name} has to be above 0, it is {value:g}")
    assert impact.nu is not None
    if not -1 < impact.nu < 0.5:
        raise NotFitted(f"no model is fitted: nu has to lie between −1 and 0.5, it is {impact.nu:g}")


def _closes(window: Window, impact: Impact) -> None:
    """An impulse that no contact can have: a unit is wrong. And a record that has not seen the force fall."""
    if not window.whole and window.t[int(np.argmax(window.force))] > window.start + _RISING * window.length:
        raise NotFitted(
            "no model is fitted: the record ends before the force has passed its maximum; record a longer window"
        )
    if not window.whole or window.left_out is not None:
        return
    inside = (window.t > window.start) & (window.t < window.start + window.length)
    ratio = float(window.force[inside].sum()) * window.step / (impact.mass * window.v0.value)
    weight = impact.g * window.length / window.v0.value
    if not 0.9 < ratio < 2.2 + weight:
        raise NotFitted(
            f"no model is fitted: the energy does not close; the impulse is {ratio:.3g} times m·v0, a contact that "
            "turns the dart has 1 to 2: did the specimen fail, or are force, mass and v0 not in N, kg and m/s?"
        )


def fit_window(window: Window, impact: Impact, kind: Kind, corrections: tuple[Corrected, ...] = ()) -> Fit:
    """Fit ``kind`` to a window; as `fit_record`."""
    problem = Problem(kind, impact, window, window.noise, corrections=corrections)
    first = start_of(problem)
    best = _minimised(problem, first)
    for _ in range(_MODES):
        found = ringing_in(problem, -best.residuals[: window.t.size] * problem.noise, float(best.x[T0]))
        if found is None:
            break
        # From the beginning again: what took the ringing for its own is a minimum beside the right one.
        more, x = problem.with_mode(np.concatenate((first, best.x[MODES:])), *found)
        better = _minimised(more, x)
        if np.abs(better.residuals[window.t.size + 2 :]).max() > _UNRESTED:
            # A ringing that does not begin at rest has taken the contact's beginning for its own.
            starts = [np.concatenate((x[:T0], [x[T0] + shift / found[0]], x[T0 + 1 :])) for shift in _SHIFTS]
            better = min([better, *(_minimised(more, start) for start in starts)], key=_chi2)
        if best.chi2 - better.chi2 < _WORTH * max(1.0, better.chi2 / window.t.size):
            break
        problem, best = more, better
    # The noise is what the residuals say it is; v0 and the zero level keep their own weight.
    n = int(window.kept.sum()) - int(problem.free.sum())
    if n < 20:
        raise NotFitted(f"no model is fitted: {int(window.kept.sum())} points are too few")
    left = best.residuals[: window.t.size]
    problem = replace(problem, noise=problem.noise * float(np.sqrt(left @ left / n)))
    widened = _along(left[window.kept])
    if widened > 1:
        problem = replace(problem, noise=problem.noise * widened)
    best = _minimised(problem, best.x)
    if not np.isfinite(best.chi2):
        raise NotFitted(f"no model is fitted: the {kind} model finds no contact like this record's")
    return Fit(problem, best, widened)


def _chi2(optimum: Optimum) -> float:
    return optimum.chi2


def _minimised(problem: Problem, x: Array) -> Optimum:
    return minimise(problem.residuals, x, problem.free, *problem.bounds())


def _along(left: Array) -> float:
    """√(1 + 2Σρ_k) of what a fit left (n,), over the lags before ρ first turns negative; 1 for white noise."""
    left = left - left.mean()
    size = 1 << int(np.ceil(np.log2(2 * left.size)))
    correlation = np.fft.irfft(np.abs(np.fft.rfft(left, size)) ** 2)[: left.size // 4]
    rho = correlation[1:] / max(float(correlation[0]), 1e-300)
    ends = np.flatnonzero(rho <= 0)
    total = 1 + 2 * float(rho[: ends[0] if ends.size else rho.size].sum())
    return float(np.sqrt(total)) if total > _ALONG else 1.0
