"""What the device refuses, the queue it says so in, and the IEEE 488.2 registers that sum it up."""

from __future__ import annotations

from collections import deque

TEXTS = {
    0: "No error",
    -102: "Syntax error",
    -104: "Data type error",
    -108: "Parameter not allowed",
    -109: "Missing parameter",
    -113: "Undefined header",
    -213: "Init ignored",
    -221: "Settings conflict",
    -222: "Data out of range",
    -224: "Illegal parameter value",
    -230: "Data corrupt or stale",
    -350: "Queue overflow",
}
QUEUE_LENGTH = 16

OPERATION_COMPLETE, QUERY_ERROR, EXECUTION_ERROR, COMMAND_ERROR, POWER_ON = 1, 4, 16, 32, 128
QUEUE_BIT, EVENT_BIT, SERVICE_BIT = 4, 32, 64


class DeviceError(Exception):
    """A command that the device refuses, with its SCPI code."""

    def __init__(self, code: int) -> None:
        """Refuse with ``code``, one of ``TEXTS``."""
        super().__init__(f'{code},"{TEXTS[code]}"')
        self.code = code


class Status:
    """Error queue and event status register, one for all wires."""

    def __init__(self) -> None:
        """As after power on."""
        self.queue: deque[int] = deque()
        self.event = POWER_ON
        self.event_enable = 0
        self.service_enable = 0

    def report(self, code: int) -> None:
        """Queue an error and set its bit; the last place of a full queue becomes −350."""
        self.event |= (
            COMMAND_ERROR if code > -200 else EXECUTION_ERROR if code > -300 else 8 if code > -400 else QUERY_ERROR
        )
        if len(self.queue) < QUEUE_LENGTH:
            self.queue.append(code)
        else:
            self.queue[-1] = -350

    def next_error(self) -> str:
        """Take the oldest error out, as ``SYSTem:ERRor?`` answers it."""
        code = self.queue.popleft() if self.queue else 0
        return f'{code},"{TEXTS[code]}"'

    def read_event(self) -> int:
        """The event status register; reading clears it."""
        event, self.event = self.event, 0
        return event

    def clear(self) -> None:
        """``*CLS``: queue and event register, not the enables."""
        self.queue.clear()
        self.event = 0

    def byte(self) -> int:
        """The status byte as ``*STB?`` answers it."""
        byte = (QUEUE_BIT if self.queue else 0) | (EVENT_BIT if self.event & self.event_enable else 0)
        return byte | (SERVICE_BIT if byte & self.service_enable else 0)
