"""What is worth compiling: the lumped models with their sensitivities, ringing, and the integrals of a record.

`contact` is every lumped model: contact force at many times, and how it changes with each parameter.

With c = 1/C_i, q = 1/K_d and θ = C_d·q, any of which may be 0, δ = α₁ + α₃ and G = K_i·max(α₁, 0)^(3/2):

    v' = g − F/m,   δ' = v − c·F,   θ·(α₁' − v + c·F) = δ − α₁ − q·F,   F = G + C·v

C is the parallel dashpot's, then c = q = θ = 0. Radau IIA of order 5 (Hairer and Wanner, Solving ODEs II, IV.5) takes
the plate's microseconds (θ small) and its missing damper (θ = 0) as they are; v and δ are linear in the stages of G, so
that Newton runs over the three stages of α₁ alone. Steps are graded to both ends of contact, where the 3/2 power has no
second derivative. The sensitivities are the derivatives of the very steps taken, exact but for rounding.

The file stands alone: numba caches a function by its own file and does not see an edit in another. With
NUMBA_DISABLE_JIT=1 it runs as plain Python, which is one of its tests.
"""

# pyright: basic
# numba infers the types of what it compiles, and has none of its own.

import math

import numpy as np
from numba import njit

_R = math.sqrt(6.0)
_C = np.array([(4 - _R) / 10, (4 + _R) / 10, 1.0])
_A = np.array(
    [
        [(88 - 7 * _R) / 360, (296 - 169 * _R) / 1800, (-2 + 3 * _R) / 225],
        [(296 + 169 * _R) / 1800, (88 + 7 * _R) / 360, (-2 - 3 * _R) / 225],
        [(16 - _R) / 36, (16 + _R) / 36, 1 / 9],
    ]
)
_W = np.linalg.inv(_A)
_A2 = _A @ _A
_AC = _A @ _C
_SUM = _W.sum(axis=1)
_INTERPOLATE = np.linalg.inv(np.vander(np.concatenate((np.zeros(1), _C)), 4, increasing=True))
"""Values at 0 and the three nodes → coefficients of the cubic through them."""

STEPS, FINEST, GRADE = 100.0, 40_000.0, 0.15
"""Steps a contact without grading, the finest step's share of it, and a step's share of the time to either end,"""
SLOWER = 10.0
"""that is smaller where the plate's damper, slow against the contact, shapes its beginning."""
LONGEST = 20.0
"""Times the expected contact, after which a dart that has not parted lies on the specimen."""
LN_E, FLOW, DAMPER, SPEED, TIME = 0, 1, 2, 3, 4
"""Columns of the sensitivities: by ln E, by c = 1/C_i, by C_d (or C), by v0, by time."""


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _inverse(M, out):
    """Inverse of a 3×3 matrix."""
    c0 = M[1, 1] * M[2, 2] - M[1, 2] * M[2, 1]
    c1 = M[1, 2] * M[2, 0] - M[1, 0] * M[2, 2]
    c2 = M[1, 0] * M[2, 1] - M[1, 1] * M[2, 0]
    d = 1.0 / (M[0, 0] * c0 + M[0, 1] * c1 + M[0, 2] * c2)
    out[0, 0], out[1, 0], out[2, 0] = c0 * d, c1 * d, c2 * d
    out[0, 1] = (M[0, 2] * M[2, 1] - M[0, 1] * M[2, 2]) * d
    out[1, 1] = (M[0, 0] * M[2, 2] - M[0, 2] * M[2, 0]) * d
    out[2, 1] = (M[0, 1] * M[2, 0] - M[0, 0] * M[2, 1]) * d
    out[0, 2] = (M[0, 1] * M[1, 2] - M[0, 2] * M[1, 1]) * d
    out[1, 2] = (M[0, 2] * M[1, 0] - M[0, 0] * M[1, 2]) * d
    out[2, 2] = (M[0, 0] * M[1, 1] - M[0, 1] * M[1, 0]) * d


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _spring(alpha, K, base):
    """G and dG/dα₁: K·α^1.5, times 1 + Σ base_n·α^(n/2) over a layer."""
    if alpha <= 0:
        return 0.0, 0.0
    u = math.sqrt(alpha)
    if base[0] == 0.0:
        return K * u * u * u, 1.5 * K * u
    b1, b2, b3, b4 = base
    more = 1 + u * (b1 + u * (b2 + u * (b3 + u * b4)))
    by_u = b1 + u * (2 * b2 + u * (3 * b3 + u * 4 * b4))
    return K * u * u * u * more, K * u * (1.5 * more + 0.5 * u * by_u)


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _matrices(h, m, c, q, theta, C, B, P, X):
    """B: what the stages of G weigh in the equations of α₁; P: V = P·(v + h·g·c_i − h/m·A·G)."""
    for i in range(3):
        for j in range(3):
            P[i, j] = (1.0 if i == j else 0.0) + (h * C / m * _A[i, j] if C > 0 else 0.0)
    if C > 0:
        for i in range(3):
            for j in range(3):
                X[i, j] = P[i, j]
        _inverse(X, P)
        for i in range(3):
            for j in range(3):
                s = 0.0
                for k in range(3):
                    for n in range(3):
                        s += _A[i, k] * P[k, n] * _A[n, j]
                B[i, j] = h * h / m * s
        return
    for i in range(3):
        for j in range(3):
            B[i, j] = h * h / m * _A2[i, j] + (theta * h / m + h * c) * _A[i, j]
        B[i, i] += q + theta * c


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _stages(h, v, delta, alpha, m, g, K, base, theta, B, P, A, G, G1, R, M, lag, over, inverse):
    """Newton over the stages A (3,) of α₁, from what is in A; leaves G, dG/dα, the inverse Jacobian. True if done."""
    for j in range(3):
        over[j] = v + h * g * _C[j]
    for i in range(3):
        known = delta + theta * over[i]
        for j in range(3):
            known += h * _A[i, j] * (P[j, 0] * over[0] + P[j, 1] * over[1] + P[j, 2] * over[2])
            M[i, j] = theta / h * _W[i, j]
            known += M[i, j] * alpha
        R[i] = known
        for j in range(3):
            lag[i, j] = M[i, j]
        lag[i, i] += 1.0
    for _ in range(25):
        for i in range(3):
            G[i], G1[i] = _spring(A[i], K, base)
        for i in range(3):
            for j in range(3):
                M[i, j] = lag[i, j] + B[i, j] * G1[j]
        _inverse(M, inverse)
        for i in range(3):
            over[i] = -R[i]
            for j in range(3):
                over[i] += lag[i, j] * A[j] + B[i, j] * G[j]
        change = scale = 0.0
        for i in range(3):
            s = inverse[i, 0] * over[0] + inverse[i, 1] * over[1] + inverse[i, 2] * over[2]
            A[i] -= s
            change, scale = max(change, abs(s)), max(scale, abs(A[i]))
        if not change < 1e300:
            return False
        if change <= 1e-6 * scale + 1e-18:
            for i in range(3):
                G[i], G1[i] = _spring(A[i], K, base)
            return True
    return False


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _sensitivities(h, m, c, q, theta, share, alpha, A, G, G1, V, B, inverse, S, SA, SV, w):
    """One step of the sensitivities S (4, 3) of v, δ, α₁ without C; their stages into SA, SV (4, 3)."""
    for p in range(4):
        v, delta, lag = S[p, 0], S[p, 1], theta / h * S[p, 2]
        theta_p = -theta if p == LN_E else (q if p == DAMPER else 0.0)
        gained = share if p == LN_E else 0.0  # of G at fixed α₁
        for i in range(3):
            s = (
                delta
                + (theta + h * _C[i]) * v
                + lag * _SUM[i]
                - gained * (B[i, 0] * G[0] + B[i, 1] * G[1] + B[i, 2] * G[2])
            )
            if theta_p != 0.0:
                behind = _W[i, 0] * (A[0] - alpha) + _W[i, 1] * (A[1] - alpha) + _W[i, 2] * (A[2] - alpha)
                s += theta_p * (V[i] - c * G[i] - behind / h)
            if p == LN_E:
                s += q * G[i]
            elif p == FLOW:
                s -= theta * G[i] + h * (_A[i, 0] * G[0] + _A[i, 1] * G[1] + _A[i, 2] * G[2])
            w[i] = s
        for i in range(3):
            SA[p, i] = inverse[i, 0] * w[0] + inverse[i, 1] * w[1] + inverse[i, 2] * w[2]
        for i in range(3):
            w[i] = G1[i] * SA[p, i] + gained * G[i]
        total = 0.0
        for i in range(3):
            SV[p, i] = v - h / m * (_A[i, 0] * w[0] + _A[i, 1] * w[1] + _A[i, 2] * w[2])
            total += _A[2, i] * (SV[p, i] - c * w[i] - (G[i] if p == FLOW else 0.0))
        S[p, 0], S[p, 1], S[p, 2] = SV[p, 2], delta + h * total, SA[p, 2]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _sensitivities_beside(h, m, C, share, A, G, G1, V, P, inverse, S, SA, SV, w, x):
    """The same with the parallel dashpot, where c = q = θ = 0: F = G + C·v."""
    for p in range(4):
        v, delta = S[p, 0], S[p, 1]
        for i in range(3):
            w[i] = (share * G[i] if p == LN_E else 0.0) + (V[i] if p == DAMPER else 0.0)  # what F gains at fixed α₁, v
        for i in range(3):
            x[i] = v - h / m * (_A[i, 0] * w[0] + _A[i, 1] * w[1] + _A[i, 2] * w[2])
        for i in range(3):
            SV[p, i] = P[i, 0] * x[0] + P[i, 1] * x[1] + P[i, 2] * x[2]  # without what α₁ gains
        for i in range(3):
            x[i] = delta + h * (_A[i, 0] * SV[p, 0] + _A[i, 1] * SV[p, 1] + _A[i, 2] * SV[p, 2])
        for i in range(3):
            SA[p, i] = inverse[i, 0] * x[0] + inverse[i, 1] * x[1] + inverse[i, 2] * x[2]
        for i in range(3):
            w[i] += G1[i] * SA[p, i]
        for i in range(3):
            x[i] = v - h / m * (_A[i, 0] * w[0] + _A[i, 1] * w[1] + _A[i, 2] * w[2])
        total = 0.0
        for i in range(3):
            SV[p, i] = P[i, 0] * x[0] + P[i, 1] * x[1] + P[i, 2] * x[2]
            total += _A[2, i] * SV[p, i]
        S[p, 0], S[p, 1], S[p, 2] = SV[p, 2], delta + h * total, SA[p, 2]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _cubic(at_0, stages, out):
    for k in range(4):
        out[k] = _INTERPOLATE[k, 0] * at_0
        for j in range(3):
            out[k] += _INTERPOLATE[k, j + 1] * stages[j]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def contact(constants, times, force, slopes):
    """Contact force at ``times`` (n,), s from touch, rising, into ``force`` (n,), 0 outside the contact.

    constants : (14,) m kg, g m/s², drag m/s² (friction over mass), K_i N/m^1.5, c s/kg, q m/N, θ s, C kg/s, v0 m/s, the
    share of ln E in ln K_i (1 on a rigid tip), and what the base under a layer adds, of √α₁ to its fourth power (0 on a
    half-space). slopes : (5, n) takes the sensitivities in the order of `LN_E` …
    `TIME`; (0, n): none are wanted. Returns the end of contact in s; inf where the dart stays, nan where the constants
    make a contact that cannot be integrated.
    """
    m, gravity, drag, K, c, q, theta, C, v0, share = constants[:10]
    base = (constants[10], constants[11], constants[12], constants[13])
    wanted = slopes.shape[0] > 0
    force[:] = 0.0
    slopes[:] = 0.0
    B, P, X, M, lag, inverse = np.empty((6, 3, 3))
    A, G, G1, R, V, F, over = np.empty((7, 3))
    S, SA, SV, w = np.zeros((4, 3)), np.empty((4, 3)), np.empty((4, 3)), np.empty(3)
    S[SPEED, 0] = 1.0
    cubic, speed, by, by_v = np.empty(4), np.empty(4), np.empty((4, 4)), np.empty((4, 4))
    before = np.zeros((4, 3))
    span = 2.94 * (1.25 * m * v0 * v0 / K) ** 0.4 / v0 + math.pi * math.sqrt(m * q)
    longest, finest, grade = span / STEPS, span / FINEST, GRADE / (1 + SLOWER * theta / span)
    t, v, delta, alpha, old = 0.0, v0, 0.0, 0.0, 0.0
    slope, at, n = v0, 0, times.shape[0]
    while at < n and times[at] < 0:
        at += 1
    while t < LONGEST * span:
        h = min(longest, max(finest, grade * t))
        if slope < 0:
            h = min(h, max(finest, grade * alpha / -slope))
        g = gravity - math.copysign(drag, v)
        low, high, g_low, g_high, parted = 0.0, h, 0.0, 0.0, False
        for attempt in range(60):
            for i in range(3):
                if old > 0:  # the last step's cubic, carried on
                    x = 1.0 + _C[i] * h / old
                    A[i] = cubic[0] + x * (cubic[1] + x * (cubic[2] + x * cubic[3]))
                else:
                    A[i] = alpha + _C[i] * h * v
            _matrices(h, m, c, q, theta, C, B, P, X)
            if not _stages(h, v, delta, alpha, m, g, K, base, theta, B, P, A, G, G1, R, M, lag, over, inverse):
                return math.nan
            for j in range(3):
                over[j] = v + h * g * _C[j] - h / m * (_A[j, 0] * G[0] + _A[j, 1] * G[1] + _A[j, 2] * G[2])
            for i in range(3):
                V[i] = P[i, 0] * over[0] + P[i, 1] * over[1] + P[i, 2] * over[2] if C > 0 else over[i]
                F[i] = G[i] + C * V[i]
            gauge = F[2] if C > 0 else A[2]
            if attempt == 0:
                if gauge > 0:
                    break
                parted, g_high = True, gauge
                g_low = C * v + _spring(alpha, K, base)[0] if C > 0 else alpha
            elif gauge > 0:
                low, g_low, g_high = h, gauge, 0.5 * g_high
            else:
                high, g_high, g_low = h, gauge, 0.5 * g_low if attempt > 1 else g_low
            if high - low <= 1e-9 * span or (attempt > 0 and abs(gauge) < 1e-300):
                break
            h = low + (high - low) * min(max(g_low / (g_low - g_high), 0.02), 0.98)
        _cubic(alpha, A, cubic)
        if C > 0:
            _cubic(v, V, speed)
        if wanted:
            before[:] = S
            if C > 0:
                _sensitivities_beside(h, m, C, share, A, G, G1, V, P, inverse, S, SA, SV, w, over)
            else:
                _sensitivities(h, m, c, q, theta, share, alpha, A, G, G1, V, B, inverse, S, SA, SV, w)
            for p in range(4):
                _cubic(before[p, 2], SA[p], by[p])
                if C > 0:
                    _cubic(before[p, 0], SV[p], by_v[p])
        while at < n and times[at] < t + h:
            x = (times[at] - t) / h
            a = cubic[0] + x * (cubic[1] + x * (cubic[2] + x * cubic[3]))
            if a > 0 or C > 0:
                if base[0] == 0.0:
                    root = math.sqrt(a) if a > 0 else 0.0
                    spring, F1 = K * root * root * root, 1.5 * K * root
                else:
                    spring, F1 = _spring(a, K, base)
                force[at] = spring
                if C > 0:
                    force[at] += C * (speed[0] + x * (speed[1] + x * (speed[2] + x * speed[3])))
                if wanted:
                    for p in range(4):
                        s = by[p]
                        slopes[p, at] = F1 * (s[0] + x * (s[1] + x * (s[2] + x * s[3])))
                        if C > 0:
                            s = by_v[p]
                            slopes[p, at] += C * (s[0] + x * (s[1] + x * (s[2] + x * s[3])))
                    slopes[LN_E, at] += share * spring
                    slopes[TIME, at] = F1 * (cubic[1] + x * (2 * cubic[2] + x * 3 * cubic[3])) / h
                    if C > 0:
                        slopes[DAMPER, at] += speed[0] + x * (speed[1] + x * (speed[2] + x * speed[3]))
                        slopes[TIME, at] += C * (speed[1] + x * (2 * speed[2] + x * 3 * speed[3])) / h
            at += 1
        pulled = 0.0
        for j in range(3):
            pulled += _A[2, j] * (V[j] - c * F[j])
        delta += h * pulled
        slope = (cubic[1] + 2 * cubic[2] + 3 * cubic[3]) / h
        t, v, alpha, old = t + h, V[2], A[2], h
        if parted:
            return t
    return math.inf


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def ringing(times, step, t0, cosine, sine, frequency, decay, force, rows, by_t0):
    """Add a decaying mode that begins at rest at ``t0`` to ``force`` (n,), at ``times`` (n,) s, ``step`` s apart.

    w(s) = e^{−s/d}·[c·cos ωs·(1 − e^{−ωs}) + p·sin ωs]. rows : (4, n) takes the derivatives by c, p, the frequency (Hz)
    and ln d; by_t0 : (n,) is added that by t0. By recursion from the first point after t0, exact but for rounding.
    """
    omega = 2 * math.pi * frequency
    rows[:] = 0.0
    first = 0
    while first < times.shape[0] and times[first] <= t0:
        first += 1
    if first == times.shape[0]:
        return
    s = times[first] - t0
    envelope, shrink = math.exp(-s / decay), math.exp(-step / decay)
    fading, fade = math.exp(-omega * s), math.exp(-omega * step)
    co, si, turn_c, turn_s = math.cos(omega * s), math.sin(omega * s), math.cos(omega * step), math.sin(omega * step)
    for i in range(first, times.shape[0]):
        in_c, in_s = envelope * co * (1 - fading), envelope * si
        wave = cosine * in_c + sine * in_s
        turned = sine * envelope * co + cosine * envelope * (co * fading - si * (1 - fading))
        force[i] += wave
        rows[0, i], rows[1, i] = in_c, in_s
        rows[2, i] = 2 * math.pi * s * turned
        rows[3, i] = wave * s / decay
        by_t0[i] += wave / decay - omega * turned
        co, si = co * turn_c - si * turn_s, si * turn_c + co * turn_s
        envelope, fading, s = envelope * shrink, fading * fade, s + step


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def path(t, force, mass, v0, g, J, v, alpha, energy):
    """∫F dt, v, α and ∫F·v dt by the trapezoid rule into four arrays (n,), from those at t[0]: 0, v0, 0, 0.

    v = v0 + g·(t − t[0]) − J/m; t s, rising, and force N (n,).
    """
    j, a, e, before, v_before = 0.0, 0.0, 0.0, force[0], v0
    J[0], v[0], alpha[0], energy[0] = 0.0, v0, 0.0, 0.0
    over = 1.0 / mass
    for i in range(1, t.shape[0]):
        half = 0.5 * (t[i] - t[i - 1])
        now = force[i]
        j += half * (before + now)
        v_now = v0 + g * (t[i] - t[0]) - over * j
        a += half * (v_before + v_now)
        e += half * (before * v_before + now * v_now)
        J[i], v[i], alpha[i], energy[i] = j, v_now, a, e
        before, v_before = now, v_now
