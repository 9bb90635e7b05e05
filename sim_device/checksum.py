"""The check sum of Modbus RTU."""

from __future__ import annotations


def _entry(value: int) -> int:
    for _ in range(8):
        value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value


TABLE = [_entry(value) for value in range(256)]


def crc16(data: bytes) -> bytes:
    """The check sum of an RTU frame, low byte first (polynomial 0xA001, from 0xFFFF)."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ TABLE[(crc ^ byte) & 0xFF]
    return crc.to_bytes(2, "little")
