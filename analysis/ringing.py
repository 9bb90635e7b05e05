"""Ringing of the head: one decaying cosine and sine pair on top of a smooth contact force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.record import Array

_BAND = (2.5e3, 2.0e4)  # Hz, below it the contact force itself lives
_DECAYS = (0.15e-3, 0.3e-3, 0.6e-3, 1.2e-3, 2.5e-3)  # s
_DEGREE = 11
_AFTER = 1.5e-3  # s, of ringing looked at past the end of contact
_SHARE = 0.6  # of what the polynomial leaves above the noise must be the pair
_SURE = 30.0  # drop of χ² that noise alone does not give over the frequencies and decays tried


@dataclass(frozen=True)
class Ringing:
    """e^{−(t−t_r)/d}·(p₀·cos ω(t−t_r) + p₁·sin ω(t−t_r)) from first contact on.

    frequency : Hz; decay : s; origin : t_r, s; pair : (2,) N; u_pair : (2,) N, standard uncertainties
    """

    frequency: float
    decay: float
    origin: float
    pair: Array
    u_pair: Array

    def wave(self, t: Array, pair: Array | None = None) -> Array:
        """Force of the ringing at `t`, N, without its beginning."""
        c, s = self.pair if pair is None else pair
        since = t - self.origin
        # Far before the origin the envelope would grow without bound; nothing is asked of it there.
        envelope = np.exp(-np.maximum(since, -self.decay) / self.decay)
        return envelope * (
            c * np.cos(2 * np.pi * self.frequency * since) + s * np.sin(2 * np.pi * self.frequency * since)
        )


def find_ringing(t: Array, force: Array, start: float, end: float, noise: float) -> Ringing | None:
    """Ringing in `force` between `start` and `end`, or None where nothing stands out from the noise.

    The contact force is a polynomial between the ends, 50 µs and more inside them, and 0 after them; frequency and
    decay come from a search over both, refined where the residual falls most.
    """
    length = end - start
    gap = 0.05 * length
    inside = (t > start + max(gap, 5e-5)) & (t < end - gap)
    outside = (t > end + gap) & (t < end + max(length, _AFTER))
    step = float(t[1] - t[0])
    block = max(1, int(4e-6 / step), int(np.count_nonzero(inside | outside)) // 800)
    contact, free = _blocks(t, force, inside, block), _blocks(t, force, outside, block)
    if contact.shape[1] < 60:
        return None
    x, y = np.concatenate((contact, free), axis=1)
    n = x.size
    noise = max(noise / np.sqrt(block), 1e-6 * float(y.max()))
    basis = np.zeros((n, _DEGREE + 1))
    basis[: contact.shape[1]] = np.polynomial.chebyshev.chebvander(np.linspace(-1, 1, contact.shape[1]), _DEGREE)
    smooth, _ = np.linalg.qr(basis)
    y = y - smooth @ (smooth.T @ y)
    band = (max(_BAND[0], min(6.5 / length, 3.8e3)), min(_BAND[1], 0.2 / (block * step)))
    frequencies = np.arange(band[0], band[1], max(0.4 / length, 30.0))
    if frequencies.size == 0:
        return None
    best = max(_search(x, y, smooth, frequencies, decay, start) for decay in _DECAYS)
    if best[0] / noise**2 < _SURE:
        return None
    gain, frequency, decay = _refined(x, y, smooth, start, best)
    if not band[0] < frequency < band[1]:
        return None
    _, pair, covariance, rest = _pair(x, y, smooth, frequency, decay, start)
    scale = max(noise**2, rest / max(n - 16, 1))
    if gain / scale < _SURE or gain < _SHARE * (gain + rest - n * noise**2):
        return None
    # Frequency and decay are not known better than the pair itself: 1.5 covers what they add.
    return Ringing(frequency, decay, start, pair, 1.5 * np.sqrt(np.diag(covariance) * scale))


def _blocks(t: Array, force: Array, where: NDArray[np.bool_], block: int) -> Array:
    """Means of `block` samples, (2, n): time and force."""
    n = np.count_nonzero(where) // block
    return np.stack([a[where][: n * block].reshape(n, block).mean(axis=1) for a in (t, force)])


def _search(
    x: Array, y: Array, smooth: Array, frequencies: Array, decay: float, origin: float
) -> tuple[float, float, float]:
    """Largest drop of the sum of squares over `frequencies` (n,) Hz, and where: gain, frequency, decay."""
    wave: NDArray[np.complex128] = np.exp(np.multiply.outer(x - origin, -1 / decay + 2j * np.pi * frequencies))
    wave -= smooth @ (smooth.T @ wave)
    c, s = wave.real, wave.imag
    cc, ss, cs = (c * c).sum(axis=0), (s * s).sum(axis=0), (c * s).sum(axis=0)
    cy, sy = y @ c, y @ s
    gain = (ss * cy * cy - 2 * cs * cy * sy + cc * sy * sy) / np.maximum(cc * ss - cs * cs, 1e-300)
    top = int(np.argmax(gain))
    return float(gain[top]), float(frequencies[top]), decay


def _pair(
    x: Array, y: Array, smooth: Array, frequency: float, decay: float, origin: float
) -> tuple[float, Array, NDArray[np.floating], float]:
    """Drop of the sum of squares by the pair, the pair, its covariance for unit noise, and what is left."""
    wave: NDArray[np.complex128] = np.exp((-1 / decay + 2j * np.pi * frequency) * (x - origin))
    basis = np.column_stack((wave.real, wave.imag))
    basis -= smooth @ (smooth.T @ basis)
    inverse = np.linalg.pinv(basis.T @ basis)  # of a wave that has faded away nothing is left
    projected = basis.T @ y
    pair = inverse @ projected
    gain = float(projected @ pair)
    return gain, pair, inverse, float(y @ y) - gain


def _refined(
    x: Array, y: Array, smooth: Array, origin: float, best: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Frequency and decay of the largest gain, by a shrinking pattern search."""
    gain, frequency, decay = best
    df, dd = 0.2 / (x[-1] - x[0]), 0.5
    while df > 1e-3 / (x[-1] - x[0]):
        trials = [(frequency + a * df, decay * (1 + dd) ** b) for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        gains = [(_pair(x, y, smooth, f, d, origin)[0], f, d) for f, d in trials if 1e-4 < d < 5e-3]
        top = max(gains)
        if top[0] > gain:
            gain, frequency, decay = top
        else:
            df, dd = df / 2, dd / 2
    return gain, frequency, decay
