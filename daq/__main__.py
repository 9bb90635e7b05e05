"""`python -m daq acquire|recover|check`: acquisition as a process of its own, its events as JSON lines on stdout.

SIGINT and SIGTERM disarm a recorder that waits for its trigger; a record that has come is read and saved first.
Exit 0: a run is saved; 1: the last event, `failed`, says why not.
"""

import argparse
import contextlib
import json
import signal
import sys
import traceback
from pathlib import Path
from types import FrameType
from typing import Any

from daq.acquisition import acquire
from daq.checking import check
from daq.errors import AcquisitionError, DaqError, DeviceError
from daq.lock import RigLock
from daq.log import Log
from daq.recovery import recover
from daq.rig import Rig
from daq.rig_file import load_rig
from daq.run import now
from daq.store import Store
from daq.tap import tap, tare
from daq.test_file import load_test

_stop = False


def _ask_to_stop(number: int, frame: FrameType | None) -> None:
    global _stop
    _stop = True


_log: Log | None = None


def _emit(event: str, **facts: Any) -> None:
    line = {"event": event, "at": now(), **facts}
    if _log is not None:
        _log(line)
    with contextlib.suppress(BrokenPipeError):  # who followed has gone; the drop goes on
        print(json.dumps(line), flush=True)


def _span(text: str) -> tuple[int, int]:
    start, _, stop = text.partition(":")
    if not (start.isdigit() and stop.isdigit() and int(start) < int(stop)):
        raise argparse.ArgumentTypeError(f"{text!r} is not START:STOP with START below STOP")
    return int(start), int(stop)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m daq", description=__doc__)
    parser.add_argument("do", choices=["acquire", "recover", "check"])
    parser.add_argument("--rig", type=Path, required=True)
    parser.add_argument("--test", type=Path, help="needed to acquire")
    parser.add_argument("--data", type=Path, help="needed to acquire and recover")
    parser.add_argument("--series")
    parser.add_argument(
        "--give-up", action="store_true", help="release a record of which a partial run is all there is"
    )
    parser.add_argument("--tap", action="store_true", help="check: wait for a tap on the tup")
    parser.add_argument("--tare", action="store_true", help="check: keep the zero level in --data")
    parser.add_argument("--again", action="store_true", help="hit a specimen that was hit before")
    parser.add_argument("--spare", type=Path, help="where a run goes that --data does not take")
    parser.add_argument("--first", type=_span, metavar="START:STOP", help="samples that are read before the rest")
    given = parser.parse_args()
    if given.do == "acquire" and given.test is None:
        parser.error("acquire needs --test")
    if given.tare and given.data is None:
        parser.error("--tare needs --data: the zero level is kept there")
    if given.do != "check" and given.data is None:
        parser.error(f"{given.do} needs --data")
    return given


def _run(given: argparse.Namespace) -> str | None:
    global _log
    file, rig_text = load_rig(given.rig)
    test = load_test(given.test) if given.test is not None else None
    if given.data is not None:
        specimen = test[0].specimen.id if test is not None else None
        _log = Log(given.data, do=given.do, port=file.recorder.port, specimen=specimen)
    data: Path | None = given.data
    with RigLock(file, given.do), Rig(file, data) as rig:
        if given.do == "check":
            keep = data if given.tare else None
            good = tap(rig, _emit) if given.tap else check(rig, _emit) if keep is None else tare(rig, keep, _emit)
            if not good:
                raise DeviceError("the rig is not ready: see the checks")
            return None
        assert data is not None, "the arguments were checked"
        store = Store(data)
        if given.do == "recover":
            return recover(rig, rig_text, test, store, _emit, given.give_up)
        assert test is not None, "the arguments were checked"
        spare = None if given.spare is None else Store(given.spare)
        texts = (rig_text, test[1])
        return acquire(rig, test[0], texts, store, given.series, _emit, lambda: _stop, given.first, spare, given.again)


def main() -> int:
    given = _arguments()
    signal.signal(signal.SIGINT, _ask_to_stop)
    signal.signal(signal.SIGTERM, _ask_to_stop)
    try:
        run = _run(given)
    except DaqError as e:
        outcome = e.outcome if isinstance(e, AcquisitionError) else type(e).__name__
        _emit("failed", outcome=outcome, text=str(e))
        return 1
    except (
        Exception
    ) as e:  # an error of ours: the operator is told what is safe, and the log of the folder has the rest
        text = (
            f"an error inside droptower ({type(e).__name__}: {e}); a captured record is still held: `recover` reads it"
        )
        if _log is not None:
            _log({"event": "trace", "at": now(), "text": traceback.format_exc()})
        _emit("failed", outcome="internal", text=text)
        return 1
    _emit("done", run=run)
    return 0


if __name__ == "__main__":
    sys.exit(main())
