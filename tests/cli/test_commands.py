"""The command line as outside scripts use it: JSON alone on stdout, one message on stderr, exit codes."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

DROPTOWER = Path(sys.executable).with_name("droptower")
WriteCsv = Callable[..., Path]


def run(*arguments: object, code: int = 0) -> tuple[list[dict[str, Any]], str]:
    """JSON lines of stdout and the text of stderr; no traceback, no half-line."""
    done = subprocess.run([DROPTOWER, *map(str, arguments)], capture_output=True, text=True)
    assert "Traceback" not in done.stderr, done.stderr
    assert done.returncode == code, f"exit {done.returncode}: {done.stdout} {done.stderr}"
    return [json.loads(line) for line in done.stdout.splitlines() if "--json" in arguments], done.stderr


@pytest.fixture
def imported(write_csv: WriteCsv, cr39: Path, tmp_path: Path) -> tuple[str, Path]:
    data = tmp_path / "data"
    lines, _ = run("import", write_csv(), "--test", cr39, "--data", data, "--series", "s", "--json")
    return lines[0]["run"], data


def test_the_contract_holds_as_an_outside_script_checks_it(shared: Path) -> None:
    done = subprocess.run([shared / "contract_check.py", DROPTOWER], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_a_bad_file_stops_no_other(write_csv: WriteCsv, cr39: Path, tmp_path: Path) -> None:
    bad = write_csv("bad.csv", change=lambda lines: lines[:3000] + lines[3001:])
    files = [write_csv("a.csv"), bad, tmp_path / "none.csv", write_csv("b.csv")]
    lines, err = run("import", *files, "--test", cr39, "--data", tmp_path / "data", "--json", code=1)
    assert [sorted(line) for line in lines] == [["file", "run"], ["error", "file"], ["error", "file"], ["file", "run"]]
    assert "gap of 1 samples" in err
    assert "no such file" in err
    assert len(list((tmp_path / "data" / "runs").iterdir())) == 2


def test_options_stand_over_the_table_and_the_table_over_the_test_file(
    write_csv: WriteCsv, cr39: Path, tmp_path: Path
) -> None:
    table = tmp_path / "drops.csv"
    table.write_text("file,v0,u_v0\ndrop.csv,3.0,0.02\n")
    for options, v0 in (([], 3.0), (["--v0", "4.0"], 4.0)):
        data = tmp_path / f"data-{v0}"
        lines, _ = run("import", write_csv(), "--test", cr39, "--table", table, *options, "--data", data, "--json")
        answers, _ = run("analyze", lines[0]["run"], "--data", data, "--json")
        assert answers[0]["findings"]["v0"]["value"] == v0
        assert answers[0]["findings"]["v0"]["u"] == pytest.approx(0.02, rel=0.01)


def test_an_answer_is_kept_once_beside_its_run(imported: tuple[str, Path]) -> None:
    name, data = imported
    first, _ = run("analyze", name, "--data", data, "--json")
    again, _ = run("analyze", "--all", "--data", data, "--json")
    assert first == again
    assert [p.name for p in (data / "runs" / name).glob("analysis-*")] == ["analysis-0001.json"]
    kept = json.loads((data / "runs" / name / "analysis-0001.json").read_text())
    assert kept["raw_sha256"] == (data / "runs" / name / "raw.sha256").read_text().split()[0]


def test_runs_that_exist_are_answered_beside_one_that_does_not(imported: tuple[str, Path]) -> None:
    name, data = imported
    lines, err = run("analyze", "20260101T000000Z-abcdef", name, "--data", data, "--json", code=1)
    assert [line["run"] for line in lines] == [name]
    assert "no run '20260101T000000Z-abcdef'" in err


def test_export_writes_every_sample_and_names_what_it_cannot_write(imported: tuple[str, Path], tmp_path: Path) -> None:
    name, data = imported
    run("export", name, "--data", data, "-o", tmp_path / "out.csv")
    assert (tmp_path / "out.csv").read_text().splitlines()[0] == "time_s,force_N"
    assert (tmp_path / "out.csv").read_text().count("\n") == 6001
    run("export", name, "--data", data, "-o", tmp_path / "out.h5")
    assert (tmp_path / "out.h5").stat().st_size > 10_000
    _, err = run("export", name, "--data", data, "-o", tmp_path / "none" / "out.csv", code=1)
    assert "cannot be written" in err
    run("export", name, "--data", data, "-o", tmp_path / "out.xls", code=2)


def test_verify_tells_a_damaged_run(imported: tuple[str, Path]) -> None:
    name, data = imported
    assert run("verify", "--data", data, "--json")[0][0]["ok"] is True
    raw = data / "runs" / name / "raw.h5"
    raw.chmod(0o644)
    raw.write_bytes(raw.read_bytes()[:-10])
    lines, err = run("verify", "--data", data, "--json", code=1)
    assert lines[0]["ok"] is False
    assert f"{name}: raw.h5 has SHA-256" in err


def test_wrong_usage_is_exit_2(cr39: Path, tmp_path: Path) -> None:
    run("import", "--test", cr39, "--data", tmp_path, code=2)
    run("analyze", "--data", tmp_path, code=2)
    run("analyze", "--all", "some-run", "--data", tmp_path, code=2)
    run("nonsense", code=2)


@pytest.mark.parametrize("command", [["analyze", "--all"], ["verify"]])
def test_a_data_folder_that_is_not_there_is_told(command: list[str], tmp_path: Path) -> None:
    _, err = run(*command, "--data", tmp_path / "none", code=1)
    assert f"no data folder {tmp_path / 'none'}" in err


def test_a_data_folder_that_cannot_be_written_is_told(write_csv: WriteCsv, cr39: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    _, err = run("import", write_csv(), "--test", cr39, "--data", tmp_path / "file", "--json", code=1)
    assert "could not be written" in err


@pytest.mark.parametrize("command", ["acquire", "recover", "serve"])
def test_a_bad_rig_file_is_told_with_its_line(command: str, cr39: Path, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text('[recorder]\ndriver = "scpi"\nprot = "/dev/ttyS0"\n')
    test = ["--test", cr39] if command == "acquire" else []
    _, err = run(command, "--rig", rig, *test, "--data", tmp_path / "data", code=1)
    assert f"{rig}, line 3: [recorder] has no key 'prot'; did you mean 'port'?" in err


def test_help_and_import_load_nothing_heavy() -> None:
    heavy = ("numpy", "scipy", "h5py", "fastapi", "plotly", "numba", "matplotlib")
    code = f"import sys, api.cli; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
