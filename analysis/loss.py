"""A sudden loss of part of the load: a crack that the specimen survives, or a slip of the specimen in its support.

Around every moment of the contact two laws are held against the record: a cubic with one ringing, and the same with a
loss of load that is over within some tens of microseconds, a slope that is another after it, and a ringing of its own.
The loss is there where the second is so much better that neither noise nor what a ringing lacks of its law explains it.
Nothing is filtered.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.record import Array

_STEP = 4e-6
"""s: samples closer than that are averaged."""
_BEFORE, _AFTER = (250e-6, 130e-6, 70e-6), (250e-6, 120e-6)
"""s of record around a moment; the shorter where the contact has begun or is over."""
_SCALE, _FEWEST = 250e-6, 40
_RINGS = np.arange(3e3, 14.1e3, 0.5e3)
"""Hz."""
_DECAY = 10e-6
"""s, in which a crack takes its share of the load to 1/e."""
_COVERED = 60e-6
"""s on either side of a moment that was searched."""
_CLEAR = 15e-6
"""s from either end of contact that are left alone."""
_SHARES = (0.03, 0.6)
"""Of the load: what is looked for. More is a complete failure, or none."""
_LOW = 0.12
"""Of F_M: loads below it are not looked at."""
_LACKS = 0.1
"""Of a ringing's amplitude: what it lacks of its law."""
_LOUD = 0.08
"""Of F_M, standard deviation: what ringings are expected to be. Without it a slow one stands for the load itself."""
_WIDER = 1.4
"""Times: how much less sure the load is than its fit says (`bench/failure.py`)."""
LOST = 32.0
"""Drop of χ² that marks a loss."""


@dataclass(frozen=True)
class Loss:
    """A sudden loss of load.

    t : s on the record's axis, when it begins; F : N, contact force before it; share : of F, that is lost; u_t, u_F,
    u_share of them; gain : drop of χ²
    """

    t: float
    u_t: float
    F: float
    u_F: float
    share: float
    u_share: float
    gain: float


@dataclass(frozen=True)
class _Piece:
    """A contact in steps of `_STEP`: t (n,) s, force (n,) N; noise, top N."""

    t: Array
    force: Array
    step: float
    noise: float
    top: float


def find_loss(t: Array, force: Array, start: float, end: float, noise: float) -> Loss | None:
    """The clearest loss of load between ``start`` and ``end`` (s on the axis of ``t``); None where nothing is like one.

    t, force : (n,) s and N. A plate that shakes all along has such places, so a loss has to be confirmed: `partial`.
    """
    piece = _piece(t, force, start, end, noise)
    if piece is None:
        return None
    tops = sorted(
        ((float(like.max()), int(at[np.argmax(like)])) for at, like in _scan(piece) if like.size), reverse=True
    )
    tried: list[int] = []
    found: list[Loss] = []
    for gain, centre in tops:
        # The search around a moment covers what is near it.
        if gain <= LOST or any(abs(centre - other) * piece.step < _COVERED for other in tried):
            continue
        loss = _located(piece, centre)
        if loss is not None and loss.gain > LOST:
            tried.append(centre)
            found.append(loss)
    return max(found, key=lambda loss: loss.gain, default=None)


def _piece(t: Array, force: Array, start: float, end: float, noise: float) -> _Piece | None:
    dt = float(t[1] - t[0])
    block = max(1, round(_STEP / dt))
    first, last = np.searchsorted(t, [start + _CLEAR, end - _CLEAR])
    n = max(0, int(last - first)) // block
    if n < _FEWEST:
        return None
    part = slice(int(first), int(first) + n * block)
    means = [a[part].reshape(n, block).mean(axis=1) for a in (t, force)]
    top = float(means[1].max())
    return (
        None if not top > 0 else _Piece(means[0], means[1], block * dt, max(noise / math.sqrt(block), 1e-5 * top), top)
    )


def _columns(piece: _Piece, s: Array, at: float, frequency: float) -> Array:
    """(n + 6, 12): cubic, slope after ``at``, loss, ringings; the last rows hold these to `_LOUD`. s : (n,) s."""
    x, w, since = s / _SCALE, 2 * np.pi * frequency * s, np.maximum(s - at, 0.0)
    c, d, on = np.cos(w), np.sin(w), s > at
    after = 2 * np.pi * frequency * since
    loss = -np.expm1(-since / _DECAY)
    smooth = (np.ones_like(x), x, x * x, x**3, since / _SCALE, loss)
    law = np.column_stack((*smooth, c, d, x * c, x * d, np.sin(after), on * (np.cos(after) - 1)))
    held = np.zeros((6, 12))
    held[:, 6:] = np.eye(6) * (piece.noise / (_LOUD * piece.top))
    return np.asarray(np.vstack((law, held)), dtype=np.float64)


_INTACT = [0, 1, 2, 3, 6, 7, 8, 9]
"""Of `_columns`: those of the law without a loss."""
_LOSS = 5


def _scan(piece: _Piece) -> Iterator[tuple[NDArray[np.int_], Array]]:
    """Moments (n,) as indices, and the drop of χ² (n,) where it is like a loss, else 0."""
    y = piece.force
    smooth = np.convolve(y, np.ones(9) / 9, mode="same")
    for before in (round(b / piece.step) for b in _BEFORE):
        for after in (round(a / piece.step) for a in _AFTER):
            n = before + after
            if n >= y.size or before < 6 or n < 30:
                continue
            windows = np.lib.stride_tricks.sliding_window_view(y, n)
            total = (windows * windows).sum(axis=1)
            s = np.asarray((np.arange(-before, after) + 0.5) * piece.step, dtype=np.float64)
            rows = [_both(piece, windows, total, s, f) for f in _RINGS]
            without, within, lost, ringing = (np.array(part) for part in zip(*rows, strict=True))
            best = within.argmin(axis=0), np.arange(windows.shape[0])
            at = np.arange(windows.shape[0]) + before
            s2 = np.maximum(within[best] / (n - 13), piece.noise**2) + (_LACKS * ringing[best]) ** 2
            gain = (without.min(axis=0) - within[best]) / s2
            share = lost[best] / np.maximum(smooth[at], 1e-9)
            like = (share > _SHARES[0]) & (share < _SHARES[1]) & (smooth[at] > _LOW * piece.top)
            yield at, np.where(like, gain, 0.0)


def _both(piece: _Piece, windows: Array, total: Array, s: Array, frequency: float) -> tuple[Array, Array, Array, Array]:
    """Of every window: sum of squares left without and with a loss, the loss (N), the ringing's amplitude (N)."""
    columns = _columns(piece, s, 0.0, frequency)
    q0, _ = np.linalg.qr(columns[:, _INTACT])
    q1, r1 = np.linalg.qr(columns)
    p0, p1 = windows @ q0[: s.size], windows @ q1[: s.size]
    a = p1 @ np.linalg.inv(r1).T
    return (
        total - (p0 * p0).sum(axis=1), total - (p1 * p1).sum(axis=1), -a[:, _LOSS], np.hypot(a[:, 6], a[:, 7])
    )  # fmt: skip


def _located(piece: _Piece, centre: int) -> Loss | None:
    """The loss within the window around ``centre``, wherever in it."""
    reach = round(_BEFORE[0] / piece.step)
    first, last = max(0, centre - reach), min(piece.force.size, centre + reach)
    origin = float(piece.t[centre])
    s, y = piece.t[first:last] - origin, np.concatenate((piece.force[first:last], np.zeros(6)))
    n, edge = s.size, 8
    rests = {float(f): _rest(piece, y, s, float(f)) for f in _RINGS}
    without = min(float(rest @ rest) for rest, _ in rests.values())

    def left(at: float, f: float) -> tuple[float, float, float]:
        return _left(piece, *rests[f], s, at, f), at, f

    coarse = s[edge:-edge:2] - piece.step / 2
    _, at, _ = min(left(float(each), f) for f in rests for each in coarse)
    _, at, f = min(left(at + each * piece.step, f) for f in rests for each in (-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5))
    fine = at + np.arange(-1.5, 1.51, 0.125) * piece.step
    chi2 = np.array([left(float(each), f)[0] for each in fine])
    k = int(np.argmin(chi2))
    columns = _columns(piece, s - fine[k], 0.0, f)
    a, *_ = np.linalg.lstsq(columns, y, rcond=None)
    s2 = max(float(chi2[k]) / max(n - 13, 1), piece.noise**2) + (_LACKS * math.hypot(a[6], a[7])) ** 2
    covariance = np.linalg.pinv(columns.T @ columns) * s2
    F, lost = float(a[0]), -float(a[_LOSS])
    if not (_LOW * piece.top < F and _SHARES[0] < lost / F < _SHARES[1]):
        return None
    near = fine[chi2 < chi2[k] + s2]
    u_F, u_lost = _WIDER * math.sqrt(covariance[0, 0]), math.sqrt(covariance[_LOSS, _LOSS])
    u_t = math.hypot(float(np.ptp(near)) / 2, 0.3 * piece.step)
    share = lost / F
    gain = (without - float(chi2[k])) / s2
    return Loss(origin + float(fine[k]), u_t, F, u_F, share, math.hypot(u_lost, share * u_F) / F, gain)


def _rest(piece: _Piece, y: Array, s: Array, frequency: float) -> tuple[Array, Array]:
    """What the law without a loss leaves of ``y``, and an orthonormal basis of it."""
    fixed, _ = np.linalg.qr(_columns(piece, s, 0.0, frequency)[:, _INTACT])
    return y - fixed @ (fixed.T @ y), fixed


def _left(piece: _Piece, rest: Array, fixed: Array, s: Array, at: float, frequency: float) -> float:
    """Sum of squares that is left with a loss at ``at``."""
    more = _columns(piece, s, at, frequency)[:, [4, _LOSS, 10, 11]]
    more -= fixed @ (fixed.T @ more)
    a, *_ = np.linalg.lstsq(more, rest, rcond=None)
    left = rest - more @ a
    return float(left @ left)
