"""What the tests of the axle counter share."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from builders import LINE, Graph, straight

from rail_corridor.loading.loader import scenario_from_data
from rail_corridor.scenario.model import Scenario
from rail_world.line.network import Network

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")


@pytest.fixture
def scenario() -> Callable[..., Scenario]:
    """Return a function that makes the scenario of `LINE`, with other fields."""

    def make(**changes: Any) -> Scenario:
        return scenario_from_data({**LINE, **changes}, directory=Path("."))

    return make


@pytest.fixture
def network() -> Network:
    """Return a kilometre of straight track."""
    return straight(1000.0)


@pytest.fixture
def graph() -> Iterator[Graph]:
    """Return a graph in the domain that the environment names."""
    made = Graph(int(os.environ.get("ROS_DOMAIN_ID", "0")))
    try:
        yield made
    finally:
        made.close()
