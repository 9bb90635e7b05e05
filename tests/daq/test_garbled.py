"""Whatever a line makes of a reply, acquisition takes it for a reply or says that it is none."""

import random
import socketserver
import threading
from collections.abc import Iterator

import pytest
from emulator import Emulator

from daq.errors import DaqError, NoReply
from daq.profile import ScpiProfile, load_profile
from daq.scpi_device import ScpiDevice
from daq.wire import Wire

TRIES = 400


@pytest.fixture(scope="module")
def replies() -> Iterator[dict[str, bytes]]:
    """What the emulator answers to each query that acquisition sends, but blocks."""
    profile = load_profile("droptower-scpi", "scpi")[0]
    assert isinstance(profile, ScpiProfile)
    assert profile.status
    assert profile.header
    assert profile.gate
    assert profile.gate.query
    assert profile.interlock
    asked = [profile.identity, profile.status.query, profile.header.query, profile.gate.query, profile.interlock.query]
    asked += [profile.errors or "", *(s.query for s in profile.settings.values())]
    with Emulator() as emulator:
        wire = Wire(emulator.endpoints["scpi_tcp"], 115_200, 2.0)
        found: dict[str, bytes] = {}
        for query in asked:
            wire.write(f"{query}\n".encode())
            found[query] = wire.read_line()
        wire.close()
    return found


def garbled(line: bytes, rng: random.Random) -> bytes:
    """One or two bytes lost, flipped, doubled or put in; the line's end stays."""
    body = bytearray(line)
    for _ in range(rng.randint(1, 2)):
        at = rng.randrange(len(body) + 1)
        kind = rng.choice(("lose", "flip", "insert", "cut", "twice"))
        if kind == "insert":
            body.insert(at, rng.choice(b"0123456789,.-+eEnaif#\x00\xff"))
        elif kind == "cut":
            del body[at:]
        elif kind == "twice":
            body += bytes(body)
        elif at < len(body):
            if kind == "lose":
                del body[at]
            else:
                body[at] ^= 1 << rng.randrange(8)
    return bytes(body).replace(b"\n", b"")


@pytest.mark.parametrize("asked", ["identity", "status", "settings", "header", "gate", "interlock", "arm"])
def test_a_garbled_reply_raises_nothing_but_what_acquisition_knows(replies: dict[str, bytes], asked: str):
    rng = random.Random(asked)
    known = 0

    class Garbler(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            for query in self.rfile:
                reply = replies.get(query.strip().decode())
                if reply is not None:
                    self.wfile.write(garbled(reply, rng) + b"\n")

    profile = load_profile("droptower-scpi", "scpi")[0]
    assert isinstance(profile, ScpiProfile)
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Garbler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        device = ScpiDevice(f"socket://127.0.0.1:{server.server_address[1]}", 115_200, profile, 2)
        for _ in range(TRIES):
            try:
                getattr(device, asked)()
            except NoReply:
                raise
            except DaqError:
                known += 1
        device.close()
        server.shutdown()
    assert known, "some are told apart"
