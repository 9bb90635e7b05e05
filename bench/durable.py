"""From the last byte to a run that is safe, and the memory that it takes: two rows of `make bench`.

    .venv/bin/python bench/durable.py [--tries 5]

The floor is what storing safely cannot do without, each part timed bare and alone: CRC-32 of the samples, compression
by HDF5, SHA-256, write and sync, reading back past the cache, SHA-256 and CRC-32 again. The memory is that of a whole
`python -m daq acquire` over SCPI, at its greatest, above the same process while it waits for the trigger.
"""

import argparse
import hashlib
import os
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import TypeVar

import h5py
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from emulator import Emulator
from rigs import Daq, write_rig, write_test

from daq.rig_file import Channel
from daq.run import ChannelData, RunData, new_run_id
from daq.run_file import CHUNK
from daq.store import Store
from daq.test_file import load_test

T = TypeVar("T")


def timed(spent: list[float], call: Callable[[], T]) -> T:
    """The result of a call, its time added to the list."""
    started = time.perf_counter()
    result = call()
    spent.append(time.perf_counter() - started)
    return result


def compressed(samples: np.ndarray) -> bytes:
    """One data set as the run file has it, and nothing else."""
    with h5py.File.in_memory() as file:
        file.create_dataset(
            "data", data=samples, chunks=(CHUNK,), compression="gzip", compression_opts=1, shuffle=True, fletcher32=True
        )
        file.flush()
        return bytes(file.id.get_file_image())


def synced(path: Path, content: bytes) -> None:
    """Written, synced, its folder synced."""
    with path.open("wb", buffering=0) as file:
        file.write(content)
        os.fsync(file.fileno())
    folder = os.open(path.parent, os.O_RDONLY)
    os.fsync(folder)
    os.close(folder)


def read_back(path: Path) -> tuple[bytes, np.ndarray]:
    """Bytes from the disk, and the samples in them."""
    with path.open("rb") as file:
        os.posix_fadvise(file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
        content = file.read()
    with h5py.File(path) as file:
        return content, file["data"][()]


def floor(samples: np.ndarray, folder: Path) -> float:
    """Seconds of the parts, each alone."""
    spent: list[float] = []
    path = folder / "floor.h5"
    timed(spent, lambda: zlib.crc32(samples.data))
    content = timed(spent, lambda: compressed(samples))
    timed(spent, lambda: hashlib.sha256(content).hexdigest())
    timed(spent, lambda: synced(path, content))
    content, again = timed(spent, lambda: read_back(path))
    timed(spent, lambda: hashlib.sha256(content).hexdigest())
    timed(spent, lambda: zlib.crc32(again.data))
    path.unlink()
    return sum(spent)


def published(run: RunData, store: Store) -> float:
    """Seconds of our way: published, synced, read back and checked."""
    started = time.perf_counter()
    store.publish(run)
    return time.perf_counter() - started


def durable(tries: int) -> None:
    """The first row."""
    rng = np.random.default_rng(1)
    t = np.arange(1_000_000) * 2e-6
    pulse = 2000 * np.sin(np.pi * np.clip((t - 1e-3) / 3e-3, 0, 1))
    samples = np.rint(pulse + rng.normal(0, 8, t.size)).astype(np.int16)
    times: tuple[list[float], list[float]] = ([], [])
    with tempfile.TemporaryDirectory(dir=Path.cwd()) as name:
        folder = Path(name)
        test, text = load_test(write_test(folder))
        store = Store(folder / "data")
        channel = ChannelData(Channel(counts_to_unit=0.39), samples, 14)
        for _ in range(tries):
            times[0].append(floor(samples, folder))
            run = RunData(
                run=new_run_id(), series=None, started="2026-01-01T00:00:00+00:00", source="acquired", dt=2e-6,
                channels=[channel], test=test, test_text=text, g=9.80665, g_source="standard gravity",
            )  # fmt: skip
            times[1].append(published(run, store))
    bare, ours = median(times[0]), median(times[1])
    what = "last byte to durable, 1,000,000 samples, against its parts"
    print(f"| {what} | {bare:.4f} | {ours:.4f} | {ours / bare:.2f} | ≤ 1.3 |")


def resident(pid: int) -> int:
    """Bytes of memory that a process holds now."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def memory() -> None:
    """The second row."""
    samples, channels = 1_000_000, 4
    with tempfile.TemporaryDirectory() as name, Emulator() as emulator:
        folder = Path(name)
        emulator.do("recorder", channels=channels)
        # Noise that fills the range: nothing of it can be compressed.
        emulator.do("sensor", bits=16, noise_N=1500)
        emulator.do("second_sensor", bits=16, noise_N=1500)
        emulator.do("displacement", noise_mm=10)
        emulator.do("accelerometer", noise_m_s2=5000)
        rig = write_rig(folder, emulator.endpoints["scpi_tcp"], "scpi", samples)
        more = '[[recorder.channel]]\nname = "{}"\ncounts_to_unit = 0.1\n'
        rig.write_text(rig.read_text().replace("[gate]", "".join(more.format(n) for n in range(2, 5)) + "[gate]"))
        rig.write_text(rig.read_text().replace("trigger_level = 60", "trigger_level = 3199"))
        daq = Daq("acquire", rig, folder / "data", "--test", str(write_test(folder)))
        daq.until("armed")
        idle = resident(daq.process.pid)
        emulator.do("sensor", noise_N=1500, gain=10)
        emulator.do("release")
        greatest = idle
        for event in daq:
            if event["event"] == "saved":
                greatest = peak(daq.process.pid)
        assert daq.events[-1]["event"] == "done", daq.events[-1]
        daq.close()
        raw = 2 * samples * channels
        size = next((folder / "data" / "runs").iterdir()).joinpath("raw.h5").stat().st_size
    above = (greatest - idle) / raw
    words = (
        f"peak memory, {channels} × {samples:,} samples ({raw / 1e6:.0f} MB raw, file {size / 1e6:.1f} MB), above idle"
    )
    print(f"| {words} | {raw / 1e6:.1f} MB | {(greatest - idle) / 1e6:.1f} MB | {above:.2f} | ≤ 5 |")


def peak(pid: int) -> int:
    """Bytes of memory that a process ever held."""
    status = Path(f"/proc/{pid}/status").read_text()
    return 1024 * int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tries", type=int, default=5)
    given = parser.parse_args()
    print("| what | floor | ours | ratio | reach |\n|---|---|---|---|---|")
    durable(given.tries)
    memory()


if __name__ == "__main__":
    main()
