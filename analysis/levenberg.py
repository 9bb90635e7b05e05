"""Least squares by Levenberg and Marquardt, with bounds kept by an active set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from analysis.record import Array

Residuals = Callable[[Array], tuple[Array, Array]]
_MOST = 60
_DONE = 1e-7
"""Relative: a step that would lower the sum of squares by less than this share of it, or of 1, is the last."""


@dataclass(frozen=True)
class Optimum:
    """x : (p,) the best point; chi2 : sum of squares there; N : (p, p) JᵀJ; gradient : (p,) Jᵀr; at_bound : (p,) bool;
    residuals : (n,); J : (n, p); solves : of the model; converged : bool
    """

    x: Array
    chi2: float
    N: Array
    gradient: Array
    at_bound: np.ndarray
    residuals: Array
    J: Array
    solves: int
    converged: bool


def minimise(residuals: Residuals, x: Array, free: np.ndarray, low: Array, high: Array) -> Optimum:
    """From ``x`` (p,) along the ``free`` (p,) parameters within ``low``, ``high``."""
    x = np.clip(x, low, high)
    r, J = residuals(x)
    chi2, damping, solves, converged = float(r @ r), 1e-4, 1, False
    while solves < _MOST and not converged:
        N, gradient = J.T @ J, J.T @ r
        downhill = ~(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))
        step_on = free & downhill
        accepted = False
        while solves < _MOST:
            step = _step(N, gradient, step_on, damping)
            trial = np.clip(x + step, low, high)
            step = trial - x
            gain = -(2 * gradient @ step + step @ N @ step)
            if not gain > _DONE * min(1.0, max(chi2, 1e-12)) * 10:
                converged = True
                break
            new_r, new_J = residuals(trial)
            solves += 1
            new = float(new_r @ new_r)
            if np.isfinite(new) and new < chi2:
                accepted = True
                damping = max(damping * (0.1 if chi2 - new > 0.5 * gain else 1.0), 1e-12)
                break
            damping = max(damping * 10, 1e-6)
            if damping > 1e10:
                break
        if not accepted:
            break
        converged = chi2 - new < _DONE * min(1.0, new)
        x, r, J, chi2 = trial, new_r, new_J, new
    N, gradient = J.T @ J, J.T @ r
    at_bound = free & (((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))
    return Optimum(x, chi2, N, gradient, at_bound, r, J, solves, converged)


def _step(N: Array, gradient: Array, on: np.ndarray, damping: float) -> Array:
    step = np.zeros(gradient.size)
    at = np.flatnonzero(on)
    if at.size:
        part = N[np.ix_(at, at)]
        scale = np.sqrt(np.maximum(np.diag(part), 1e-300))
        scaled = part / np.outer(scale, scale) + damping * np.eye(at.size)
        step[at] = -np.linalg.lstsq(scaled, gradient[at] / scale, rcond=1e-14)[0] / scale
    return step


def covariance(N: Array, on: np.ndarray) -> Array:
    """(p, p) inverse of N over the parameters that are ``on``, 0 elsewhere."""
    at = np.flatnonzero(on)
    out = np.zeros_like(N)
    if at.size:
        part = N[np.ix_(at, at)]
        scale = np.sqrt(np.maximum(np.diag(part), 1e-300))
        out[np.ix_(at, at)] = np.linalg.pinv(part / np.outer(scale, scale), rcond=1e-13) / np.outer(scale, scale)
    return out
