"""What all tests share: an emulator, the test file of the published CR-39 drops, records to import, the references."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from emulator import Emulator
from playwright.sync_api import Browser, sync_playwright
from records import CR39, SHARED, half_sine, need

CHROMIUM = [
    "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync",
]  # fmt: skip


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """A real one, the same for all tests of a worker: two cannot be driven side by side."""
    path = need("chromium")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=CHROMIUM)
        yield browser
        browser.close()


@pytest.fixture
def emulator() -> Iterator[Emulator]:
    """A process of its own for the test."""
    with Emulator("--seed", "7") as running:
        yield running


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
