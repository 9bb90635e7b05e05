"""Is the rig ready? Identity, settings, interlock, gate, noise and link speed, before any specimen is there."""

from dataclasses import asdict, dataclass

import numpy as np

from daq.acquisition import settle
from daq.errors import AcquisitionError, DeviceError, LinkError
from daq.finish import Emit
from daq.profile import ScpiProfile
from daq.quiet import for_a_check, let_go, take
from daq.readout import again
from daq.recorder import Counts, Device, Header, Interlock, Settings
from daq.rig import Rig, wanted_settings
from daq.rig_file import RigFile

CLEAR_OF_NOISE = 6.0
"""Standard deviations that the trigger level has to stand off the zero level: nearer, noise triggers within minutes."""
SLOW = 0.5
"""Share of the line's ceiling below which a cable, an adapter or a setting is at fault."""


@dataclass(frozen=True)
class Check:
    """One row: what was looked at, whether it is as it should be, and what was found."""

    name: str
    ok: bool
    text: str


def check(rig: Rig, emit: Emit) -> bool:
    """Look at everything that can be looked at without a drop; each row goes out as an event. Whether all is well.

    Raises
    ------
    AcquisitionError : the recorder holds a record that was never saved; it is left alone.
    LinkError, DeviceError : the recorder does not answer.
    """
    device = rig.recorder
    wanted = wanted_settings(rig.file, rig.profile)
    free_recorder(rig, emit)
    rows = [
        Check("identity", True, rig.identity),
        *_abilities(rig),
        settings := _settings(device, wanted),
        *_interlock(rig),
        *_gate(rig),
    ]
    if settings.ok and rig.profile.keeps_records:
        rows += _quiet_record(device, rig)
    for row in rows:
        emit("check", **asdict(row))
    return all(row.ok for row in rows)


def free_recorder(rig: Rig, emit: Emit) -> None:
    """Bring the recorder to rest and let go what a check left.

    Raises
    ------
    AcquisitionError : it holds a record that was never saved; that is left alone.
    """
    device = rig.recorder
    status = let_go(device, wanted_settings(rig.file, rig.profile), settle(device, emit), emit)
    if status.held:
        raise AcquisitionError("held", f"the recorder holds record {status.held}; `droptower recover` saves it first")


def _abilities(rig: Rig) -> list[Check]:
    """What the recorder's profile can and cannot do for a record."""
    p = rig.profile
    order = p.data.order if isinstance(p, ScpiProfile) and p.data is not None else getattr(p, "order", "high-first")
    settled = "settled by the device's known word" if order == "sentinel" else f"{order}, as the profile says"
    ledger = "none: the host keeps the ledger, and arms over nothing that is not stored; no record is taken to check"
    return [
        Check("profile", True, f"{rig.file.recorder.profile_name}, tried on {p.tried_on}"),
        Check("byte order", True, settled),
        Check("acknowledgement", True, "kept until it is acknowledged" if p.keeps_records else ledger),
        Check("CRC", True, "of every chunk and record" if p.has_crc else "none: every chunk is read twice"),
    ]


def _settings(device: Device, wanted: Settings) -> Check:
    try:
        device.configure(wanted)
        differ = wanted.differences(again(device, device.settings))
    except DeviceError as e:
        return Check("settings", False, f"{e}; change them in the rig file")
    took = f"{1e9 / wanted.interval_ns:g} Hz, {wanted.points} samples, {wanted.pretrigger} before the trigger"
    return Check("settings", not differ, "; ".join(differ) or took)


def _interlock(rig: Rig) -> list[Check]:
    if rig.interlock is None:
        return []
    bits = again(rig.interlock, rig.interlock.interlock)
    words = [
        "door closed" if Interlock.DOOR_CLOSED in bits else "door open",
        "dart clamped" if Interlock.CLAMPED in bits else "dart not clamped",
        "catcher on" if Interlock.CATCHER_ON in bits else "catcher off",
    ]
    return [Check("interlock", Interlock.READY in bits, ", ".join(words))]


def _gate(rig: Rig) -> list[Check]:
    if rig.gate is None:
        return []
    try:
        free = again(rig.gate, rig.gate.beam_free)
    except LinkError as e:
        return [Check("gate", False, str(e))]
    if free is None:
        return [Check("gate", True, "it answers; its profile does not say whether the beam is free")]
    return [Check("gate", free, "the beam is free" if free else "the beam is broken: clear it, or align the gate")]


def _quiet_record(device: Device, rig: Rig) -> list[Check]:
    """A record of nothing, triggered at once and let go again: noise, zero level, pre-trigger and link speed."""
    quiet = for_a_check(wanted_settings(rig.file, rig.profile))
    try:
        header, samples, took = take(device, quiet)
    except DeviceError as e:
        return [Check("record", False, str(e))]
    rows = [_pretrigger(header, quiet), _noise(samples[0], quiet, rig.file)]
    return [*rows, _speed(2 * header.points / took, rig.file)]


def _pretrigger(header: Header, asked: Settings) -> Check:
    first = asked.delay_ns - asked.pretrigger * asked.interval_ns
    text = f"first sample {header.first_sample_ns * 1e-6:g} ms from the trigger, {first * 1e-6:g} ms asked for"
    return Check("pre-trigger", header.first_sample_ns == first, text)


def _noise(samples: Counts, settings: Settings, file: RigFile) -> Check:
    channel = file.recorder.channel[0]
    zero, noise = float(np.mean(samples)), float(np.std(samples))
    apart = (settings.level - zero) * (1 if settings.slope == "POS" else -1)
    scale = abs(channel.scale)
    text = (
        f"noise {noise * scale:.3g} {channel.unit}, zero level {zero * channel.scale + channel.offset:.3g} "
        f"{channel.unit}, trigger level {apart * scale:.3g} {channel.unit} away"
    )
    if apart <= CLEAR_OF_NOISE * noise:
        text += f"; set it {CLEAR_OF_NOISE:g} times the noise away at the least, or noise will trigger"
    return Check("noise", apart > CLEAR_OF_NOISE * noise, text)


def _speed(rate: float, file: RigFile) -> Check:
    """Bytes of samples a second against what the line can carry; a network has no ceiling that is known here."""
    r = file.recorder
    found = f"{rate / 1e3:.1f} kB/s of samples"
    if r.port.startswith(("socket://", "tcp://")):
        return Check("link", True, f"{found} over the network")
    characters = r.baud / 10
    if r.driver == "modbus":
        silence = 1.75e-3 if r.baud > 19200 else 3.5 / characters
        ceiling = 250 / ((255 + 8) / characters + 2 * silence)
    else:
        ceiling = characters
    share = rate / ceiling
    return Check("link", share >= SLOW, f"{found}, {100 * min(share, 1):.0f} % of what {r.baud} baud can carry")
