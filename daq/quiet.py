"""A quiet record: triggered at once with nothing falling, it shows zero level and noise, and is let go again.

It is known by its configuration hash, of which the trigger source is a part: whatever happens to the host, nobody takes
one for a specimen's record. The record of a tap test is known by its trigger delay in the same way.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from daq.errors import DeviceError
from daq.finish import POLL_S, Emit
from daq.readout import again
from daq.recorder import Condition, Counts, Device, Header, Settings, Status

POINTS = 2_000
"""Samples before each drop: half a second of a line at 115,200 baud."""
CHECK_POINTS = 20_000
"""Samples when the rig is checked: enough to time the line, four seconds at 115,200 baud."""
TAP_POINTS, TAP_DELAY_NS = 5_000, 1_000


@dataclass(frozen=True)
class Quiet:
    """Zero level and noise (standard deviation) of a channel, in counts."""

    zero: float
    noise: float


def before_a_drop(wanted: Settings) -> Settings:
    """Settings of the quiet record that is taken before a drop with the settings `wanted`."""
    return replace(wanted, source="IMM", points=POINTS, pretrigger=0)


def for_a_check(wanted: Settings) -> Settings:
    """Settings of the quiet record of `droptower check`, which looks at the pre-trigger too."""
    points = max(wanted.pretrigger + 1, min(wanted.points, CHECK_POINTS))
    return replace(wanted, source="IMM", points=max(points, POINTS))


def for_taps(wanted: Settings) -> tuple[Settings, Settings]:
    """Settings of a tap test, for a push and for a pull. Their delay, which no drop has, tells them from a drop's."""
    pretrigger = min(wanted.pretrigger, TAP_POINTS // 4)
    push = replace(wanted, points=TAP_POINTS, pretrigger=pretrigger, delay_ns=TAP_DELAY_NS)
    return push, replace(push, level=-push.level, slope="NEG" if push.slope == "POS" else "POS")


def let_go(device: Device, wanted: Settings, status: Status, emit: Emit) -> Status:
    """Release a quiet record that a killed host left; the state after that."""
    if not status.held:
        return status
    header = again(device, device.header)
    ours = (before_a_drop(wanted), for_a_check(wanted), *for_taps(wanted))
    if header.config_hash not in [settings.config_hash() for settings in ours]:
        return status
    device.acknowledge(header.record_id, header.crcs[0] or 0)
    emit(
        "quiet-record-released", record_id=header.record_id, text="a record of nothing, left by a host that was cut off"
    )
    return again(device, device.status)


def take(device: Device, settings: Settings) -> tuple[Header, list[Counts], float]:
    """A quiet record, its samples, and the seconds that reading channel 1 took. The recorder is free again after it.

    Raises
    ------
    DeviceError : it does not take the settings, or does not come to its end.
    """
    device.configure(settings)
    device.arm()
    end = time.monotonic() + 2 * settings.points * settings.interval_ns * 1e-9 + 5.0
    while not again(device, device.status).condition & Condition.HELD:
        if time.monotonic() > end:
            device.abort()
            raise DeviceError("a record triggered at once does not come to its end")
        time.sleep(POLL_S / 4)
    header = again(device, device.header)
    started = time.monotonic()
    first = again(device, lambda: device.chunk(1, 0, header.points)).samples
    took = time.monotonic() - started
    rest = [
        again(device, lambda n=n: device.chunk(n, 0, header.points)).samples for n in range(2, len(header.crcs) + 1)
    ]
    device.acknowledge(header.record_id, header.crcs[0] or 0)
    return header, [first, *rest], took


def quiet_of(samples: Counts) -> Quiet:
    """Zero level and noise of a channel."""
    return Quiet(float(np.mean(samples)), float(np.std(samples)))
