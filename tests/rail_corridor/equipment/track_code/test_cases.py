"""Situations in which a circuit or a train once believed what it should not."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from rail_corridor.equipment.track_code.line_speeds import allowed_kmh, line_speeds
from rail_corridor.equipment.track_code.placement import Circuit
from rail_corridor.equipment.track_code.subsystem import slow_blocks
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import scenario_from_data
from rail_corridor.loading.schema import parse_scenario
from rail_signals.track_code.scales import SPEEDS_KMH

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory


def line(**changes: Any) -> dict[str, Any]:
    """Return a line of 5 km with a follower 2.4 km behind a train that stands."""
    circuits = {"length_m": 500, "cab_signals": False} | changes.pop("circuits", {})
    trains = [
        {"name": "follower", "route": ["main"], "start_m": 1150},
        {"name": "leader", "route": ["main"], "start_m": 2600, "depart_s": 500},
    ]
    track = {"elements": [{"straight_m": 5000}], "speed_limits": [[0, 100]]}
    return {
        "name": "case",
        "seed": 5,
        "tick_s": 0.5,
        "duration_s": 100,
        "tracks": {"main": track | changes.pop("track", {})},
        "stations": {"zone_length_m": 350.0},
        "track_circuits": circuits,
        "trains": [
            train | {"vehicle": {"preset": "regional"}} for train in changes.pop("trains", trains)
        ],
        "faults": changes.pop("faults", []),
    }


SOLO = [{"name": "follower", "route": ["main"], "start_m": 2080}]


@pytest.mark.parametrize("snr_db", [8, 12])
def test_noise_clears_no_circuit_over_a_train(corridor: CorridorFactory, snr_db: int) -> None:
    report = corridor(line(circuits={"snr_db": snr_db})).run_to_end().report
    for train in report["trains"].values():
        assert train["track_code"]["clear_over_train_s"] == 0.0
    assert report["trains"]["follower"]["atp"]["margin_min_m"] > 400.0


def test_the_code_of_a_neighbour_is_not_obeyed_in_a_dead_circuit(corridor: CorridorFactory) -> None:
    fault = {"kind": "dead_transmitter", "circuit": "tc5", "from_s": 0, "to_s": 30}
    case = line(trains=SOLO, faults=[fault], circuits={"joint_db": 15})
    c = corridor(case)
    c.run_for(30)
    assert c.truth("follower").speed_mps == 0.0
    # Once there is a code it goes on.
    c.run_until(lambda: c.truth("follower").speed_mps > 5.0, within_s=30.0)


def test_sliding_wheels_do_not_pass_the_code_unbraked(corridor: CorridorFactory) -> None:
    slide = {"kind": "wheel_slip", "train": "follower", "from_s": 20, "to_s": 80, "ratio": 0.5}
    train = corridor(line(faults=[slide])).run_to_end().report["trains"]["follower"]
    assert train["atp"]["above_code_s"] == 0.0
    assert train["atp"]["interventions"] > 0
    assert train["atp"]["entered_occupied"] == 0


def test_a_limit_of_20_is_run_at_20(corridor: CorridorFactory) -> None:
    limits = [[0, 60], [2200, 20], [2400, 60]]
    c = corridor(line(trains=SOLO, track={"speed_limits": limits}))
    c.run_until(lambda: c.truth("follower").front_m > 2300.0, within_s=90.0)


@pytest.mark.parametrize("length_m", [50.0, 60.0, 125.0])
def test_short_blocks_let_trains_run_and_say_how_fast(length_m: float) -> None:
    scenario = parse_scenario(line(trains=SOLO, circuits={"length_m": length_m}))
    said = list(slow_blocks(scenario))
    assert len(said) == 1
    assert f"blocks of {length_m:.0f} m allow" in said[0]
    assert " 0 km/h" not in said[0]


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"track": {"gradients": [[0, 0], [1000, -60], [1500, 0]]}}, "braking_mps2"),
        ({"circuits": {"joint_db": 5}}, "joint_db"),
        (
            {"faults": [{"kind": "failed_joint", "circuit": "tc99", "from_s": 1, "to_s": 2}]},
            "faults.0.circuit",
        ),
    ],
)
def test_what_cannot_be_is_said_before_anything_starts(changes: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError, match=field):
        scenario_from_data(line(**changes), directory=Path.cwd())


def circuit(length_m: float, limit_kmh: float, permil: float = 0.0) -> Circuit:
    return Circuit("tc1", "main", 0.0, length_m, 1700.0, 3, limit_kmh / 3.6, permil)


def test_the_usual_table_serves_where_it_can() -> None:
    assert line_speeds([circuit(500.0, 80.0)], 0.5) == SPEEDS_KMH
    assert line_speeds([circuit(1500.0, 300.0)], 0.5) == SPEEDS_KMH


@pytest.mark.parametrize("limit_kmh", [3.0, 15.0, 20.0, 45.0])
def test_every_limit_that_a_block_bears_is_told_exactly(limit_kmh: float) -> None:
    circuits = [circuit(500.0, limit_kmh)]
    table = line_speeds(circuits, 0.5)
    assert (len(table), list(table)) == (16, sorted(set(table)))
    assert allowed_kmh(circuits, 0.5, table)["tc1"] == pytest.approx(limit_kmh)
