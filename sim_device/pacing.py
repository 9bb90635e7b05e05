"""Time on a serial line: ten bits a byte, start and stop bit included."""

from __future__ import annotations

import math


class Pace:
    """How many bytes one direction of a line has had time for since it began to be busy; times in s."""

    def __init__(self, baud: int | None) -> None:
        """``baud`` None: no limit."""
        self._byte = 10 / baud if baud else 0.0
        self._begun = 0.0
        self._passed = 0

    @property
    def silence(self) -> float:
        """RTU's gap between frames: 3.5 characters, 1.75 ms above 19,200 baud, 0 on a line without pace."""
        return 0.0 if not self._byte else 1.75e-3 if self._byte < 10 / 19200 else 3.5 * self._byte

    @property
    def free_at(self) -> float:
        """When the last byte has passed."""
        return self._begun + self._passed * self._byte

    def begin(self, at: float) -> None:
        """The line starts to be busy at ``at``, or when it is free."""
        if at > self.free_at:
            self._begun, self._passed = at, 0

    def pause(self, at: float) -> None:
        """Nothing passes before ``at``."""
        self._begun, self._passed = max(at, self.free_at), 0

    def restart(self, at: float) -> None:
        """Whatever was under way is gone."""
        self._begun, self._passed = at, 0

    def room(self, now: float, wanted: int) -> int:
        """Bytes of ``wanted`` that have passed by now."""
        if not self._byte:
            return wanted if now >= self._begun else 0
        return min(wanted, math.floor((now - self._begun) / self._byte + 1e-6) - self._passed)

    def take(self, count: int) -> None:
        """Account for bytes that have gone."""
        self._passed += count

    def due(self, count: int) -> float:
        """When ``count`` more bytes have passed."""
        return self._begun + (self._passed + count) * self._byte
