"""Trains that run on movement authorities received by radio, through the whole graph."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
import yaml

from rail_corridor.loading.loader import builtin_scenarios

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory


#: The first stops by itself at this time [s].
_STOPS_S = 40.0


def _changed(**changes: Any) -> dict[str, Any]:
    """`moving_block` with fields of its top level changed."""
    data: dict[str, Any] = yaml.safe_load(builtin_scenarios()["moving_block"].read_text())
    return data | changes


def _is_safe(train: dict[str, Any]) -> bool:
    """Within its authority and the limits, where it believes to be, with what it was given."""
    link, atp = train["cbtc"], train["atp"]
    kept = atp["passed_authority"] == 0 and atp["overspeed_s"] == 0.0
    return bool(kept and link["forged_accepted"] == 0 and link["mislocated"] == 0)


def test_trains_follow_at_braking_distance_and_stop_behind_one_that_stops(
    corridor: CorridorFactory,
) -> None:
    stop = {"kind": "train_stop", "train": "first", "from_s": _STOPS_S, "to_s": 90.0}
    report = corridor(_changed(faults=[stop], duration_s=62.0)).run_to_end().report
    trains = report["trains"]
    assert all(_is_safe(train) for train in trains.values())
    assert report["missing_ticks"] == 0
    assert report["failures"] == []
    # The first stops; those behind come close, and stay apart.
    assert trains["first"]["distance_m"] > 350.0
    for name in ("second", "third", "fourth"):
        assert 350.0 < trains[name]["distance_m"] < trains["first"]["distance_m"] + 350.0
        assert 10.0 < trains[name]["atp"]["margin_min_m"] < 250.0
    for train in trains.values():
        # Two each second, both ways.
        assert train["cbtc"]["frames"] > 230
        assert train["cbtc"]["age_p95_s"] < 1.0


@pytest.mark.system
def test_the_same_to_the_last_bit_wherever_the_nodes_live(corridor: CorridorFactory) -> None:
    data = _changed(
        tracks={"main": {"elements": [{"straight_m": 1000}], "speed_limits": [[0, 80]]}},
        trains=[
            {"name": name, "route": ["main"], "start_m": start_m}
            for name, start_m in (("first", 500), ("second", 150))
        ],
        faults=[],
        duration_s=6.0,
    )
    digests = {
        corridor(data, placement=placement).run_to_end().digest for placement in ("one", "site")
    }
    assert len(digests) == 1
