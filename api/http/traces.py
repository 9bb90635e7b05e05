"""Runs that were looked at lately, read and calibrated once: a zoom asks for the same record ten times a second."""

from collections import OrderedDict
from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from daq.run import RunData
from daq.store import Store

BYTES = 256_000_000


@dataclass(frozen=True)
class Trace:
    """A run, its sensor force in N, and the SHA-256 of the file both come from."""

    run: RunData
    force: NDArray[np.float64]
    sha256: str

    @property
    def size(self) -> int:
        """Bytes it holds."""
        return self.force.nbytes + sum(c.samples.nbytes for c in self.run.channels)


class Traces:
    """The last few traces, at most `limit` bytes of them, the newest always."""

    def __init__(self, store: Store, limit: int = BYTES) -> None:
        self._store, self._limit = store, limit
        self._lock = Lock()
        self._held: OrderedDict[tuple[object, ...], Trace] = OrderedDict()

    def get(self, run: str) -> Trace:
        """The trace of a run.

        Raises
        ------
        RunNotFound, StoreError : as `Store.read`.
        """
        stat = self._store.raw(run).stat()
        corrections = len(self._store.corrections(run))
        key = (
            run,
            corrections,
            stat.st_ino,
            stat.st_size,
            stat.st_mtime_ns,
        )  # a file that was put back from elsewhere is another
        with self._lock:
            if (held := self._held.get(key)) is not None:
                self._held.move_to_end(key)
                return held
        trace = self._read(run)
        with self._lock:
            self._held[key] = trace
            while len(self._held) > 1 and sum(t.size for t in self._held.values()) > self._limit:
                self._held.popitem(last=False)
        return trace

    def _read(self, run: str) -> Trace:
        digest = self._store.sha256(run)
        data = self._store.read(run)
        force = data.channel("force") or data.channels[0]
        values = force.calibrated()
        values.setflags(write=False)
        return Trace(data, values, digest)
