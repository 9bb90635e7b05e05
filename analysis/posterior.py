"""Small bounded fits: the best point, and the mean over the part of the posterior that the bounds allow."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from analysis.record import Array

Flags = NDArray[np.bool_]
Residual = Callable[[Array], tuple[Array, Array]]
_POINTS = qmc.Sobol(8, scramble=True, rng=1).random_base2(9)


def damped_least_squares(residual: Residual, first: Array, low: Array, free: Flags) -> Array:
    """Levenberg–Marquardt with lower bounds: the best parameters (p,).

    residual : parameters (p,) → residuals (n,) and Jacobian (n, p); free : (p,) bool, others stay as they are
    """
    q = first.copy()
    rest, jacobian = residual(q)
    cost = float(rest @ rest)
    damping = 1e-3
    for _ in range(60):
        gradient = jacobian.T @ rest
        moving = free & ~((q <= low) & (gradient > 0))
        normal = (jacobian.T @ jacobian)[np.ix_(moving, moving)]
        step = np.zeros_like(q)
        try:
            step[moving] = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), gradient[moving])
        except np.linalg.LinAlgError:
            break
        trial = np.maximum(q + step, low)
        new_rest, new_jacobian = residual(trial)
        new_cost = float(new_rest @ new_rest)
        if new_cost < cost:
            done = cost - new_cost < 1e-6 * (1e-6 + cost) and float(np.max(np.abs(trial - q))) < 1e-7
            q, rest, jacobian, cost = trial, new_rest, new_jacobian, new_cost
            damping = max(damping / 5, 1e-12)
            if done:
                break
        else:
            damping *= 4
            if damping > 1e8:
                break
    return q


@dataclass(frozen=True)
class Part:
    """Parameter 0 in one linearised part of a posterior: mean, variance, −2·log of its weight, and its misfit χ²."""

    mean: float
    variance: float
    minus_2_log: float
    misfit: float


def bounded_part(
    q: Array, rest: Array, jacobian: Array, low: Array, free: Flags, misfit: float, penalty: float
) -> Part:
    """Parameter 0 over the linearised posterior at `q`, above the bounds only (GHK simulator).

    penalty : −2·log of the prior's weight
    """
    order = np.concatenate((np.flatnonzero(free & np.isfinite(low)), np.flatnonzero(free & ~np.isfinite(low))))
    part = jacobian[:, order]
    normal = part.T @ part
    normal += np.diag(1e-10 * np.diag(normal) + 1e-300)
    gradient = part.T @ rest
    try:
        covariance = np.linalg.inv(normal)
        shift = np.linalg.solve(normal, gradient)
        root = np.linalg.cholesky((covariance + covariance.T) / 2)
    except np.linalg.LinAlgError:
        return Part(float("nan"), float("nan"), float("inf"), misfit)
    centre = q[order] - shift
    bounded = int(np.count_nonzero(free & np.isfinite(low)))
    z = np.zeros((_POINTS.shape[0], bounded))
    weight = np.ones(_POINTS.shape[0])
    for k in range(bounded):
        floor = (low[order[k]] - centre[k] - z[:, :k] @ root[k, :k]) / root[k, k]
        above = ndtr(-floor)
        weight *= above
        z[:, k] = -ndtri(np.clip(_POINTS[:, k] * above, 1e-300, 1 - 1e-16))
    total = float(weight.sum())
    if not total > 1e-200:
        return Part(float(q[0]), float(covariance[bounded, bounded]), float(rest @ rest) + penalty, misfit)
    row = root[bounded]
    means = centre[bounded] + z @ row[:bounded]
    mean = float(weight @ means) / total
    variance = float(weight @ (means - mean) ** 2) / total + float(row[bounded] ** 2)
    evidence = float(rest @ rest - gradient @ shift) - 2 * float(np.sum(np.log(np.diag(root))))
    return Part(mean, variance, evidence - 2 * float(np.log(total / weight.size)) + penalty, misfit)


def mixture(parts: list[Part], more: Array, degrees: int) -> tuple[float, float, float]:
    """Mean, standard deviation and reduced χ² of the mixture of `parts`; a misfit above 1 widens it.

    more : standard deviation that each part has besides
    """
    sound = np.array([np.isfinite(p.minus_2_log) for p in parts])
    good = [p for p, is_sound in zip(parts, sound, strict=True) if is_sound]
    if not good:
        return float("nan"), float("nan"), float("nan")
    misfit = min(p.misfit for p in good) / degrees
    scale = max(misfit, 1.0)
    logs = np.array([p.minus_2_log for p in good]) / (-2 * scale)
    weight = np.exp(logs - logs.max())
    weight /= weight.sum()
    means = np.array([p.mean for p in good])
    mean = float(weight @ means)
    variances = scale * np.array([p.variance for p in good]) + more[sound] ** 2
    variance = float(weight @ (variances + (means - mean) ** 2))
    return mean, float(np.sqrt(variance)), misfit
