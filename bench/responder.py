"""A canned Modbus TCP responder in a process of its own: every read of input registers answered at once, in order.

It takes 16 requests at a time and knows nothing but function 04, so that what is measured against it is the client.
"""

import socket
import struct
import sys
from threading import Thread

VALUES = bytes(range(256)) * 2


def serve(link: socket.socket) -> None:
    """Answer one client until it leaves."""
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    buffer = bytearray()
    while data := link.recv(1 << 16):
        buffer += data
        replies: list[bytes] = []
        while len(buffer) >= 12:
            transaction, _, _, unit, function, _, count = struct.unpack_from(">HHHBBHH", buffer)
            head = struct.pack(">HHHBBB", transaction, 0, 3 + 2 * count, unit, function, 2 * count)
            replies.append(head + VALUES[: 2 * count])
            del buffer[:12]
        link.sendall(b"".join(replies))


def main() -> None:
    """Print the port and serve."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        print(server.getsockname()[1], flush=True)
        while True:
            Thread(target=serve, args=(server.accept()[0],), daemon=True).start()


if __name__ == "__main__":
    sys.exit(main())
