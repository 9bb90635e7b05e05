"""The commands on a rig, from the command line to the answer."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from emulator import Emulator, until
from playwright.sync_api import Browser
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


def _checked(rig: Path) -> tuple[int, dict[str, Any]]:
    done = subprocess.run([DROPTOWER, "check", rig, "--json"], capture_output=True, text=True)
    assert "Traceback" not in done.stderr
    return done.returncode, json.loads(done.stdout)


def test_check_looks_at_the_rig_without_a_drop(tmp_path: Path) -> None:
    with Emulator("--seed", "3", "--baud", "921600") as emulator:
        for wire in ("scpi_pty", "modbus_rtu", "modbus_tcp"):
            rig = write_rig(tmp_path, emulator.endpoints[wire], wire.partition("_")[0])
            rig.write_text(rig.read_text().replace("sample_rate_Hz", "baud = 921600\nsample_rate_Hz"))
            code, answer = _checked(rig)
            assert (code, answer["ok"]) == (0, True), answer
            rows = {row["name"]: row["text"] for row in answer["checks"]}
            assert "noise 3" in rows["noise"] or "noise 2.9" in rows["noise"], "the emulator's 3 N"
            assert "door closed" in rows["interlock"]
        # no record of the check is left that would stand in the way of a drop
        assert "idle" in json.dumps(emulator.do("status")["state"])


def test_check_tells_what_is_not_ready(tmp_path: Path) -> None:
    with Emulator("--seed", "3") as emulator:
        rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi")
        rig.write_text(rig.read_text().replace("trigger_level = 60", "trigger_level = 15"))
        emulator.do("door", open=True)
        code, answer = _checked(rig)
        bad = {row["name"]: row["text"] for row in answer["checks"] if not row["ok"]}
        assert (code, answer["ok"], sorted(bad)) == (1, False, ["interlock", "noise"])
        assert "door open" in bad["interlock"]
        assert "noise will trigger" in bad["noise"]


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


def test_the_demo_agrees_with_what_the_emulator_was_set_to(tmp_path: Path, browser: Browser) -> None:
    done = subprocess.run([DROPTOWER, "demo", "--once", "--data", tmp_path / "d"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "All 24 findings agree with the set values" in done.stdout
    assert "all hold the set value" in done.stdout
    for published in ("709", "1045", "2.61"):
        assert published in done.stdout
    assert "told rightly of 8" in done.stdout
    assert len(list((tmp_path / "d" / "runs").iterdir())) == 6 + 8
    page = browser.new_page()
    page.goto((tmp_path / "d" / "demo-report.html").as_uri())
    assert page.locator("h1").inner_text() == "demo CR-39 to failure"
    assert page.locator("svg").count() > 8
    assert page.evaluate("[...document.querySelectorAll('.wide')].every(d => d.scrollWidth <= d.clientWidth)")
    page.close()


def _asked(command: list[Any], answer: str) -> tuple[int, str]:
    """Run a command on a terminal, answer its question; its exit code and what it said."""
    terminal, end = os.openpty()
    process = subprocess.Popen(command, stdin=end, stdout=end, stderr=end, start_new_session=True)
    os.close(end)
    said = ""
    while True:
        try:
            said += os.read(terminal, 4096).decode()
        except OSError:
            break
        if "again? [y/N]" in said and answer:
            os.write(terminal, answer.encode())
            answer = ""
    os.close(terminal)
    return process.wait(), said


def test_a_specimen_that_was_hit_is_asked_about_on_a_terminal(tmp_path: Path) -> None:
    with Emulator("--seed", "3") as emulator:
        rig = write_rig(tmp_path, emulator.endpoints["scpi_tcp"], "scpi", wait_s=1.0)
        command = [DROPTOWER, "acquire", "--rig", rig, "--test", write_test(tmp_path), "--data", tmp_path / "data"]
        first = subprocess.Popen(
            [*command, "--json"], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        assert first.stderr is not None
        for line in first.stderr:
            if '"armed"' in line:
                emulator.do("height", v0=1.39)
                emulator.do("release")
        assert first.wait() == 0
        first.stderr.close()
        code, said = _asked(command, "n\n")
        assert code == 1
        assert "was hit before" in said
        assert "armed" not in said.lower()
        until(lambda: not emulator.do("status")["moving"])
        code, said = _asked(command, "y\n")
        assert "ARMED" in said
        assert "no trigger" in said
        refused = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL)
        assert refused.returncode == 1
        assert "--again" in refused.stderr


@pytest.mark.parametrize("screen", [":0", ""])
def test_the_report_is_opened_where_there_is_a_screen(tmp_path: Path, screen: str) -> None:
    browser, opened = tmp_path / "browser", tmp_path / "opened"
    browser.write_text(f'#!/bin/sh\necho "$1" > {opened}\n')
    browser.chmod(0o755)
    code = "import sys, pathlib; from api.commands.service import open_in_browser as o; o(pathlib.Path(sys.argv[1]))"
    kept = {k: v for k, v in os.environ.items() if k != "WAYLAND_DISPLAY"}
    environment = {**kept, "DISPLAY": screen, "BROWSER": str(browser)}
    subprocess.run([sys.executable, "-c", code, tmp_path / "demo-report.html"], check=True, env=environment)
    told = opened.read_text().strip() if opened.exists() else ""
    assert told == ((tmp_path / "demo-report.html").as_uri() if screen else "")
