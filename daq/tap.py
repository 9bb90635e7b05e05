"""Before the first specimen: a tap on the tup shows a live trigger and its polarity, a tare sets the zero level."""

import time
from pathlib import Path

import numpy as np

from daq.checking import Check, free_recorder
from daq.errors import DeviceError
from daq.finish import POLL_S, Emit
from daq.history import History
from daq.quiet import before_a_drop, for_taps, quiet_of, take
from daq.readout import again
from daq.recorder import Condition, Counts, Device, Settings
from daq.rig import Rig, wanted_settings
from daq.rig_file import RigFile

WAIT_S = 10.0
CLEAR = 8.0
"""Times the noise that a tap has to be to show a polarity."""


def tap(rig: Rig, emit: Emit) -> bool:
    """Arm at the trigger level, ask for a tap, and say what it shows; then the other way round. Whether all is well.

    Raises
    ------
    AcquisitionError : the recorder holds a record that was never saved.
    DeviceError : the recorder keeps no records: a tap would overwrite what it shows.
    """
    _needs_keeping(rig, "tap")
    free_recorder(rig, emit)
    rows: list[Check] = []
    for number, settings in enumerate(for_taps(wanted_settings(rig.file, rig.profile))):
        more = "" if number == 0 else "no trigger: now looking for a pulse the other way; "
        emit("tap-now", text=f"{more}tap the tup with a knuckle or a plastic hammer, within {WAIT_S:g} s")
        if (samples := _pulse(rig.recorder, settings)) is not None:
            rows = _seen(samples, settings.pretrigger, rig.file, pushed=number == 0)
            break
    else:
        text = "no trigger either way: look at sensor, cable and amplifier, or bring trigger_level nearer to zero"
        rows = [Check("tap", False, text)]
    for row in rows:
        emit("check", **vars(row))
    return all(row.ok for row in rows)


def _pulse(device: Device, settings: Settings) -> Counts | None:
    """Channel 1 of the next record, None if nothing triggers in time."""
    device.configure(settings)
    device.arm()
    end = time.monotonic() + WAIT_S
    while not again(device, device.status).condition & Condition.HELD:
        if time.monotonic() > end:
            device.abort()
            if not again(device, device.status).condition:
                return None
            end = time.monotonic() + WAIT_S  # triggered just now
        time.sleep(POLL_S)
    header = again(device, device.header)
    samples = again(device, lambda: device.chunk(1, 0, header.points)).samples
    device.acknowledge(header.record_id, header.crcs[0] or 0)
    return samples


def _seen(samples: Counts, pretrigger: int, file: RigFile, pushed: bool) -> list[Check]:
    channel = file.recorder.channel[0]
    quiet = quiet_of(samples[: max(pretrigger - 50, 10)])
    swing = samples - quiet.zero
    peak = float(swing[int(np.argmax(np.abs(swing)))])
    value, noise = peak * channel.scale, quiet.noise * abs(channel.scale)
    seen = f"a peak of {value:.3g} {channel.unit}, noise {noise:.2g} {channel.unit}"
    if abs(peak) <= CLEAR * max(quiet.noise, 0.5):
        return [Check("tap", False, f"triggered by {seen}: that is noise; raise trigger_level")]
    rows = [Check("tap", True, f"the trigger is live: {seen}")]
    if pushed and value > 0:
        return [*rows, Check("polarity", True, "a push reads positive")]
    way = "change the sign of counts_to_unit" if value < 0 else "change trigger_slope and the sign of trigger_level"
    return [
        *rows,
        Check("polarity", False, f"a push makes {seen} and does not trigger as set: {way}, or swap the leads"),
    ]


def tare(rig: Rig, data: Path, emit: Emit) -> bool:
    """Measure the zero level of every channel, and judge drift against it from now on."""
    _needs_keeping(rig, "tare")
    free_recorder(rig, emit)
    _, samples, _ = take(rig.recorder, before_a_drop(wanted_settings(rig.file, rig.profile)))
    history = History.of(data, rig.identity)
    for channel, counts in zip(rig.file.recorder.channel, samples, strict=False):
        now = quiet_of(counts)
        history.tare(channel.name, now)
        zero, noise = now.zero * channel.scale + channel.offset, now.noise * abs(channel.scale)
        words = f"zero {zero:.3g} {channel.unit}, noise {noise:.2g} {channel.unit}"
        emit("check", name=f"tare {channel.name}", ok=True, text=words)
    if (why := history.save()) is not None:
        raise DeviceError(f"the tare could not be kept: {why}")
    return True


def _needs_keeping(rig: Rig, what: str) -> None:
    if not rig.profile.keeps_records:
        raise DeviceError(
            f"{what}: {rig.file.recorder.profile_name} keeps no records: what it shows would be overwritten; "
            f"use its own screen"
        )
