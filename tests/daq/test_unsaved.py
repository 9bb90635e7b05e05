"""A disk that fails costs no record: the recorder keeps its samples, and a second folder takes the run at once."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from emulator import Emulator
from records import need
from rigs import Daq, write_rig, write_test

from daq.recorder import crc32
from daq.store import Store


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    if os.geteuid() != 0:
        pytest.skip("only root can mount a small disk")
    disk = tmp_path / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", disk], capture_output=True).returncode:
        pytest.skip("no small disk can be mounted here")
    yield disk
    subprocess.run(["umount", disk], check=True)


def test_a_second_folder_takes_what_a_full_disk_does_not(emulator: Emulator, tmp_path: Path, small_disk: Path) -> None:
    emulator.do("height", v0=1.39)
    rig, spare = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi"), tmp_path / "spare"
    daq = Daq("acquire", rig, small_disk, "--test", str(write_test(tmp_path)), "--spare", str(spare))
    daq.until("armed")
    (small_disk / "filler").write_bytes(b"0" * (os.statvfs(small_disk).f_bavail * 4096))
    emulator.do("release")
    end = daq.end()
    daq.close()
    names = [e["event"] for e in daq.events]
    assert end["event"] == "done", end
    assert names.index("spare") < names.index("saved") < names.index("released")
    assert next(e for e in daq.events if e["event"] == "saved")["folder"] == str(spare)
    run = Store(spare).read(end["run"])
    assert [crc32(c.samples) for c in run.channels] == emulator.do("status")["captured"]["crcs"]
    assert Store(small_disk).runs() == []
    assert emulator.do("status")["held"] == 0


def acquire_with(inject: str, emulator: Emulator, folder: Path, data: Path) -> tuple[dict[str, Any], str]:
    """An acquisition in which a system call on run files fails; its last event, and the trace of its calls."""
    import json

    trace = folder / "trace"
    rig = write_rig(folder, emulator.endpoints["scpi_tcp"], "scpi")
    command = [sys.executable, "-m", "daq", "acquire", "--rig", rig, "--test", write_test(folder), "--data", data]
    traced = [need("strace"), "-f", "-y", "-s", "200", "-o", trace, "-e", "trace=fsync,sendto,rename", "-e", inject]
    process = subprocess.Popen(
        [*traced, *command, "--again"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    end: dict[str, Any] = {}
    for line in process.stdout:
        end = json.loads(line)
        if end["event"] == "armed":
            emulator.do("release")
    _, err = process.communicate()
    if "PTRACE" in err:
        pytest.skip(f"system calls cannot be traced here: {err.strip()}")
    return end, trace.read_text(errors="replace")


def test_a_sync_that_fails_leaves_the_run_unsaved_and_is_not_tried_again(emulator: Emulator, tmp_path: Path) -> None:
    emulator.do("height", v0=1.39)
    data = tmp_path / "data"
    # The syncs before that of the run file: the probe of the folder, the history, the note of what is armed.
    end, trace = acquire_with("inject=fsync:error=EIO:when=4+", emulator, tmp_path, data)
    assert (end["event"], end["outcome"]) == ("failed", "unsaved"), trace
    assert "recover" in end["text"]
    assert "--spare" in end["text"]
    failed = [line for line in trace.splitlines() if "EIO" in line]
    assert sum("raw.h5" in line for line in failed) == 1, "an fsync that failed is not tried again"
    assert "TRAC:ACK" not in trace[trace.index(failed[0]) :], "the recorder is not released"
    assert Store(data).runs() == []
    assert emulator.do("status")["held"]
    refused = Daq("acquire", tmp_path / "rig.toml", data, "--test", str(tmp_path / "test.toml"))
    assert refused.end()["outcome"] == "held"
    refused.close()
    again = Daq("recover", tmp_path / "rig.toml", data)
    run = again.end()["run"]
    again.close()
    kept = Store(data).read(run)
    assert [crc32(c.samples) for c in kept.channels] == emulator.do("status")["captured"]["crcs"]


def test_a_rename_that_fails_leaves_no_half_run(emulator: Emulator, tmp_path: Path) -> None:
    emulator.do("height", v0=1.39)
    end, _ = acquire_with("inject=rename:error=EIO:when=3+", emulator, tmp_path, tmp_path / "data")
    assert end["outcome"] == "unsaved"
    assert not list((tmp_path / "data" / "runs").iterdir())
    assert emulator.do("status")["held"]
