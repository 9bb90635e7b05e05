"""Read a held record whole: in chunks, each checked by length and CRC-32, reads alone tried again."""

import time
from collections.abc import Callable
from typing import TypeVar

import numpy as np

from daq.errors import BadReply, DeviceError, LinkError
from daq.recorder import Counts, Device, Header, crc32

CHUNK = 25_000
TRIES = 5

T = TypeVar("T")
Progress = Callable[[int, int], None]
"""Called with samples read and samples in all."""


def read_record(device: Device, header: Header, progress: Progress) -> list[Counts]:
    """Samples of all channels of the held record.

    Raises
    ------
    LinkError : a chunk could not be had in TRIES tries; the record is still held.
    """
    total = header.points * len(header.crcs)
    done = 0
    channels: list[Counts] = []
    for number, stated in enumerate(header.crcs, 1):
        samples = np.empty(header.points, dtype=np.int16)
        for start in range(0, header.points, CHUNK):
            count = min(CHUNK, header.points - start)
            samples[start : start + count] = _chunk(device, number, start, count)
            done += count
            progress(done, total)
        if (found := crc32(samples)) != stated:
            raise BadReply(f"channel {number} has CRC-32 {found:08x}, the recorder states {stated:08x}; still held")
        channels.append(samples)
    return channels


def _chunk(device: Device, channel: int, start: int, count: int) -> Counts:
    last: Exception | None = None
    for attempt in range(TRIES):
        try:
            if attempt:
                device.resynchronise()
            samples = device.read(channel, start, count)
            if len(samples) != count:
                raise BadReply(f"{len(samples)} samples came for {count}")
            if crc32(samples) != device.crc(channel, start, count):
                raise BadReply("the CRC-32 does not match")
            return samples
        except (LinkError, DeviceError) as e:
            last = e
    raise LinkError(
        f"samples {start} to {start + count - 1} of channel {channel} could not be read in {TRIES} tries: {last}; "
        f"the recorder still holds the record: mend the line, then `droptower recover`"
    )


def again(device: Device, call: Callable[[], T]) -> T:
    """A read that is tried again after the wire was brought back in step."""
    for attempt in range(TRIES):
        try:
            if attempt:
                device.resynchronise()
            return call()
        except LinkError:
            if attempt == TRIES - 1:
                raise
            time.sleep(0.1 * attempt)
    raise AssertionError("the last try returns or raises")
