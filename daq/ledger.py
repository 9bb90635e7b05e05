"""The memory that a recorder lacks: which of its records is not safe yet, kept by the host.

An oscilloscope numbers no records, knows no "saved" and lets any command overwrite what it holds. Here the host counts
what it arms, and takes a complete record for held until it has been stored, told from others by a fingerprint of its
header and its first samples. So a record that was captured is not armed over, whoever captured it.
"""

import json
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

from daq.errors import StoreError
from daq.journal import put_down
from daq.recorder import Chunk, Condition, Device, Found, GateReading, Header, Interlock, Settings, Status

FINGERPRINT = 1000
"""Samples of channel 1 that are read to know a record again."""


@dataclass
class _Entry:
    """Records armed so far, whether the last is unsaved, its settings, and the fingerprint of the last one saved."""

    count: int = 0
    unsaved: bool = False
    config_hash: int = 0
    saved: int | None = None


class Ledger:
    """A recorder that cannot count, keep or release its records, as one that can; see `daq.recorder.Device`.

    path : where the ledger is kept; None: nowhere, and whatever the recorder shows counts as nobody's
    """

    def __init__(self, bare: Device, path: Path | None) -> None:
        self._bare, self._path = bare, path
        self._entry = self._load()
        self._stranger: bool | None = None

    def _load(self) -> _Entry:
        if self._path is None:
            return _Entry()
        try:
            return _Entry(**json.loads(self._path.read_text()))
        except FileNotFoundError:
            return _Entry()
        except (OSError, ValueError, TypeError) as e:
            raise StoreError(
                f"the ledger {self._path} cannot be read: {e}; move it away: then a record that is there is asked about"
            ) from None

    def _save(self) -> None:
        if self._path is not None:
            put_down(self._path, vars(self._entry))

    def status(self) -> Status:
        """State, with the id of the record that is not safe."""
        bare = self._bare.status()
        entry = self._entry
        condition, held = bare.condition, 0
        if condition == Condition.HELD:
            if entry.unsaved:
                held = entry.count
            elif self._path is not None and self._is_stranger():
                held = entry.count + 1
            condition = Condition.HELD if held else Condition(0)
        return Status(condition, 0, held, entry.count, entry.config_hash)

    def _is_stranger(self) -> bool:
        """Whether the recorder shows a record that was not stored from here. Looked at once, until one is armed."""
        if self._stranger is None:
            fingerprint = self._fingerprint()
            self._stranger = fingerprint is not None and fingerprint != self._entry.saved
        return self._stranger

    def _fingerprint(self) -> int | None:
        """Of the record that the recorder shows; None if it shows none."""
        header = self._bare.header()
        if header.points <= 0:
            return None
        samples = self._bare.chunk(1, 0, min(FINGERPRINT, header.points)).samples
        return zlib.crc32(json.dumps(header.as_json(), sort_keys=True).encode() + samples.tobytes())

    def configure(self, settings: Settings) -> None:
        self._bare.configure(settings)
        self._entry.config_hash = settings.config_hash()

    def arm(self) -> None:
        """Counted and written down before it is sent."""
        self._entry = replace(self._entry, count=self._entry.count + 1, unsaved=True)
        self._save()
        self._stranger = None
        self._bare.arm()

    def abort(self) -> None:
        """Disarm. A record whose trigger has come goes on to its end, so the state is asked for first."""
        waiting = Condition.WAITING_FOR_ARM | Condition.WAITING_FOR_TRIGGER
        if not self._bare.status().condition & waiting:
            return
        self._bare.abort()
        self._entry.unsaved, self._entry.saved = False, self._fingerprint()
        self._stranger = None
        self._save()

    def header(self) -> Header:
        """The recorder's, with the ids that the ledger gives."""
        held = self.status().held
        return replace(self._bare.header(), record_id=held, boot=0, config_hash=self._entry.config_hash)

    def chunk(self, channel: int, start: int, count: int) -> Chunk:
        found = self._bare.chunk(channel, start, count)
        return replace(found, held=self._entry.count if self._entry.unsaved else self.status().held)

    def acknowledge(self, record_id: int, crc: int) -> None:
        """The record is safe: written down, nothing is sent."""
        self._entry.saved, self._entry.unsaved = self._fingerprint(), False
        self._entry.count = max(self._entry.count, record_id)
        self._stranger = None
        self._save()

    def resynchronise(self) -> None:
        self._bare.resynchronise()

    def identity(self) -> str:
        return self._bare.identity()

    def settings(self) -> Found:
        return self._bare.settings()

    def gate(self) -> GateReading:
        return self._bare.gate()

    def beam_free(self) -> bool | None:
        return self._bare.beam_free()

    def interlock(self) -> Interlock:
        return self._bare.interlock()

    def close(self) -> None:
        self._bare.close()
