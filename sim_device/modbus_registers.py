"""The register map of docs/device-protocol.md, section Modbus."""

from __future__ import annotations

import struct
from dataclasses import replace

from sim_device.device import IDENTITY, Device, Reading
from sim_device.errors import DeviceError

ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE, REFUSED, BUSY = 1, 2, 3, 4, 6
LAST_INPUT, FIRST_SAMPLE, LAST_HOLDING = 175, 0x1000, 47
SPAN_CRC = 168
AT_ONCE = 16

SOURCES, SLOPES = ("INT", "IMM", "EXT"), ("POS", "NEG")
VALUES = {0: 2, 2: 2, 4: 2, 6: 1, 7: 1, 8: 1, 9: 2, 16: 1, 18: 2, 20: 2, 32: 1, 33: 2, 36: 1, 37: 2, 39: 2}
"""Holding registers: first address of a value and how many registers it takes."""
RESERVED = set(range(LAST_HOLDING + 1)) - {at + k for at, size in VALUES.items() for k in range(size)}
LAST_SETTING = 10


class Exceptional(Exception):
    """A request answered with a Modbus exception."""

    def __init__(self, code: int) -> None:
        """Answer with exception ``code``."""
        super().__init__(f"Modbus exception {code}")
        self.code = code


def input_registers(device: Device, address: int, count: int) -> bytes:
    """Registers ``address`` to ``address + count`` as big-endian bytes."""
    if address + count <= LAST_INPUT + 1:
        return _block(device, address <= SPAN_CRC < address + count)[2 * address : 2 * (address + count)]
    if address < FIRST_SAMPLE or address + count > 0x10000:
        raise Exceptional(ILLEGAL_ADDRESS)
    record, reading = device.memory.held, device.reading
    start = reading.window_start + address - FIRST_SAMPLE
    if (
        not device.held_id
        or record is None
        or reading.window_channel > record.channels
        or start + count > record.points
    ):
        raise Exceptional(ILLEGAL_ADDRESS)
    return device.read("FC04", record, reading.window_channel - 1, start, count).astype(">i2").tobytes()


def _block(device: Device, with_crc: bool) -> bytes:
    image = bytearray(2 * (LAST_INPUT + 1))

    def put(address: int, form: str, *values: int) -> None:
        struct.pack_into(f">{form}", image, 2 * address, *values)

    memory, queue = device.memory, device.status.queue
    put(0, "HIHH", 0x0102, 0x01020304, 1, AT_ONCE)
    image[16:80] = IDENTITY.encode("ascii").ljust(64, b"\0")
    put(64, "HIIIIHH", device.condition, memory.boot, device.held_id, memory.last_id, device.setup.hash,
        device.tower.interlock, device.tower.beam_free)  # fmt: skip
    put(86, "hH", queue[0] if queue else 0, len(queue))
    record = memory.held
    if device.held_id and record is not None:
        crcs = [record.crc(channel) if channel < record.channels else 0 for channel in range(4)]
        put(96, "IIIIIqQHH4I", record.id, record.boot, record.hash, record.points, record.interval_ns, record.first_ns,
            record.trigger_us, record.bits, record.channels, *crcs)  # fmt: skip
        r = device.reading
        within = r.span_channel <= record.channels and r.span_count and r.span_start + r.span_count <= record.points
        if with_crc and within:
            put(SPAN_CRC, "I", device.span_crc("FC04", record, r.span_channel - 1, r.span_start, r.span_count))
    gate_id, edges = device.recorder.gate()
    put(128, "IH", gate_id, len(edges))
    put(132, "8q", *edges, *[0] * (8 - len(edges)))
    return bytes(image)


def holding_registers(device: Device, address: int, count: int) -> bytes:
    """Holding registers ``address`` to ``address + count`` as big-endian bytes."""
    if address + count > LAST_HOLDING + 1:
        raise Exceptional(ILLEGAL_ADDRESS)
    return _holding(device)[2 * address : 2 * (address + count)]


def _holding(device: Device) -> bytes:
    image = bytearray(2 * (LAST_HOLDING + 1))
    s, r = device.setup, device.reading
    struct.pack_into(">IIIHhHI", image, 0, s.interval_ns, s.points, s.pretrigger, SOURCES.index(s.source), s.level,
                     SLOPES.index(s.slope), s.delay_ns)  # fmt: skip
    struct.pack_into(">II", image, 36, r.acknowledge_id, r.acknowledge_crc)
    struct.pack_into(">HI", image, 64, r.window_channel, r.window_start)
    struct.pack_into(">HII", image, 72, r.span_channel, r.span_start, r.span_count)
    return bytes(image)


def write(device: Device, address: int, data: bytes) -> None:
    """Write registers from ``address`` on: values first, all or none, then the command among them."""
    count = len(data) // 2
    if address + count > LAST_HOLDING + 1:
        raise Exceptional(ILLEGAL_ADDRESS)
    written = range(address, address + count)
    halves = any(0 < sum(at + k in written for k in range(size)) < size for at, size in VALUES.items())
    if halves or any(data[2 * (at - address) : 2 * (at - address) + 2] != b"\0\0" for at in RESERVED if at in written):
        raise Exceptional(ILLEGAL_VALUE)
    image = bytearray(_holding(device))
    image[2 * address : 2 * (address + count)] = data
    reading = _reading(device, bytes(image))
    setup, readout = device.setup, device.reading
    command = struct.unpack_from(">H", image, 32)[0] if 16 in written else 0
    if command > 5:
        raise Exceptional(ILLEGAL_VALUE)
    try:
        if address <= LAST_SETTING:
            _configure(device, bytes(image))
        device.reading = reading
        _command(device, command)
    except DeviceError as error:
        device.recorder.setup, device.reading = setup, readout
        if error.code in (-222, -224):
            raise Exceptional(ILLEGAL_VALUE) from error
        device.status.report(error.code)
        raise Exceptional(REFUSED) from error


def _reading(device: Device, image: bytes) -> Reading:
    ack_id, ack_crc = struct.unpack_from(">II", image, 36)
    window_channel, window_start = struct.unpack_from(">HI", image, 64)
    span_channel, span_start, span_count = struct.unpack_from(">HII", image, 72)
    if not 1 <= window_channel <= 4 or not 1 <= span_channel <= 4:
        raise Exceptional(ILLEGAL_VALUE)
    return replace(
        device.reading, acknowledge_id=ack_id, acknowledge_crc=ack_crc, window_channel=window_channel,
        window_start=window_start, span_channel=span_channel, span_start=span_start, span_count=span_count,
    )  # fmt: skip


def _configure(device: Device, image: bytes) -> None:
    interval, points, pretrigger, source, level, slope, delay = struct.unpack_from(">IIIHhHI", image, 0)
    if source >= len(SOURCES) or slope >= len(SLOPES):
        raise DeviceError(-224)
    device.recorder.configure(
        interval_ns=interval, points=points, pretrigger=pretrigger, source=SOURCES[source], level=level,
        slope=SLOPES[slope], delay_ns=delay,
    )  # fmt: skip


def _command(device: Device, command: int) -> None:
    if command == 1:
        device.recorder.init()
    elif command == 2:
        device.recorder.abort()
    elif command == 3:
        device.recorder.acknowledge(device.reading.acknowledge_id, device.reading.acknowledge_crc)
    elif command == 4:
        device.status.clear()
    elif command == 5:
        device.reset()
