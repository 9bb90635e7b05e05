"""The catalogue of faults: where each strikes, what it does, its options."""

from __future__ import annotations

from sim_device.checksum import crc16
from sim_device.fault import FOREVER, Cut, Fault, Kind, Language, Options, Pause, Pieces

SECONDS = (0.0, FOREVER)


def _drop(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:at] + data[at + 1 :]]


def _duplicate(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[: at + 1] + data[at:]]


def _flip(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:at] + bytes([data[at] ^ 1 << int(fault.options["bit"])]) + data[at + 1 :]]


def _insert(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:at] + bytes([int(fault.options["value"])]) + data[at:]]


def _stall(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:at], Pause(fault.options["seconds"]), data[at:]]


def _truncate(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:at]]


def _close(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:at], Cut("close")]


def _reset(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:at], Cut("reset")]


def _vanish(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:at], Cut("vanish", fault.options["seconds"])]


def _taken(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:at], Cut("taken", fault.options["seconds"])]


def _split(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    size = int(fault.options["size"])
    pieces: Pieces = []
    for start in range(0, len(data), size):
        pieces += [Pause(fault.options["seconds"]), data[start : start + size]]
    return pieces[1:]


def _wait(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [Pause(fault.options["seconds"]), data]


def _noise(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data, Pause(fault.options["seconds"]), fault.rng.randbytes(int(fault.options["size"]))]


def _longer(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data + fault.rng.randbytes(int(fault.options["size"]))]


def _again(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data, data]


def _without_end(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:-1]]


def _bad_crc(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [data[:-2] + bytes(255 - byte for byte in data[-2:])]


def _reframed(data: bytes, index: int, change: int, language: Language) -> Pieces:
    """A frame with one byte of its body changed and a check sum that is right again."""
    start, end = (6, len(data)) if language == "tcp" else (0, len(data) - 2)
    body = bytearray(data[start:end])
    body[index] = (body[index] + change) & 0xFF
    return [data[:6] + bytes(body)] if language == "tcp" else [bytes(body) + crc16(bytes(body))]


def _unit(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return _reframed(data, 0, 1, language)


def _function(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return _reframed(data, 1, 1, language)


def _transaction(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    return [(int.from_bytes(data[:2], "big") + 1 & 0xFFFF).to_bytes(2, "big") + data[2:]]


def _length(fault: Fault, data: bytes, at: int, language: Language) -> Pieces:
    by = int(fault.options["by"])
    if language != "scpi":
        return _reframed(data, 2, by, language)
    if data[:1] != b"#":
        return [data]
    digits = int(data[1:2])
    stated = max(0, int(data[2 : 2 + digits]) + by) % 10**digits
    return [data[:2] + f"{stated:0{digits}d}".encode() + data[2 + digits :]]


_BIT: Options = {"bit": (0, 0, 7)}
_VALUE: Options = {"value": (0x55, 0, 255)}


def _for(seconds: float) -> Options:
    return {"seconds": (seconds, *SECONDS)}


KINDS = {
    # Line
    "drop_byte": Kind("byte", "a byte of a reply is lost", act=_drop),
    "duplicate_byte": Kind("byte", "a byte of a reply comes twice", act=_duplicate),
    "flip_byte": Kind("byte", "`bit` of a byte of a reply is inverted", _BIT, _flip),
    "insert_byte": Kind("byte", "a byte of `value` comes before a byte of a reply", _VALUE, _insert),
    "drop_byte_in": Kind("in", "a byte from the host is lost", act=_drop),
    "duplicate_byte_in": Kind("in", "a byte from the host arrives twice", act=_duplicate),
    "flip_byte_in": Kind("in", "`bit` of a byte from the host is inverted", _BIT, _flip),
    "insert_byte_in": Kind("in", "a byte of `value` arrives before a byte from the host", _VALUE, _insert),
    "split": Kind("reply", "a reply comes in pieces of `size` bytes, `seconds` apart",
                  {"size": (7, 1, 1e6), **_for(0.002)}, _split),
    "coalesce": Kind("reply", "replies are kept back for `seconds`, those of that time leave in one piece",
                     _for(0.05), _wait),
    "stall": Kind("byte", "the line is silent for `seconds` before a byte of a reply", _for(1), _stall),
    "noise": Kind("reply", "`size` random bytes come `seconds` after a reply, on an idle line",
                  {"size": (8, 1, 1e6), **_for(0.05)}, _noise),
    "echo": Kind("in", "what the host sends comes back before the reply, from the nth byte on", act=None),
    # Framing
    "bad_crc": Kind("reply", "the CRC-16 of an RTU reply is wrong", act=_bad_crc, languages=("rtu",)),
    "truncated": Kind("byte", "a reply ends before its nth byte", act=_truncate),
    "over_long": Kind("reply", "a reply has `size` random bytes too many", {"size": (3, 1, 1e6)}, _longer),
    "wrong_unit": Kind("reply", "a Modbus reply comes from another unit", act=_unit, languages=("rtu", "tcp")),
    "wrong_function": Kind("reply", "a Modbus reply is of another function", act=_function, languages=("rtu", "tcp")),
    "wrong_transaction": Kind("reply", "a Modbus TCP reply has another transaction number", act=_transaction,
                              languages=("tcp",)),
    "wrong_length": Kind("reply", "a block (SCPI) or a frame (Modbus) announces `by` bytes more than it has",
                         {"by": (1, -200, 200)}, _length),
    "no_terminator": Kind("reply", "the line feed at the end of a reply is missing",
                          act=_without_end, languages=("scpi",)),
    # Timing
    "slow_reply": Kind("reply", "a reply begins `seconds` late", _for(0.5), _wait),
    "late_reply": Kind("reply", "a reply comes when the host has given it up, `seconds` late", _for(2.5), _wait),
    "duplicate_reply": Kind("reply", "a reply comes twice", act=_again),
    "busy": Kind("request", "SCPI: nothing is answered for `seconds`; Modbus: exception 06", _for(0.5)),
    "exception": Kind("request", "a Modbus request is answered with exception `code`", {"code": (6, 1, 255)},
                      languages=("rtu", "tcp")),
    # Link
    "disconnect": Kind("byte", "the link is closed before a byte of a reply; a serial port is there again at once",
                       act=_close),
    "reset_link": Kind("byte", "the link is reset before a byte of a reply", act=_reset),
    "vanish": Kind("byte", "the port is gone before a byte of a reply, for `seconds`", _for(1), _vanish),
    "second_client": Kind("byte", "another client takes the link before a byte of a reply and keeps it for `seconds`",
                          _for(0.5), _taken),
    # Device
    "device_reset": Kind("request", "the device loses power for an instant instead of answering; boot counter up"),
    "brown_out": Kind("event", "power fails in the middle of a record: it is lost, boot counter up"),
    "clamped_settings": Kind("event", "the sample interval is silently taken as the other end of its range"),
    "error_overflow": Kind("request", "seventeen errors fill the error queue before a request"),
    "wrong_clock": Kind("event", "samples stand `factor` times as far apart as the header states",
                        {"factor": (2, 0.1, 10)}),
    # Acquisition
    "stale_record": Kind("event", "what is held after the trigger is the record before, and the new one is lost"),
    "spurious_trigger": Kind("event", "the trigger fires without a drop, `seconds` after arming", _for(0.05)),
    "missing_trigger": Kind("event", "the trigger is not seen"),
    "early_trigger": Kind("event", "the trigger fires `seconds` before its level is reached", _for(0.002)),
    "double_trigger": Kind("event", "a second trigger, `seconds` after the first, starts the record again",
                           _for(0.002)),
    "short_pretrigger": Kind("event", "`missing` of the pre-trigger samples are not there; the record begins later",
                             {"missing": (100, 1, 1e6)}),
    "saturation": Kind("event", "samples beyond `share` of the range stand at the rail", {"share": (0.05, 0, 1)}),
    "stuck_bit": Kind("event", "`bit` (0 to 15) of every sample of a record is stuck `at` 0 or 1",
                      {"bit": (3, 0, 15), "at": (1, 0, 1)}),
    "dropped_samples": Kind("event", "`size` samples from `at` on are missing in a record; what follows moves up",
                            {"size": (10, 1, 1e6), "at": (600, 0, 1e6)}),
    "swapped_bytes": Kind("request", "the bytes of every sample in a reply are swapped"),
    "swapped_channels": Kind("request", "the samples in a reply are those of another channel"),
    "bad_crc32": Kind("request", "the CRC-32 that is stated of a span is wrong"),
    "overwritten": Kind("request", "the held record is overwritten by another before a request is answered"),
    "gate_missing": Kind("event", "a gate edge is not stamped"),
    "gate_absurd": Kind("event", "a gate edge is stamped `seconds` away from where it was",
                        {"seconds": (-3600, -1e6, 1e6)}),
}  # fmt: skip


def catalogue() -> str:
    """The table of docs/device-protocol.md: name, where it strikes, options, what happens."""
    lines = ["| fault | nth | options | what happens |", "|---|---|---|---|"]
    for name, kind in KINDS.items():
        options = ", ".join(f"`{key}` {limits[0]:g}" for key, limits in kind.options.items())
        where = {"byte": "byte of the reply", "in": "byte from the host"}.get(kind.where, kind.where)
        only = "" if len(kind.languages) == 3 else f" ({', '.join(kind.languages)} alone)"
        lines.append(f"| `{name}` | {where} | {options} | {kind.does}{only} |")
    return "\n".join(lines)
