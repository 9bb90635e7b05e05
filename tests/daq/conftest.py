"""An emulator for the tests of acquisition."""

from collections.abc import Iterator

import pytest
from emulator import Emulator


@pytest.fixture
def emulator() -> Iterator[Emulator]:
    with Emulator("--seed", "7") as running:
        yield running
