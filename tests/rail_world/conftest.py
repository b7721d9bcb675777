"""Fixtures of the tests of the world."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture
def real_line() -> Callable[[str], Path]:
    """Path of a track of the TTOBench library, which is kept beside the project, not in it."""
    directory = Path(__file__).resolve().parents[3] / "shared" / "data"

    def find(name: str) -> Path:
        path = directory / f"{name}.json"
        if not path.is_file():
            pytest.skip(f"{path.name} is not there")
        return path

    return find
