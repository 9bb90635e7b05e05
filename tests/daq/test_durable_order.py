"""The recorder is let go only after the run is on disk: shown by the system calls of a real acquisition."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from emulator import Emulator
from records import need
from rigs import write_rig, write_test

STEPS = [
    r'mkdir(at)?\(.*"[^"]*/runs/\.part-',
    r"fsync\(\d+<[^>]*/runs/\.part-[^>]*/raw\.h5>",
    r"fsync\(\d+<[^>]*/runs/\.part-[^>]*/raw\.sha256>",
    r"fsync\(\d+<[^>]*/runs/\.part-[^>/]*>",
    r'rename(at2?)?\(.*"[^"]*/runs/\.part-[^"]*"',
    r"fsync\(\d+<[^>]*/data/runs>",
    r"read\(\d+<[^>]*/runs/2[^>]*/raw\.h5>",
    r"sendto\(.*TRAC:ACK",
]
"""What has to be seen, in this order."""


def test_write_sync_rename_sync_read_back_and_only_then_acknowledge(emulator: Emulator, tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    calls = "mkdir,mkdirat,openat,write,fsync,rename,renameat,renameat2,read,pread64,sendto"
    rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi")
    command = [sys.executable, "-m", "daq", "acquire", "--rig", rig, "--test", write_test(tmp_path)]
    process = subprocess.Popen(
        [need("strace"), "-f", "-y", "-s", "64", "-e", f"trace={calls}", "-o", trace, *command,
         "--data", tmp_path / "data"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout is not None
    for line in process.stdout:
        if '"armed"' in line:
            emulator.do("release")
    _, err = process.communicate()
    if "PTRACE" in err:
        pytest.skip(f"system calls cannot be traced here: {err.strip()}")
    assert process.returncode == 0, err
    lines = trace.read_text(errors="replace").splitlines()
    at = 0
    for step in STEPS:
        found = next((i for i in range(at, len(lines)) if re.search(step, lines[i])), None)
        assert found is not None, f"{step} does not come after the steps before it"
        at = found + 1
    # A quiet record is taken and let go as well, before arming.
    armed = next(i for i, line in enumerate(lines) if re.search(r"write\(1.*armed", line))
    acknowledged = [i for i, line in enumerate(lines) if "TRAC:ACK" in line and i > armed]
    assert len(acknowledged) == 1, "an acknowledgement is sent once"
    assert not any(re.search(r"(write|fsync)\(\d+<[^>]*raw\.h5>", line) for line in lines[acknowledged[0] :])
