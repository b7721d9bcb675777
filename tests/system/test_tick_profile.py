"""``rail profile``, as a user starts it."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from .conftest import Rail

pytestmark = pytest.mark.system


def test_a_profile_adds_up_and_finds_the_dearest_work(rail: Rail) -> None:
    flame, figures = rail.directory / "flame.json", rail.directory / "figures.json"
    run = rail.start("profile", "demo", "--duration", 40, "--flame", flame, "--json", figures)
    assert rail.finish(run) == 0, rail.errors(run)
    assert "whole tick" in rail.output(run)
    found = json.loads(figures.read_text())
    kinds = {row.pop("kind"): row for row in found["kinds"]}
    assert kinds["ranging: wrs"]["nodes"] == 16
    total_ms = sum(sum(row.values()) - row["nodes"] for row in kinds.values())
    assert total_ms == pytest.approx(found["tick_ms"])
    # Receivers compute; the zone controller does not.
    assert (
        kinds["ranging: vrs"]["arithmetic_ms"] > kinds["ranging: zone_controller"]["arithmetic_ms"]
    )
    # /diagnostics goes through the middleware, the rest past it.
    assert 0.0 < found["hand_over_floor_ms"] < found["tick_ms"]
    assert 0.0 < found["middleware_floor_ms"] < found["tick_ms"]
    assert found["transport_floor_ms"] < found["arithmetic_floor_ms"] < found["tick_ms"]
    assert found["tick_ms"] < 1.05 * found["wall_tick_ms"]
    assert "ranging: wrs" in {
        frame["name"] for frame in json.loads(flame.read_text())["shared"]["frames"]
    }
