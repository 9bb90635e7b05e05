"""An open rig: the devices that a rig file names, one for each wire."""

from pathlib import Path
from types import TracebackType

from daq.errors import DeviceError, SettingsError
from daq.journal import file_name
from daq.ledger import Ledger
from daq.modbus_device import ModbusDevice
from daq.profile import Profile, ScpiProfile, load_profile
from daq.recorder import Device, Settings
from daq.rig_file import Port, RigFile
from daq.scpi_device import ScpiDevice


class Rig:
    """Recorder, gate and interlock of a rig; those behind one port share one wire.

    data : the data folder, where the ledger of a recorder stands that cannot keep its records; None: nothing is armed

    Raises
    ------
    SettingsError : a profile is wrong, or does not fit the rig file.
    LinkError : a port is not there.
    DeviceError : the recorder is not what the rig file says.
    """

    def __init__(self, file: RigFile, data: Path | None = None) -> None:
        self.file = file
        self._open: dict[tuple[str, int, str], Device] = {}
        self.profile, self.profile_text = load_profile(file.recorder.profile_name, file.recorder.driver)
        _fit(file, self.profile)
        try:
            bare = self._device(file.recorder)
            self.gate = None if file.gate is None else self._device(file.gate)
            self.interlock = None if file.interlock is None else self._device(file.interlock)
            self.identity = bare.identity()
            self._refuse_another(file)
            path = None if data is None else data / "armed" / f"{file_name(self.identity)}.ledger"
            self.recorder: Device = bare if self.profile.keeps_records else Ledger(bare, path)
        except Exception:
            self.close()
            raise

    def _refuse_another(self, file: RigFile) -> None:
        wanted = file.recorder.identity
        if wanted is not None and wanted not in self.identity:
            raise DeviceError(
                f"{file.recorder.port} answers as {self.identity!r}, the rig file wants {wanted!r}; "
                f"check the port, or the key 'identity' of [recorder]"
            )

    def _device(self, port: Port) -> Device:
        key = (port.port, port.unit_id, port.profile_name)
        if key not in self._open:
            profile, _ = load_profile(port.profile_name, port.driver)
            channels = len(self.file.recorder.channel)
            if isinstance(profile, ScpiProfile):
                self._open[key] = ScpiDevice(port.port, port.baud, profile, channels)
            else:
                self._open[key] = ModbusDevice(port.port, port.baud, port.unit_id, profile, channels)
            self._open[key].resynchronise()
        return self._open[key]

    def close(self) -> None:
        for device in self._open.values():
            device.close()

    def __enter__(self) -> "Rig":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def _fit(file: RigFile, profile: Profile) -> None:
    """That a recorder's profile is one of a recorder, and its channels are scaled as the recorder tells them."""
    name = file.recorder.profile_name
    if not profile.is_recorder:
        raise SettingsError(f"[recorder] profile {name!r} describes no recorder: it has no table [data]")
    key = "volts_to_unit" if profile.scaled else "counts_to_unit"
    for number, channel in enumerate(file.recorder.channel, 1):
        if getattr(channel, key) is None:
            raise SettingsError(
                f"[recorder.channel] {number} needs the key {key!r}: so profile {name!r} gives its samples"
            )
    if profile.level == "volts" and not profile.scaled and file.recorder.channel[0].volts_to_unit is None:
        raise SettingsError(
            f"[recorder.channel] 1 needs the key 'volts_to_unit' too: profile {name!r} triggers on volts"
        )


def wanted_settings(file: RigFile, profile: Profile) -> Settings:
    """Recorder settings of a rig file, in the recorder's own units.

    Raises
    ------
    DeviceError : the sample rate is no whole number of ns, or the level does not fit 16 bits.
    """
    r = file.recorder
    interval = 1e9 / r.sample_rate_Hz
    if abs(interval - round(interval)) > 1e-6 * interval:
        near = 1e9 / round(interval)
        raise DeviceError(f"sample_rate_Hz = {r.sample_rate_Hz:g} is no whole number of ns; the nearest is {near:.6f}")
    channel = r.channel[0]
    level = r.trigger_level
    if level is None:
        assert channel.range is not None, "the rig file was checked for one of the two"
        level = (0.02 if r.trigger_slope == "POS" else -0.02) * channel.range
    if profile.level == "volts":
        assert channel.volts_to_unit is not None, "the rig was checked for it"
        volts = (level - channel.offset) / channel.volts_to_unit
        return Settings(round(interval), r.samples, r.pretrigger, volts, slope=r.trigger_slope)
    counts = round((level - channel.offset) / channel.scale)
    if not -32768 <= counts <= 32767:
        raise DeviceError(
            f"trigger_level {level:g} {channel.unit} is {counts} counts; the recorder has -32768 to 32767"
        )
    return Settings(round(interval), r.samples, r.pretrigger, counts, slope=r.trigger_slope)
