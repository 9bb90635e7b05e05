"""What the demo drops with: rig and test file, and the operator's hand at the emulator."""

import json
import socket
from typing import Any

from api.process import Acquisition, ProcessError

TEST_FILE = """[dart]
mass_kg = 0.503
tip_radius_mm = 6.35

[specimen]
id = "CR-39 no. {number}"
material = "CR-39"
thickness_mm = 4.6
nu = 0.30

[support]
kind = "ring"
radius_mm = 30
"""

RIG_FILE = """[recorder]
driver = "{driver}"
port = "{port}"
sample_rate_Hz = 500e3
samples = 250_000          # 0.5 s: the second contact is in the record
pretrigger = 1000
trigger_level = 60         # N

[[recorder.channel]]
name = "tup"
counts_to_unit = 0.390625  # N a count: 14 bits over ±3200 N
range = 3200

[gate]
driver = "{driver}"
port = "{port}"
flag_width_mm = 10
gap_mm = 20
wait_s = 0.2

[interlock]
driver = "{driver}"
port = "{port}"
wait_s = 10                # for the dart to come to rest and be clamped again
"""


def drop(acquisition: Acquisition, hand: "Control") -> dict[str, Any]:
    """Let go once the recorder is armed; the truth of the drop."""
    for event in acquisition:
        if event["event"] == "armed":
            return hand.ask(do="release")["truth"]
    raise ProcessError(acquisition.events[-1].get("text", "acquisition ended before it armed"))


class Control:
    """The operator's hand at the emulator: one JSON line asked, one answered."""

    def __init__(self, endpoint: str) -> None:
        host, _, port = endpoint.rpartition("//")[2].rpartition(":")
        self._socket = socket.create_connection((host, int(port)), timeout=30)
        self._lines = self._socket.makefile("r", encoding="utf-8")

    def ask(self, **request: Any) -> dict[str, Any]:
        """The answer to a request.

        Raises
        ------
        ProcessError : the emulator refused it.
        """
        self._socket.sendall(json.dumps(request).encode() + b"\n")
        answer = json.loads(self._lines.readline() or '{"ok": false, "error": "the emulator has gone"}')
        if not answer.get("ok"):
            raise ProcessError(f"the emulator refused {request}: {answer.get('error')}")
        return answer

    def __enter__(self) -> "Control":
        return self

    def __exit__(self, *exception: object) -> None:
        self._lines.close()
        self._socket.close()
