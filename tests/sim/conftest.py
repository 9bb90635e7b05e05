"""Emulators for the tests of the emulator."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from emulator import Emulator


@pytest.fixture(scope="session")
def _one_emulator() -> Iterator[Emulator]:
    with Emulator("--seed", "7") as running:
        yield running


@pytest.fixture
def shared_emulator(_one_emulator: Emulator) -> Emulator:
    """One process for the whole session, idle and with the default rig (catcher on) for every test."""
    _one_emulator.fresh()
    return _one_emulator
