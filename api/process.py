"""Acquisition and emulator as processes of their own, started by command and followed by what they print."""

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from daq.errors import DaqError

Event = dict[str, Any]
ENDS = ("done", "failed")
"""Events that an acquisition ends with."""


class ProcessError(DaqError):
    """A process that was started did not do what it is for."""


class Acquisition:
    """A running `python -m daq`, in a session of its own: it outlives whoever started it.

    `events` holds what it has said so far, `ahead` before the rest; iterating follows it to its end, from the first
    event on. `at_window` makes an event of the contact window, once that has been read.
    """

    def __init__(
        self,
        do: str,
        rig: Path,
        data: Path | None,
        test: Path | None = None,
        series: str | None = None,
        give_up: bool = False,
        first: tuple[int, int] | None = None,
        spare: Path | None = None,
        again: bool = False,
        at_window: Callable[[Event], Event] | None = None,
        more: list[str] | None = None,
        ahead: list[Event] | None = None,
    ) -> None:
        command = [sys.executable, "-m", "daq", do, "--rig", str(rig)]
        command += ["--data", str(data)] if data is not None else []
        command += ["--test", str(test)] if test is not None else []
        command += [f"--series={series}"] if series is not None else []
        command += ["--give-up"] if give_up else []
        command += ["--first", f"{first[0]}:{first[1]}"] if first is not None else []
        command += ["--spare", str(spare)] if spare is not None else []
        command += ["--again"] if again else []
        command += more or []
        self._at_window = at_window
        self.events: list[Event] = list(ahead or [])
        self._news = threading.Condition()
        self._ended = False
        self._process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
        )
        self._follower = threading.Thread(target=self._follow, daemon=True)
        self._follower.start()

    def _follow(self) -> None:
        out, err = self._process.stdout, self._process.stderr
        assert out is not None, "it was asked for as a pipe"
        assert err is not None, "it was asked for as a pipe"
        words: list[bytes] = []
        reader = threading.Thread(target=lambda: words.append(err.read()), daemon=True)
        reader.start()
        for line in out:
            event = json.loads(line)
            self._add(event)
            if event["event"] == "window" and self._at_window is not None:
                self._look(event, self._at_window)
        code = self._process.wait()
        reader.join()
        out.close()
        err.close()
        if not self.events or self.events[-1]["event"] not in ENDS:
            last = b"".join(words).decode(errors="replace").strip().rpartition("\n")[2]
            text = f"acquisition ended with code {code}: {last or 'no word'}; what the recorder holds it still holds"
            self._add({"event": "failed", "outcome": "died", "text": text})
        with self._news:
            self._ended = True
            self._news.notify_all()

    def _look(self, event: Event, at_window: Callable[[Event], Event]) -> None:
        """What the contact shows, as an event of its own. It may fail: the run's own analysis comes later."""
        try:
            self._add(at_window(event))
        except Exception as e:  # whatever it is, the drop goes on
            self._add({"event": "no-preliminary", "text": f"the contact could not be looked at yet: {e}"})

    def _add(self, event: Event) -> None:
        with self._news:
            self.events.append(event)
            self._news.notify_all()

    def __iter__(self) -> Iterator[Event]:
        seen = 0
        while True:
            with self._news:
                while len(self.events) <= seen and not self._ended:
                    self._news.wait()
                fresh = self.events[seen:]
            if not fresh:
                return
            seen += len(fresh)
            yield from fresh

    @property
    def done(self) -> bool:
        return self._ended

    @property
    def said_its_last(self) -> bool:
        """Whether the event that ends every acquisition has come, though its process may still be there."""
        return bool(self.events) and self.events[-1]["event"] in ENDS

    def abort(self) -> None:
        """Disarm. A record whose trigger has come is read and saved all the same."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)

    def result(self) -> Event:
        """Follow to the end; the last event, `done` or `failed`."""
        self._follower.join()
        return self.events[-1]


class Emulator:
    """A running `python -m sim_device`; `endpoints` as it prints them. Ends with the block it is entered for."""

    def __init__(self, *arguments: str, quiet: bool = True) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "sim_device", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL if quiet else None,
            text=True,
        )
        assert self._process.stdout is not None, "it was asked for as a pipe"
        line = self._process.stdout.readline()
        if not line:
            raise ProcessError(f"the emulator did not start (exit {self._process.wait()})")
        self.endpoints: dict[str, str] = json.loads(line)

    def __enter__(self) -> "Emulator":
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.terminate()
        self._process.wait()
        assert self._process.stdout is not None, "it was asked for as a pipe"
        self._process.stdout.close()


def become_emulator(arguments: list[str]) -> None:
    """Turn this process into the emulator."""
    os.execv(sys.executable, [sys.executable, "-m", "sim_device", *arguments])
