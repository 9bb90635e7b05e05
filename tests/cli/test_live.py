"""The commands on a rig, from the command line to the answer."""

import json
import signal
import subprocess
import sys
from pathlib import Path

from emulator import Emulator, until
from rigs import write_rig, write_test

DROPTOWER = Path(sys.executable).with_name("droptower")


def test_acquire_follows_the_drop_and_answers(tmp_path: Path) -> None:
    with Emulator("--seed", "3") as emulator:
        rig = write_rig(tmp_path, emulator.endpoints["scpi_pty"], "scpi")
        command = [DROPTOWER, "acquire", "--rig", rig, "--test", write_test(tmp_path), "--data", tmp_path / "data"]
        process = subprocess.Popen([*command, "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert process.stdout is not None
        assert process.stderr is not None
        events = []
        for line in process.stderr:
            events.append(json.loads(line))
            if events[-1]["event"] == "armed":
                emulator.do("height", v0=1.39)
                truth = emulator.do("release")["truth"]
        out = process.stdout.read().splitlines()
        assert process.wait() == 0
        process.stdout.close()
        process.stderr.close()
    assert [e["event"] for e in events if e["event"] in ("armed", "saved", "released", "done")] == [
        "armed", "saved", "released", "done",
    ]  # fmt: skip
    (answer,) = map(json.loads, out)
    assert answer["run"] == events[-1]["run"]
    found = answer["findings"]
    for symbol in ("F_M", "alpha_M", "t_c", "eps_exact", "v0", "v1"):
        assert abs(found[symbol]["value"] - truth[symbol]) < 5 * found[symbol]["u"], symbol


def test_ctrl_c_disarms(tmp_path: Path) -> None:
    with Emulator() as emulator:
        rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi")
        command = [DROPTOWER, "acquire", "--rig", rig, "--test", write_test(tmp_path), "--data", tmp_path / "data"]
        process = subprocess.Popen([*command, "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert process.stderr is not None
        for line in process.stderr:
            if json.loads(line)["event"] == "armed":
                break
        process.send_signal(signal.SIGINT)
        _, err = process.communicate()
        assert process.returncode == 1
        assert "disarmed as asked" in err
        assert "Traceback" not in err
        until(lambda: "idle" in json.dumps(emulator.do("status")["state"]))


def test_sim_prints_its_endpoints_and_ends_quietly() -> None:
    process = subprocess.Popen([DROPTOWER, "sim"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    endpoints = json.loads(process.stdout.readline())
    assert set(endpoints) >= {"scpi_pty", "scpi_tcp", "modbus_rtu", "modbus_tcp", "control"}
    process.terminate()
    out, err = process.communicate()
    assert (process.returncode, out) == (0, "")
    assert "Traceback" not in err


def test_the_demo_agrees_with_what_the_emulator_was_set_to(tmp_path: Path) -> None:
    done = subprocess.run([DROPTOWER, "demo", "--once", "--data", tmp_path / "d"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "All 24 findings agree with the set values" in done.stdout
    for published in ("709", "1045", "2.61"):
        assert published in done.stdout
    assert len(list((tmp_path / "d" / "runs").iterdir())) == 6
