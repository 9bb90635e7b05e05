"""What is usual of a recorder: zero level and noise of each channel at its last drops, and the last tare.

One small file a recorder in the data folder. The usual is the median of the last drops; a zero level has moved when it
lies further from it, or from the tare, than MOVED of the range and than five times its own scatter; noise is high
when it is twice the usual. With fewer than FEWEST drops and no tare nothing is said.
"""

import json
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median
from typing import Any

from daq.errors import StoreError
from daq.journal import file_name, put_down
from daq.quiet import Quiet

KEPT = 30
FEWEST = 3
MOVED = 0.005
"""Share of a channel's range."""
NOISY = 2.0


@dataclass
class History:
    """Of one recorder in one data folder. A file that cannot be read is told by `lost`, and begun anew."""

    path: Path
    channels: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])
    lost: str | None = None

    @classmethod
    def of(cls, data: Path, identity: str) -> "History":
        """What is known of a recorder."""
        path = data / "history" / f"{file_name(identity)}.json"
        try:
            return cls(path, json.loads(path.read_text()))
        except FileNotFoundError:
            return cls(path)
        except (OSError, ValueError) as e:
            return cls(path, lost=f"the history {path} cannot be read ({e}); it is begun anew")

    def _entry(self, channel: str) -> dict[str, Any]:
        return self.channels.setdefault(channel, {"zero": [], "noise": [], "tare": None})

    def unusual(self, channel: str, now: Quiet, full_scale: float) -> list[tuple[str, str]]:
        """Code and words of what is not as usual; `full_scale` in counts."""
        entry = self._entry(channel)
        zeros, noises, found = entry["zero"], entry["noise"], list[tuple[str, str]]()
        usual = entry["tare"] if entry["tare"] is not None else median(zeros) if len(zeros) >= FEWEST else None
        if usual is not None:
            scatter = median(abs(z - median(zeros)) for z in zeros) if zeros else 0.0
            allowed = max(MOVED * full_scale, 5 * 1.48 * scatter)
            if abs(now.zero - usual) > allowed:
                since = "the tare" if entry["tare"] is not None else "the last drops"
                found.append((
                    "baseline-drift",
                    f"channel {channel}: the zero level has moved by {now.zero - usual:+.0f} counts since {since}, "
                    f"{allowed:.0f} are usual; look at sensor and cable, then tare",
                ))  # fmt: skip
        if len(noises) >= FEWEST and now.noise > NOISY * max(median(noises), 0.5):
            found.append((
                "noise-high",
                f"channel {channel}: noise is {now.noise:.1f} counts, {median(noises):.1f} are usual; "
                f"look at cable, shield and mains",
            ))  # fmt: skip
        return found

    def add(self, channel: str, now: Quiet) -> None:
        """Remember a drop's."""
        entry = self._entry(channel)
        entry["zero"] = [*entry["zero"], now.zero][-KEPT:]
        entry["noise"] = [*entry["noise"], now.noise][-KEPT:]

    def tare(self, channel: str, now: Quiet) -> None:
        """From now on the zero level is judged against this one."""
        self._entry(channel).update(tare=now.zero, zero=[now.zero])

    def save(self) -> str | None:
        """Write it down; why that did not work, if it did not: that costs no drop."""
        try:
            put_down(self.path, self.channels)
        except StoreError as e:
            return str(e)
        return None
