"""Records and test files that tests start from, and programs that they need."""

import os
import shutil
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


def half_sine(rate: float = 1e6, n: int = 6000, peak: float = 1050.0) -> tuple[np.ndarray, np.ndarray]:
    """Time and force of a half-sine contact of 2.9 ms that starts at 0.5 ms."""
    t = np.arange(n) / rate
    inside = (t > 0.5e-3) & (t < 3.4e-3)
    return t, np.where(inside, peak * np.sin(np.pi * (t - 0.5e-3) / 2.9e-3), 0.0)


def need(program: str) -> str:
    """Path of a program from the system's packages; skips without it, but fails in CI, which installs it."""
    path = shutil.which(program)
    if path is None:
        if os.environ.get("CI"):
            pytest.fail(f"{program} is not installed, and CI has to have it")
        pytest.skip(f"{program} is not installed (Debian: apt-get install {program})")
    return path
