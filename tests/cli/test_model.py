"""`droptower model`: answers as the contract says, draws, and says what does not fit."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

DROPTOWER = Path(sys.executable).with_name("droptower")
DROP = ["--mass-kg", "0.503", "--v0", "1.39", "--tip-radius-mm", "6.35", "--nu", "0.30", "--E-GPa", "3.30"]
PLATE = ["--thickness-mm", "4.6", "--support-radius-mm", "30"]


def run(*arguments: str | Path) -> "subprocess.CompletedProcess[str]":
    done = subprocess.run([DROPTOWER, "model", *arguments], capture_output=True, text=True)
    assert "Traceback" not in done.stderr
    return done


def test_it_answers_in_one_line_of_json() -> None:
    done = run("flexed", *DROP, *PLATE, "--Ci", "8000", "--Cd", "10", "--json")
    assert done.returncode == 0
    (line,) = done.stdout.splitlines()
    answer = json.loads(line)
    assert answer["fit"] is None
    assert answer["findings"]["F_M"]["value"] == pytest.approx(711.512, abs=1e-3)
    assert answer["findings"]["F_M"]["u"] is None, "exact for the model"
    assert answer["findings"]["mark_diameter"]["unit"] == "m"


@pytest.mark.parametrize("kind", ["conservative", "parallel", "series"])
def test_the_models_without_a_plate(kind: str) -> None:
    damper = [] if kind == "conservative" else ["--C", "100" if kind == "parallel" else "8000"]
    done = run(kind, *DROP, *damper)
    assert done.returncode == 0
    assert "F_M" in done.stdout


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_it_draws(tmp_path: Path, suffix: str) -> None:
    picture = tmp_path / f"drop.{suffix}"
    assert run("flexed", *DROP, *PLATE, "--Ci", "8000", "--plot", picture).returncode == 0
    head = picture.read_bytes()[:200]
    assert head.startswith(b"\x89PNG") if suffix == "png" else b"<svg" in picture.read_bytes()[:2000]


@pytest.mark.parametrize(
    ("arguments", "words", "code"),
    [
        (["flexed", *DROP], ["--thickness-mm"], 2),
        (["series", *DROP, *PLATE], ["series has no plate"], 2),
        (["conservative", *DROP, "--C", "3"], ["--C"], 2),
        (["flexed", *DROP, *PLATE, "--plot", "drop.gif"], [".png"], 2),
        (["flexed", *DROP, "--thickness-mm", "4"], ["belong together"], 2),
        (["spring", *DROP], ["conservative"], 2),
        (["conservative", *DROP, "--nu", "0.5"], ["--nu"], 2),
        (["conservative", *DROP, "--v0", "0"], ["v0", "above 0"], 1),
        (["conservative", *DROP, "--mass-kg", "-1"], ["mass", "above 0"], 1),
        (["conservative", *DROP, "--plot", "/no/such/folder/drop.png"], ["/no/such/folder"], 1),
    ],
)
def test_what_does_not_fit_is_told(arguments: list[str], words: list[str], code: int) -> None:
    done = run(*arguments)
    assert done.returncode == code, done.stderr
    assert all(word in done.stderr for word in words), done.stderr


@pytest.mark.parametrize("command", [["--help"], ["verify", "--data", "."], ["export", "--help"], ["import", "--help"]])
def test_other_commands_load_no_figures_and_no_solver(command: list[str]) -> None:
    code = (
        "import sys; sys.argv = ['droptower', *sys.argv[1:]]\n"
        "from api.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = ('matplotlib', 'analysis.contact_solver', 'scipy.optimize')\n"
        "print([m for m in heavy if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code, *command], capture_output=True, text=True)
    assert done.stderr.splitlines()[-1] == "[]", done.stderr


def test_a_compliant_tip_and_the_dashpot_of_hunt_and_crossley() -> None:
    def found(symbol: str, kind: str, *more: str) -> float:
        return json.loads(run(kind, *DROP, "--json", *more).stdout)["findings"][symbol]["value"]

    assert 0.985 < found("F_M", "conservative", "--tip-E-GPa", "210") / found("F_M", "conservative") < 0.999
    assert abs(found("eps_exact", "parallel", "--restitution", "0.9") - 0.9) < 0.02
    assert run("series", *DROP, "--restitution", "0.9").returncode == 2
    assert run("parallel", *DROP, "--restitution", "1.9").returncode == 2
