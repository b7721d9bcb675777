"""Rules for the whole test suite."""

from __future__ import annotations

import os

import pytest
from hypothesis import settings

# Examples are drawn from a fixed seed: a test run says the same thing every time.
settings.register_profile("corridor", derandomize=True, deadline=None, print_blob=True)
settings.load_profile("corridor")

# Tests never talk to a corridor that runs on this or another machine.
os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put every system test on one worker: they start processes and must not compete."""
    for item in items:
        if item.get_closest_marker("system"):
            item.add_marker(pytest.mark.xdist_group("system"))
