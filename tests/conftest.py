"""What all tests share: the test file of the published CR-39 drops, records to import, the reference folder."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

SHARED = Path(__file__).parents[2] / "shared"

CR39 = """[dart]
mass_kg = 0.503
tip_radius_mm = 6.35
u_mass_kg = 0.0005

[specimen]
id = "cr39-1"
material = "CR-39"
thickness_mm = 4.6
nu = 0.30

[support]
kind = "ring"
radius_mm = 30

[drop]
v0 = 2.0
u_v0 = 0.01
"""


@pytest.fixture
def shared() -> Path:
    """The folder of references; it is not part of a clone."""
    if not SHARED.is_dir():
        pytest.skip(f"the reference folder {SHARED} is not here")
    return SHARED


@pytest.fixture
def cr39(tmp_path: Path) -> Path:
    path = tmp_path / "cr39.toml"
    path.write_text(CR39)
    return path


def half_sine(rate: float = 1e6, n: int = 6000, peak: float = 1050.0) -> tuple[np.ndarray, np.ndarray]:
    """Time and force of a half-sine contact of 2.9 ms that starts at 0.5 ms."""
    t = np.arange(n) / rate
    inside = (t > 0.5e-3) & (t < 3.4e-3)
    return t, np.where(inside, peak * np.sin(np.pi * (t - 0.5e-3) / 2.9e-3), 0.0)


@pytest.fixture
def write_csv(tmp_path: Path) -> Callable[..., Path]:
    """Writes a CSV of the half sine; `change` may spoil its lines."""

    def write(name: str = "drop.csv", header: str = "time_s,force_N", change=None) -> Path:
        t, f = half_sine()
        lines = [header, *(f"{a:.6e},{b:.4f}" for a, b in zip(t, f, strict=True))]
        if change is not None:
            lines = change(lines)
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    return write


def need(program: str) -> str:
    """Path of a program from the system's packages; skips without it, but fails in CI, which installs it."""
    path = shutil.which(program)
    if path is None:
        if os.environ.get("CI"):
            pytest.fail(f"{program} is not installed, and CI has to have it")
        pytest.skip(f"{program} is not installed (Debian: apt-get install {program})")
    return path
