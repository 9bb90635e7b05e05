"""The commands of docs/device-protocol.md, section SCPI, in its order."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal

from sim_device.acquisition import State
from sim_device.device import IDENTITY, Device
from sim_device.errors import OPERATION_COMPLETE, DeviceError
from sim_device.memory import Record
from sim_device.scpi import Command, Interface, block, decimal, integer, word

MOST_SAMPLES = 500_000

Answer = Callable[[Device, list[str]], bytes | None]


def _says(answer: Callable[[Device], object]) -> Answer:
    return lambda device, parameters: str(answer(device)).encode("ascii")


def _does(action: Callable[[Device], object]) -> Answer:
    def run(device: Device, parameters: list[str]) -> None:
        action(device)

    return run


def _register(name: str) -> Answer:
    def run(device: Device, parameters: list[str]) -> None:
        value = integer(parameters[0])
        if not 0 <= value <= 255:
            raise DeviceError(-222)
        setattr(device.status, name, value)

    return run


def _complete(device: Device) -> None:
    device.status.event |= OPERATION_COMPLETE


def _configures(setting: str, convert: Callable[[str], object]) -> Answer:
    def run(device: Device, parameters: list[str]) -> None:
        device.recorder.configure(**{setting: convert(parameters[0])})

    return run


def _ns(text: str) -> int:
    return round(decimal(text) * Decimal(10) ** 9)


def _seconds(ns: int) -> str:
    return f"{ns / 1e9:.9E}"


def _format(device: Device, parameters: list[str]) -> None:
    if parameters[0].upper() not in ("INT", "INTEGER") or integer(parameters[1]) != 16:
        raise DeviceError(-224)


def _byte_order(device: Device, parameters: list[str]) -> None:
    device.reading.swapped = word(parameters[0], "NORMal", "SWAPped") == "SWAP"


def held(device: Device) -> Record:
    """The held record, or DeviceError −230."""
    record = device.memory.held
    if record is None or device.recorder.state is not State.HELD:
        raise DeviceError(-230)
    return record


def _span(device: Device, parameters: list[str]) -> tuple[Record, int, int, int]:
    start, count = integer(parameters[1]), integer(parameters[2])
    record = held(device)
    names = [f"CH{n + 1}" for n in range(record.channels)]
    if parameters[0].upper() not in names:
        raise DeviceError(-224)
    index = names.index(parameters[0].upper())
    if not 1 <= count <= MOST_SAMPLES or not 0 <= start <= record.points - count:
        raise DeviceError(-222)
    return record, index, start, count


def _samples(device: Device, name: str, record: Record, channel: int, start: int, count: int) -> bytes:
    order = "<i2" if device.reading.swapped else ">i2"
    return block(device.read(name, record, channel, start, count).astype(order).tobytes())


def _data(device: Device, parameters: list[str]) -> bytes:
    return _samples(device, "TRAC:DATA?", *_span(device, parameters))


def _crc(device: Device, parameters: list[str]) -> bytes:
    crc = device.span_crc("TRAC:CRC?", *_span(device, parameters))
    return str(crc).encode()


def _fetch(device: Device, parameters: list[str]) -> bytes:
    record = held(device)
    return _samples(device, "FETC?", record, 0, 0, record.points)


def _header(device: Device) -> str:
    if not device.held_id:
        return ",".join("0" * 10)
    r = held(device)
    values = [r.id, r.boot, r.hash, r.points, r.interval_ns, r.first_ns, r.trigger_us, r.bits, r.channels]
    return ",".join(str(value) for value in [*values, *(r.crc(channel) for channel in range(r.channels))])


def _trace_status(device: Device) -> str:
    memory = device.memory
    return f"{device.condition},{memory.boot},{device.held_id},{memory.last_id},{device.setup.hash}"


def _acknowledge(device: Device, parameters: list[str]) -> None:
    device.recorder.acknowledge(integer(parameters[0]), integer(parameters[1]))


def _gate(device: Device) -> str:
    record_id, edges = device.recorder.gate()
    return ",".join(map(str, [record_id, len(edges), *edges]))


COMMANDS = [
    Command("*IDN?", 0, _says(lambda d: IDENTITY)),
    Command("*RST", 0, _does(lambda d: d.reset())),
    Command("*CLS", 0, _does(lambda d: d.status.clear())),
    Command("*ESE", 1, _register("event_enable")),
    Command("*ESE?", 0, _says(lambda d: d.status.event_enable)),
    Command("*ESR?", 0, _says(lambda d: d.status.read_event())),
    Command("*SRE", 1, _register("service_enable")),
    Command("*SRE?", 0, _says(lambda d: d.status.service_enable)),
    Command("*STB?", 0, _says(lambda d: d.status.byte())),
    Command("*OPC", 0, _does(_complete)),
    Command("*OPC?", 0, _says(lambda d: 1)),
    Command("*WAI", 0, _does(lambda d: None)),
    Command("*TST?", 0, _says(lambda d: 0)),
    Command("SYSTem:ERRor[:NEXT]?", 0, _says(lambda d: d.status.next_error())),
    Command("SYSTem:VERSion?", 0, _says(lambda d: "1999.0")),
    Command("SYSTem:BOOT?", 0, _says(lambda d: d.memory.boot)),
    Command("[SENSe:]SWEep:TINTerval", 1, _configures("interval_ns", _ns)),
    Command("[SENSe:]SWEep:TINTerval?", 0, _says(lambda d: _seconds(d.setup.interval_ns))),
    Command("[SENSe:]SWEep:POINts", 1, _configures("points", integer)),
    Command("[SENSe:]SWEep:POINts?", 0, _says(lambda d: d.setup.points)),
    Command("[SENSe:]SWEep:OFFSet:POINts", 1, _configures("pretrigger", lambda text: -integer(text))),
    Command("[SENSe:]SWEep:OFFSet:POINts?", 0, _says(lambda d: -d.setup.pretrigger)),
    Command("TRIGger:SOURce", 1, _configures("source", lambda text: word(text, "INTernal", "IMMediate", "EXTernal"))),
    Command("TRIGger:SOURce?", 0, _says(lambda d: d.setup.source)),
    Command("TRIGger:LEVel", 1, _configures("level", integer)),
    Command("TRIGger:LEVel?", 0, _says(lambda d: d.setup.level)),
    Command("TRIGger:SLOPe", 1, _configures("slope", lambda text: word(text, "POSitive", "NEGative"))),
    Command("TRIGger:SLOPe?", 0, _says(lambda d: d.setup.slope)),
    Command("TRIGger:DELay", 1, _configures("delay_ns", _ns)),
    Command("TRIGger:DELay?", 0, _says(lambda d: _seconds(d.setup.delay_ns))),
    Command("INITiate[:IMMediate]", 0, _does(lambda d: d.recorder.init())),
    Command("ABORt", 0, _does(lambda d: d.recorder.abort())),
    Command("STATus:OPERation:CONDition?", 0, _says(lambda d: d.condition)),
    Command("STATus:QUEStionable:CONDition?", 0, _says(lambda d: 0)),
    Command("FORMat[:DATA]", 2, _format),
    Command("FORMat[:DATA]?", 0, _says(lambda d: "INT,16")),
    Command("FORMat:BORDer", 1, _byte_order),
    Command("FORMat:BORDer?", 0, _says(lambda d: "SWAP" if d.reading.swapped else "NORM")),
    Command("FORMat:SENTinel?", 0, lambda d, p: block(b"\x02\x01" if d.reading.swapped else b"\x01\x02"), data=True),
    Command("TRACe:STATus?", 0, _says(_trace_status)),
    Command(
        "TRACe:CATalog?",
        0,
        _says(lambda d: '"' + ",".join(f"CH{n + 1}" for n in range(d.tower.rig.recorder.channels)) + '"'),
    ),
    Command("TRACe:HEADer?", 0, _says(_header)),
    Command("TRACe:DATA?", 3, _data, data=True),
    Command("TRACe:CRC?", 3, _crc),
    Command("FETCh?", 0, _fetch, data=True),
    Command("TRACe:ACKnowledge", 2, _acknowledge),
    Command("GATE:DATA?", 0, _says(_gate)),
    Command("GATE:BEAM?", 0, _says(lambda d: int(d.tower.beam_free))),
    Command("INTerlock:STATe?", 0, _says(lambda d: d.tower.interlock)),
]

SCPI = Interface(COMMANDS)
