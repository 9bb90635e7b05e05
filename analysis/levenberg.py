"""Least squares by Levenberg and Marquardt, with bounds kept by an active set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.record import Array

Residuals = Callable[[Array], tuple[Array, Array]]
_MOST = 60
_DONE = 1e-7
"""A step that would lower the weighted sum of squares by less than ten times this is not taken."""


@dataclass(frozen=True)
class Optimum:
    """x : (p,) the best point; chi2 : sum of squares there; N : (p, p) JᵀJ; at_bound : (p,) bool
    residuals : (n,); J : (p, n); solves : of the model; converged : bool
    """

    x: Array
    chi2: float
    N: Array
    at_bound: NDArray[np.bool_]
    residuals: Array
    J: Array
    solves: int
    converged: bool


def minimise(residuals: Residuals, x: Array, free: NDArray[np.bool_], low: Array, high: Array) -> Optimum:
    """From ``x`` (p,) along the ``free`` (p,) parameters within ``low``, ``high``."""
    x = np.clip(x, low, high)
    here, damping, solves, converged = residuals(x), 1e-4, 1, False
    chi2 = float(here[0] @ here[0])
    while solves < _MOST and not converged:
        normal, gradient = here[1] @ here[1].T, here[1] @ here[0]
        held = ((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0))
        better = None
        while better is None and solves < _MOST and damping < 1e10:
            trial = np.clip(x + _step(normal, gradient, free & ~held, damping), low, high)
            gain = float(-(2 * gradient + normal @ (trial - x)) @ (trial - x))
            if not gain > 10 * _DONE:
                converged = True
                break
            there = residuals(trial)
            solves += 1
            new = float(there[0] @ there[0])
            if new < chi2:
                better = trial, there, new
                damping = max(damping * (0.1 if chi2 - new > 0.5 * gain else 1.0), 1e-12)
            else:
                damping = max(damping * 10, 1e-6)
        if better is None:
            break
        x, here, chi2 = better
    normal, gradient = here[1] @ here[1].T, here[1] @ here[0]
    at_bound = free & (((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))
    return Optimum(x, chi2, normal, at_bound, here[0], here[1], solves, converged)


def _step(normal: Array, gradient: Array, on: NDArray[np.bool_], damping: float) -> Array:
    step = np.zeros(gradient.size)
    at = np.flatnonzero(on)
    if at.size:
        part = normal[at[:, None], at]
        scale = 1 / np.sqrt(np.maximum(part.diagonal(), 1e-300))
        scaled = part * scale * scale[:, None]
        scaled.flat[:: at.size + 1] += damping
        step[at] = -np.linalg.solve(scaled, gradient[at] * scale) * scale
    return step


def covariance(normal: Array, on: NDArray[np.bool_]) -> Array:
    """(p, p) inverse of JᵀJ over the parameters that are ``on``, 0 elsewhere."""
    at = np.flatnonzero(on)
    out = np.zeros_like(normal)
    if at.size:
        part = normal[np.ix_(at, at)]
        scale = np.sqrt(np.maximum(np.diag(part), 1e-300))
        out[np.ix_(at, at)] = np.linalg.pinv(part / np.outer(scale, scale), rcond=1e-13) / np.outer(scale, scale)
    return out
