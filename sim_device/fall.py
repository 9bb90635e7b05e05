"""A whole drop: fall, contacts and the flights between them, with its truth."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sim_device.law import Floats, Law
from sim_device.mechanics import Contact, solve
from sim_device.settings import Rig, SettingError, g

LOWEST_BOUNCE = 10e-6
"""m; a dart that bounces lower lies still."""
MOST_CONTACTS = 50
LONGEST_MOTION = 5.0
"""s after first contact, when a hand takes the dart off the specimen at the latest."""


@dataclass(frozen=True)
class Flight:
    """Free motion from ``start`` (s from first contact), at displacement x (m) with speed v (m/s, positive down)."""

    start: float
    x: float
    v: float
    up: float
    down: float

    @property
    def apex(self) -> float:
        """s from ``start``: the top of the flight, 0 if it only falls."""
        return max(0.0, -self.v / self.up)

    def position(self, t: float) -> float:
        """Displacement in m, ``t`` s after ``start``; friction works against the motion both ways."""
        rise = min(t, self.apex)
        after = t - rise
        x = self.x + self.v * rise + 0.5 * self.up * rise**2
        v = 0.0 if self.v < 0 else self.v
        return x + v * after + 0.5 * self.down * after**2

    def path(self, t: Floats) -> Floats:
        """``position`` at many times (n,)."""
        rise = np.minimum(t, self.apex)
        after = t - rise
        x = self.x + self.v * rise + 0.5 * self.up * rise**2
        return x + max(self.v, 0.0) * after + 0.5 * self.down * after**2

    def speed(self, t: float) -> float:
        """Speed in m/s, ``t`` s after ``start``."""
        if t < self.apex:
            return self.v + self.up * t
        return max(self.v, 0.0) + self.down * (t - self.apex)

    def passes(self, x: float) -> list[float]:
        """Times in s after ``start`` at which the dart is at displacement ``x``, rising first."""
        top = self.position(self.apex)
        times: list[float] = []
        if self.v < 0 and top <= x <= self.x:
            times.append(self.apex - math.sqrt(2 * (x - top) / self.up))
        if x >= top:
            v = max(self.v, 0.0)
            times.append(self.apex + (math.sqrt(v * v + 2 * self.down * (x - top)) - v) / self.down)
        return times


class Motion:
    """One drop from release to rest; contacts are solved as far as somebody asks.

    Threads may ask at once. Times are in s from first contact (the release is at ``-t_fall``), displacements in m from
    the undeformed specimen.
    """

    def __init__(self, rig: Rig) -> None:
        """Let a dart go from where the rig holds it.

        Raises
        ------
        SettingError
            The dart cannot reach the specimen with the speed asked for.
        """
        self.law = Law.of(rig.specimen, rig.dart)
        drag = self.law.friction / self.law.m
        self._up, self._down = g + drag, g - drag
        if self._down <= 0:
            raise SettingError("friction_N holds the dart")
        self.v0 = (
            rig.drop.v0 if rig.drop.v0 is not None else math.sqrt(2 * self._down * (rig.drop.height_mm or 0) * 1e-3)
        )
        self.t_fall = self.v0 / self._down
        self.catcher = rig.drop.catcher
        height = self.v0**2 / (2 * self._down)
        self.flights = [Flight(-self.t_fall, -height, 0.0, self._up, self._down)]
        self.contacts: list[tuple[float, Contact]] = []
        self.rest_from = math.inf
        self.over_at = math.inf
        self._solving = threading.Lock()
        self._solve(0.0, self.v0, 0.0, 0.0, 0.0)
        self.second = None if math.isfinite(self.over_at) or math.isfinite(self.rest_from) else self._next_touch()

    def _solve(self, t: float, v: float, x: float, alpha2: float, alpha3: float) -> None:
        law = self.contacts[-1][1].law_after if self.contacts else self.law
        contact = solve(law, v, x, alpha2, alpha3)
        self.contacts.append((t, contact))
        parted = t + contact.end
        if contact.t_failure is not None:
            self.over_at = parted + 0.05
            return
        flight = Flight(parted, contact.x_end, contact.v_end, self._up, self._down)
        bounce = contact.x_end - flight.position(flight.apex)
        if contact.rests or bounce < LOWEST_BOUNCE or len(self.contacts) >= MOST_CONTACTS:
            self.rest_from, self.over_at = parted, parted + 0.05
            return
        self.flights.append(flight)
        if self.catcher:
            self.over_at = parted + flight.apex

    def _next_touch(self) -> tuple[float, float, float, float, float]:
        """When and how the last flight ends: t, v, x, α₂, α₃ where the dart meets α₂ + α₃ on its way down."""
        flight, contact = self.flights[-1], self.contacts[-1][1]
        relaxing = contact.law.C_d / contact.law.K_d if contact.law.bends else 0.0

        def plate(t: float) -> float:
            return contact.alpha3_end * math.exp(-t / relaxing) if relaxing > 0 else 0.0

        def gap(t: float) -> float:
            return flight.position(t) - contact.alpha2_end - plate(t)

        low, high = flight.apex, 2 * flight.apex
        while gap(high) <= 0:
            high *= 1.5
        for _ in range(200):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if gap(middle) <= 0 else (low, middle)
            if high - low <= 1e-16 + 1e-15 * high:
                break
        return flight.start + high, flight.speed(high), flight.position(high), contact.alpha2_end, plate(high)

    def extend(self, until: float) -> None:
        """Solve every contact that begins before ``until`` (s from first contact)."""
        with self._solving:
            self._extend(until)

    def _extend(self, until: float) -> None:
        while self.second is not None and self.second[0] < min(until, LONGEST_MOTION):
            self._solve(*self.second)
            done = math.isfinite(self.over_at) or math.isfinite(self.rest_from)
            self.second = None if done else self._next_touch()

    @property
    def over(self) -> float:
        """When the dart no longer moves, s from first contact: estimated from the last rebound until it is known."""
        if math.isfinite(self.over_at):
            return min(self.over_at, LONGEST_MOTION)
        started, contact = self.contacts[-1]
        epsilon = min(-contact.v_end / contact.v0, 0.95)
        return min(started + contact.end + 2 * -contact.v_end / (g * (1 - epsilon)), LONGEST_MOTION)

    def force(self, t: Floats) -> Floats:
        """Contact force in N at the times ``t`` (n,), rising, s from first contact."""
        if not len(t):
            return np.zeros(0)
        self.extend(float(t[-1]))
        F = np.zeros_like(t)
        for start, contact in self.contacts:
            first, last = np.searchsorted(t, [start, start + contact.end])
            F[first:last] = contact.force(t[first:last] - start)
        F[(t >= self.rest_from) & (t < self.over)] = self.law.m * g
        return F

    def position(self, t: Floats) -> Floats:
        """The dart's displacement in m at the times ``t`` (n,), rising, s from first contact."""
        if not len(t):
            return np.zeros(0)
        self.extend(float(t[-1]))
        x = np.full_like(t, self.flights[0].x)
        for k, flight in enumerate(self.flights):
            first = np.searchsorted(t, flight.start)
            x[first:] = flight.path(np.minimum(t[first:], self.over) - flight.start)
            if k < len(self.contacts):
                start, contact = self.contacts[k]
                first = np.searchsorted(t, start)
                x[first:] = contact.position(t[first:] - start)
        return x

    def ringings(self, until: float) -> Iterator[tuple[float, float]]:
        """Moments (s) that set the sensor ringing before ``until``, each with the force in N it is measured by.

        First contact by the force it comes to, a crack and a failure by the force that is lost.
        """
        self.extend(until)
        for start, contact in self.contacts:
            yield start, contact.F_M
            if contact.t_crack is not None:
                yield start + contact.t_crack, contact.law.crack_loss * contact.law.crack_N
            if contact.t_failure is not None:
                yield start + contact.t_failure, contact.F_M

    def truth(self) -> dict[str, float | bool | str | None]:
        """What really happened, SI, times from first contact; what has no meaning after a failure is null."""
        law, contact = self.law, self.contacts[0][1]
        failed = contact.t_failure is not None
        intact = not failed and not contact.rests
        turned = contact.t_turn if contact.t_turn is not None else contact.end
        path = (contact.x_max - contact.x0) + (contact.x_max - contact.x_end)
        J = law.m * (self.v0 - contact.v_end + g * contact.end) - law.friction * (2 * turned - contact.end)
        kinetic = 0.5 * law.m * (self.v0**2 - contact.v_end**2)
        E = kinetic + law.m * g * (contact.x_end - contact.x0) - law.friction * path
        return {
            "v0": self.v0,
            "F_M": contact.F_M,
            "t_M": contact.t_M,
            "alpha_M": None if failed else contact.x_max,
            "t_c": contact.end if intact else None,
            "J": J,
            "eps_published": J / (law.m * self.v0) - 1 if intact else None,
            "eps_exact": -contact.v_end / self.v0 if intact else None,
            "v1": -contact.v_end if intact else None,
            "alpha_r": contact.x_end if intact else None,
            "alpha_perm": contact.alpha2_end - (0.0 if contact.t_slip is None else law.slip),
            "E_diss": E,
            "failed": failed or contact.t_crack is not None,
            "failure_kind": "complete" if failed else None if contact.t_crack is None else "partial",
            "t_failure": contact.t_failure,
            "F_failure": contact.F_M if failed else None,
            "v_failure": contact.v_failure,
            "alpha_failure": contact.x_failure,
            "t_crack": contact.t_crack,
            "F_crack": None if contact.t_crack is None else law.crack_N,
            "alpha_crack": contact.x_crack,
            "t_slip": contact.t_slip,
            "t_second": None if self.catcher else self._second_touch(),
            "t_fall": self.t_fall,
        }

    def _second_touch(self) -> float | None:
        if len(self.contacts) > 1:
            return self.contacts[1][0]
        return None if self.second is None else self.second[0]
