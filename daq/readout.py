"""Read a held record whole: in chunks, each checked by length and CRC-32, reads alone tried again."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from daq.chunks import Chunks
from daq.errors import BadReply, DeviceError, LinkError, NoReply
from daq.recorder import Counts, Device, Header, crc32

CHUNK = 10_000
"""Samples asked for at first: two seconds of a line at 115,200 baud, and the checks cost it a fifth of a percent."""
MOST = 250_000
SOON_S = 0.1
"""A wire that brings what was asked for sooner is asked for twice as much, up to MOST."""
PIECE = 1_000
"""What a chunk that does not come is broken into: a short reply gets through where a long one does not."""
TRIES = 5
PIECE_TRIES = 2
HOPELESS = 8
"""Pieces in a row that did not come: then the rest is not asked for."""

RECONNECT_S = 5.0
"""How long a link that is gone is waited for: long enough to push a plug back in."""

T = TypeVar("T")
Progress = Callable[[int, int], None]
"""Called with samples read and samples in all."""
Span = tuple[int, int]
"""First sample of a stretch, and the one after its last."""


@dataclass(frozen=True)
class Gap:
    """Samples of a channel (from 1) that could not be had; they stand as 0 in the record."""

    channel: int
    start: int
    count: int


@dataclass(frozen=True)
class Readout:
    """Samples of all channels, the map of what is missing, and whether the recorder still holds the record."""

    channels: list[Counts]
    gaps: tuple[Gap, ...]
    held: bool

    @property
    def gap_map(self) -> list[list[int]]:
        """Channel, first sample and number of samples of each gap."""
        return [[g.channel, g.start, g.count] for g in self.gaps]


def read_record(
    device: Device,
    header: Header,
    chunks: Chunks,
    progress: Progress,
    first: Span | None = None,
    first_read: Callable[[], None] = lambda: None,
) -> Readout:
    """The held record, going on from what `chunks` has of it.

    first : stretch that is read before the rest, on all channels; `first_read` is called once it is there

    Raises
    ------
    LinkError : the wire is gone, or nothing at all came; the record is still held and what was read is noted.
    """
    reader = _Reader(device, header, chunks, progress)
    missing: list[Gap] = []
    if first is not None:
        start, stop = max(0, first[0]), min(header.points, first[1])
        missing += reader.take_all((start, stop))
        if start < stop and not missing:
            first_read()
    missing += reader.take_all((0, header.points))
    return _read(reader, missing, header, chunks)


def read_noted(header: Header, chunks: Chunks) -> Readout:
    """What `chunks` has of a record that no recorder holds any more.

    Raises
    ------
    LinkError : that is nothing.
    """
    reader = _Reader(None, header, chunks, lambda done, total: None)
    return _read(reader, reader.take_all((0, header.points)), header, chunks)


def _read(reader: "_Reader", missing: list[Gap], header: Header, chunks: Chunks) -> Readout:
    gaps: list[Gap] = []
    in_a_row = 0
    for piece in (piece for span in missing for piece in _pieces(span)):
        came = reader.take(piece, PIECE_TRIES if in_a_row < HOPELESS else 0)
        in_a_row = 0 if came else in_a_row + 1
        if not came:
            gaps.append(piece)
    if reader.done == 0:
        raise LinkError(f"nothing of the record could be read: {reader.last}; the recorder still holds it")
    for number, stated in enumerate(header.crcs, 1):
        whole = stated is not None and not any(gap.channel == number for gap in gaps)
        if whole and (found := crc32(reader.channels[number - 1])) != stated:
            chunks.remove()
            raise BadReply(f"channel {number} has CRC-32 {found:08x}, the recorder states {stated:08x}; still held")
    return Readout(reader.channels, _joined(gaps), reader.held)


class _Reader:
    def __init__(self, device: Device | None, header: Header, chunks: Chunks, progress: Progress) -> None:
        self._device, self._header, self._chunks, self._progress = device, header, chunks, progress
        self.channels = [np.zeros(header.points, dtype=np.int16) for _ in header.crcs]
        self._asked: list[list[Span]] = [[] for _ in header.crcs]
        self._size = CHUNK
        self.done = 0
        self.held = device is not None
        self.last: Exception | None = None
        for (channel, start), samples in chunks.noted():
            self._put(Gap(channel, start, len(samples)), samples)

    def take_all(self, within: Span) -> list[Gap]:
        """Ask for all of a stretch that is not noted, in steps that fit the wire; the spans that did not come."""
        missing: list[Gap] = []
        for channel in range(1, len(self._asked) + 1):
            for start, stop in self._lacking(channel, within):
                at = start
                while at < stop:
                    span = Gap(channel, at, min(self._size, stop - at))
                    asked = time.monotonic()
                    if not self.take(span, TRIES):
                        missing.append(span)  # asked for again piece by piece, later
                        self._asked[channel - 1].append((at, at + span.count))
                    elif time.monotonic() - asked < SOON_S:
                        self._size = min(2 * self._size, MOST)
                    at += span.count
        return missing

    def _lacking(self, channel: int, within: Span) -> list[Span]:
        """Stretches of a channel that were neither had nor asked for."""
        lacking: list[Span] = []
        at, stop = within
        for start, end in sorted(self._asked[channel - 1]):
            if at < min(start, stop):
                lacking.append((at, min(start, stop)))
            at = max(at, end)
        return [*lacking, (at, stop)] if at < stop else lacking

    def take(self, span: Gap, tries: int) -> bool:
        """Whether the span was had from the recorder, while that holds the record."""
        if self._device is None or not self.held or not tries:
            return False
        samples = self._fetch(self._device, span, tries)
        if samples is None:
            self.held = self._still_held(self._device)
            return False
        self._put(span, samples)
        return True

    def _put(self, span: Gap, samples: Counts) -> None:
        part = slice(span.start, span.start + span.count)
        self.channels[span.channel - 1][part] = samples
        self._asked[span.channel - 1].append((span.start, span.start + span.count))
        self.done += span.count
        self._progress(self.done, self._header.points * len(self._header.crcs))

    def _fetch(self, device: Device, span: Gap, tries: int) -> Counts | None:
        for attempt in range(tries):
            try:
                if attempt:
                    in_step(device)
                chunk = device.chunk(span.channel, span.start, span.count)
                if len(chunk.samples) != span.count:
                    raise BadReply(f"{len(chunk.samples)} samples came for {span.count}")
                if crc32(chunk.samples) != chunk.crc:
                    raise BadReply("the CRC-32 does not match")
                if chunk.held != self._header.record_id:
                    # The CRC-32 was right, but of another record: nothing of it belongs here.
                    raise BadReply(f"the recorder holds record {chunk.held} by now")
                self._chunks.add(span.channel, span.start, chunk.samples, chunk.crc)
                return chunk.samples
            except (LinkError, DeviceError) as e:
                self.last = e
        return None

    def _still_held(self, device: Device) -> bool:
        """Whether the record is still there. LinkError: the wire is gone, and with it the answer."""
        try:
            return again(device, device.header) == self._header
        except LinkError:
            raise LinkError(
                f"the wire failed in the middle of the record: {self.last}; the recorder still holds it: "
                f"mend the line, then `droptower recover` goes on from sample {self.done}"
            ) from None


def _pieces(gap: Gap) -> list[Gap]:
    end = gap.start + gap.count
    return [Gap(gap.channel, start, min(PIECE, end - start)) for start in range(gap.start, end, PIECE)]


def _joined(gaps: list[Gap]) -> tuple[Gap, ...]:
    """Neighbours as one."""
    out: list[Gap] = []
    for gap in sorted(gaps, key=lambda g: (g.channel, g.start)):
        if out and out[-1].channel == gap.channel and out[-1].start + out[-1].count == gap.start:
            out[-1] = Gap(gap.channel, out[-1].start, out[-1].count + gap.count)
        else:
            out.append(gap)
    return tuple(out)


def in_step(device: Device) -> None:
    """Bring the wire back in step; a link that is gone is waited for.

    Raises
    ------
    LinkError : it does not come back.
    """
    end = time.monotonic() + RECONNECT_S
    while True:
        try:
            device.resynchronise()
            return
        except (NoReply, BadReply):
            raise
        except LinkError:
            if time.monotonic() > end:
                raise
            time.sleep(0.1)


def again(device: Device, call: Callable[[], T]) -> T:
    """A read that is tried again after the wire was brought back in step."""
    for attempt in range(TRIES):
        last = attempt == TRIES - 1
        try:
            if attempt:
                in_step(device)
        except (NoReply, BadReply):
            if last:
                raise
            continue
        try:
            return call()
        except LinkError:
            if last:
                raise
            time.sleep(0.1 * attempt)
    raise AssertionError("the last try returns or raises")
