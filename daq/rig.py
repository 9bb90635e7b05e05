"""An open rig: the devices that a rig file names, one for each wire."""

from types import TracebackType

from daq.errors import DeviceError
from daq.modbus_device import ModbusDevice
from daq.recorder import Device, Settings
from daq.rig_file import Port, RigFile
from daq.scpi_device import ScpiDevice


class Rig:
    """Recorder, gate and interlock of a rig; those behind one port share one wire.

    Raises
    ------
    LinkError : a port is not there.
    DeviceError : the recorder is not what the rig file says.
    """

    def __init__(self, file: RigFile) -> None:
        self.file = file
        self._open: dict[tuple[str, int], Device] = {}
        try:
            self.recorder = self._device(file.recorder)
            self.gate = None if file.gate is None else self._device(file.gate)
            self.interlock = None if file.interlock is None else self._device(file.interlock)
            self.identity = self.recorder.identity()
        except Exception:
            self.close()
            raise
        wanted = file.recorder.identity
        if wanted is not None and wanted not in self.identity:
            self.close()
            raise DeviceError(
                f"{file.recorder.port} answers as {self.identity!r}, the rig file wants {wanted!r}; "
                f"check the port, or the key 'identity' of [recorder]"
            )

    def _device(self, port: Port) -> Device:
        key = (port.port, port.unit_id)
        if key not in self._open:
            if port.driver == "scpi":
                self._open[key] = ScpiDevice(port.port, port.baud)
            else:
                self._open[key] = ModbusDevice(port.port, port.baud, port.unit_id)
            self._open[key].resynchronise()
        return self._open[key]

    def close(self) -> None:
        for device in self._open.values():
            device.close()

    def __enter__(self) -> "Rig":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def wanted_settings(file: RigFile) -> Settings:
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
    counts = round((level - channel.offset) / channel.counts_to_unit)
    if not -32768 <= counts <= 32767:
        raise DeviceError(
            f"trigger_level {level:g} {channel.unit} is {counts} counts; the recorder has -32768 to 32767"
        )
    return Settings(round(interval), r.samples, r.pretrigger, counts, slope=r.trigger_slope)
