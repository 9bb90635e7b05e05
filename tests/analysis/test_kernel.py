"""The compiled kernel against the scipy solutions, the other solver, closed forms, and itself run as plain Python."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.contact_solver import solve
from analysis.fit_problem import kernel
from analysis.models import Kind, Model, contact_stiffness, plate_stiffness

Array = NDArray[np.float64]
R, NU, D, RING, M = 6.35e-3, 0.33, 4.6e-3, 30e-3, 0.503
CASES: dict[str, tuple[Kind, dict[str, float]]] = {
    "conservative": ("conservative", {}),
    "series": ("series", {"C_i": 5000}),
    "series, soft": ("series", {"C_i": 1500, "v0": 4.0}),
    "parallel": ("parallel", {"C": 100}),
    "parallel, strong": ("parallel", {"C": 600}),
    "flexed": ("flexed", {"C_i": 7000, "C_d": 8}),
    "flexed, C_d = 0": ("flexed", {"C_i": 7000}),
    "flexed, C_i = inf": ("flexed", {"C_d": 8}),
    "flexed, C_d tiny": ("flexed", {"C_i": 7000, "C_d": 0.01}),
    "flexed, C_d large": ("flexed", {"C_i": 4000, "C_d": 100, "v0": 4.0}),
    "flexed, K_d = inf": ("flexed", {"C_i": 7000, "K_d": math.inf}),
}


def constants(kind: Kind, C_i: float = math.inf, C_d: float = 0.0, C: float = 0.0, v0: float = 2.0, E: float = 3.3e9,
              K_d: float | None = None, g: float = 9.80665, m: float = M) -> tuple[Array, Model]:  # fmt: skip
    K = contact_stiffness(R, E, NU)
    if K_d is None:
        K_d = plate_stiffness(D, RING, E, NU) if kind == "flexed" else math.inf
    return np.array([m, g, 0.0, K, 1 / C_i, 1 / K_d, C_d / K_d, C, v0, 1.0, 0, 0, 0, 0]), Model(
        kind, m, K, K_d, C_i, C_d, C, g=g
    )


def force(c: Array, t: Array) -> Array:
    out = np.empty(t.size)
    kernel().contact(c, t, out, np.empty((0, 0)))
    return out


@pytest.mark.parametrize("name", CASES)
def test_force_is_that_of_the_reference_solver(name: str):
    kind, given = CASES[name]
    c, model = constants(kind, **given)
    reference = solve(model, float(c[8]))
    t = np.linspace(-1e-4, 1.02 * reference.end, 4001)
    expected = reference.force(t)
    assert np.abs(force(c, t) - expected).max() < 1e-6 * expected.max()
    end = kernel().contact(c, t, np.empty(t.size), np.empty((0, 0)))
    assert end == pytest.approx(reference.end, abs=1e-9)


@pytest.mark.parametrize("name", CASES)
def test_sensitivities_are_the_derivatives(name: str):
    kind, given = CASES[name]
    c, model = constants(kind, **given)
    length = solve(model, float(c[8])).end
    t = np.linspace(0.01, 0.97, 801) * length
    slopes = np.empty((5, t.size))
    kernel().contact(c, t, np.empty(t.size), slopes)

    def moved(column: int, by: float) -> Array:
        q = c.copy()
        if column == 0:
            q[3] *= math.exp(by)
            q[5] *= math.exp(-by)
            q[6] *= math.exp(-by)
        elif column == 1:
            q[4] += by
        elif column == 2:
            q[7 if kind == "parallel" else 6] += by * (1.0 if kind == "parallel" else q[5])
        elif column == 3:
            q[8] += by
        return force(q, t + by) if column == 4 else force(q, t)

    steps = {0: 1e-4, 1: 1e-8, 2: 1e-3, 3: 1e-4, 4: 1e-8}
    if kind == "parallel":
        del steps[1]
    if kind == "conservative" or (c[5] == 0 and kind != "parallel"):
        steps.pop(2)
    for column, h in steps.items():
        if column in (1, 2) and c[4 if column == 1 else (7 if kind == "parallel" else 6)] == 0:
            numeric = (-3 * moved(column, 0) + 4 * moved(column, h) - moved(column, 2 * h)) / (2 * h)
        else:
            numeric = (moved(column, h) - moved(column, -h)) / (2 * h)
        scale = np.abs(slopes[column]).max()
        assert np.abs(numeric - slopes[column]).max() < 3e-4 * scale, column


def test_the_conservative_peak_is_the_closed_form():
    c, model = constants("conservative", g=0.0)
    deepest = (1.25 * M * c[8] ** 2 / model.K_i) ** 0.4
    t = np.linspace(0, 2 * deepest / c[8] * 1.5, 40_001)
    assert force(c, t).max() == pytest.approx(model.K_i * deepest**1.5, rel=1e-7)


def test_plain_python_gives_the_same(tmp_path: Path):
    program = (
        "import json, numpy as np\n"
        "from analysis.kernel import contact\n"
        "import sys\n"
        "out = []\n"
        "for c in json.load(open(sys.argv[1])):\n"
        "    t, F, S = np.linspace(0, 4e-3, 60), np.empty(60), np.empty((5, 60))\n"
        "    out.append([contact(np.array(c), t, F, S), F.tolist(), S.tolist()])\n"
        "print(json.dumps(out))\n"
    )
    every = [constants(kind, **given)[0].tolist() for kind, given in CASES.values()]
    (tmp_path / "c.json").write_text(json.dumps(every))
    env = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    plain = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "c.json")], env=env, capture_output=True, check=True, text=True
    )
    t, F, S = np.linspace(0, 4e-3, 60), np.empty(60), np.empty((5, 60))
    for c, (end, forces, slopes) in zip(every, json.loads(plain.stdout), strict=True):
        assert kernel().contact(np.array(c), t, F, S) == pytest.approx(end, rel=1e-9)
        assert np.abs(F - forces).max() <= 1e-8 * np.abs(F).max()
        assert np.abs(S - np.array(slopes)).max(axis=1) == pytest.approx(np.zeros(5), abs=1e-6 * np.abs(S).max())


@pytest.mark.parametrize("command", [["--help"], ["verify", "--data"], ["import", "--help"], ["export", "--help"]])
def test_commands_without_a_fit_never_load_the_compiler(command: list[str], tmp_path: Path):
    program = (
        "import sys\n"
        "from api.cli import main\n"
        "sys.argv = ['droptower', *sys.argv[1:]]\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "bad = [m for m in sys.modules if m.split('.')[0] in ('numba', 'llvmlite')]\n"
        "print('LOADED' if bad else 'CLEAN', file=sys.stderr)\n"
    )
    extra = [str(tmp_path)] if command[-1] == "--data" else []
    run = subprocess.run([sys.executable, "-c", program, *command, *extra], capture_output=True, text=True, check=True)
    assert run.stderr.strip().endswith("CLEAN")
