"""The table of a profile."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from rail_corridor.studies.tick_profile.attribution import Stage
from rail_corridor.studies.tick_profile.cost_table import TickCosts, costs_of, print_costs

SAMPLES: list[tuple[str, Stage, float]] = [
    ("transport", "transport", 3.0),
    ("world", "interpreter", 1.0),
    ("wrs", "arithmetic", 3.0),
    ("wrs", "transport", 1.0),
]
NODES = {"world": 1, "wrs": 16, "idle": 2}


def costs() -> TickCosts:
    return TickCosts(
        costs_of(SAMPLES, NODES, 4.0),
        tick_s=0.25,
        tick_ms=4.0,
        wall_tick_ms=5.0,
        sampling=0.02,
        samples=800,
        hand_over_ms=0.1,
        middleware_ms=0.4,
        arithmetic_ms=1.5,
    )


def test_rows_add_up_to_a_tick_and_the_dearest_is_first() -> None:
    rows = costs_of(SAMPLES, NODES, 4.0)
    assert [row.kind for row in rows] == ["wrs", "world", "idle", "transport"]
    assert [row.nodes for row in rows] == [16, 1, 2, 0]
    assert [row.total_ms for row in rows] == pytest.approx([2.0, 0.5, 0.0, 1.5])
    assert rows[0].ms == pytest.approx({"arithmetic": 1.5, "transport": 0.5})


def test_without_samples_nothing_is_divided() -> None:
    assert all(row.total_ms == 0.0 for row in costs_of([], NODES, 4.0))


def test_values_hold_the_rows_the_floors_and_their_ratio() -> None:
    values = costs().values()
    assert values["ratio"] == 2.0
    assert values["transport_floor_ms"] == 0.5
    assert values["kinds"][0] == {
        "kind": "wrs",
        "nodes": 16,
        "transport_ms": 0.5,
        "arithmetic_ms": 1.5,
        "interpreter_ms": 0.0,
    }


def test_the_table_shows_the_whole_tick_and_the_floors() -> None:
    console = Console(file=io.StringIO(), width=80)
    print_costs(costs(), "demo", console)
    lines = console.file.getvalue().splitlines()  # type: ignore[attr-defined]
    assert max(map(len, lines[:9])) <= 80
    (wrs,) = [line.split() for line in lines if line.startswith(" wrs")]
    assert wrs == ["wrs", "16", "0.500", "1.500", "0.000", "2.000", "50.0%"]
    (whole,) = [line.split() for line in lines if line.startswith(" whole tick")]
    assert whole == ["whole", "tick", "19", "2.000", "1.500", "0.500", "4.000", "100.0%"]
    floors, clock, samples = lines[-3:]
    assert floors == (
        "floors: transport 0.500 ms (0.100 in the process, 0.400 by the middleware), "
        "arithmetic 1.500 ms; a tick takes 2.00 times both"
    )
    assert clock.endswith("5.000 ms of wall time, 50.0 times real time")
    assert samples.startswith("800 samples, which made a tick +2.0% longer")
