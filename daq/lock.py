"""One holder of a rig at a time, across processes."""

import fcntl
import hashlib
import json
import os
import tempfile
import time
from pathlib import Path
from types import TracebackType

from daq.errors import RigBusy
from daq.rig_file import RigFile

GRACE_S = 0.3
"""Whoever only looks whether a rig is held holds it for an instant."""


def _locked(fd: int) -> bool:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


class RigLock:
    """Holds a rig while it is entered. The lock is the kernel's: it ends with the process, however that ends.

    Raises
    ------
    RigBusy : another process holds the rig; the message names it.
    """

    def __init__(self, rig: RigFile, doing: str) -> None:
        folder = Path(tempfile.gettempdir()) / "droptower-locks"
        folder.mkdir(mode=0o1777, exist_ok=True)
        name = hashlib.sha256(rig.recorder.port.encode()).hexdigest()[:16]
        self._path = folder / f"{name}.lock"
        self._port = rig.recorder.port
        self._doing = doing
        self._fd = -1

    def __enter__(self) -> "RigLock":
        fd = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        end = time.monotonic() + GRACE_S
        while not _locked(fd):
            if time.monotonic() > end:
                holder = os.read(fd, 500).decode(errors="replace").strip() or "a process that has not said its name"
                os.close(fd)
                raise RigBusy(f"the rig on {self._port} is held by {holder}; wait for it or stop it")
            time.sleep(GRACE_S / 10)
        os.ftruncate(fd, 0)
        os.pwrite(fd, f"process {os.getpid()} ({self._doing}, data {json.dumps(str(Path.cwd()))})".encode(), 0)
        self._fd = fd
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._fd)
