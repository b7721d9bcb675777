"""Who is where, who is in whose way, and what is said of it; the oracle is plain geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import pytest

from rail_world.line.description import JunctionDescription, TrackDescription
from rail_world.line.network import Network, build_network
from rail_world.trains.conditions import Conditions
from rail_world.trains.curve_speed import (
    CENTRE_OF_MASS_M,
    GAUGE_M,
    MOST_CANT_M,
    CurveSpeed,
)
from rail_world.trains.description import ReducedBraking, TrainDescription
from rail_world.trains.drive_command import DriveCommand
from rail_world.trains.judge import STALL_S, Event, Judge
from rail_world.trains.occupancy import CLEARANCE_M, Fouling
from rail_world.trains.traffic import ENTRANCE_MARGIN_M, Traffic

HOLD = DriveCommand(service_brake=True)
PATIENCE_S = 20.0


def network(junctions: tuple[Mapping[str, Any], ...] = (), **tracks: Mapping[str, Any]) -> Network:
    described = {name: TrackDescription.model_validate(track) for name, track in tracks.items()}
    return build_network(
        described, [JunctionDescription.model_validate(each) for each in junctions]
    )


def straight(length_m: float = 4000.0, **more: Any) -> Network:
    return network(main={"elements": [{"straight_m": length_m}], **more})


def branching() -> Network:
    """A branch that leaves to the left on a curve of 300 m."""
    return network(
        ({"track": "main", "at_m": 1000.0, "branch": "side"},),
        main={"elements": [{"straight_m": 3000.0}]},
        side={"elements": [{"arc_m": 300.0, "radius_m": 300.0}, {"straight_m": 500.0}]},
    )


def trains(*changes: Mapping[str, Any]) -> list[TrainDescription]:
    return [
        TrainDescription.model_validate({"name": f"t{number}", "route": ["main"], **change})
        for number, change in enumerate(changes, start=1)
    ]


class Judged:
    """Traffic with its judge."""

    def __init__(
        self,
        line: Network,
        *changes: Mapping[str, Any],
        tick_s: float = 0.25,
        conditions: Conditions | None = None,
        **more: Any,
    ) -> None:
        self.traffic = Traffic(trains(*changes), line, tick_s, conditions)
        self.judge = Judge(self.traffic, line, **{"patience_s": PATIENCE_S, **more})
        self.tick_s, self.ticks = tick_s, 0
        self.events: list[tuple[float, Event]] = []

    def run(self, seconds: float, **commands: DriveCommand) -> list[str]:
        """Kinds of what began."""
        before = len(self.events)
        for _ in range(round(seconds / self.tick_s)):
            self.ticks += 1
            self.traffic.step(commands)
            time_s = self.ticks * self.tick_s
            self.events += [(time_s, event) for event in self.judge.judge(time_s, commands)]
        return [event.kind for _, event in self.events[before:] if not event.over]


def test_two_that_run_at_each_other_collide_once_and_in_the_middle() -> None:
    run = Judged(straight(), {"start_m": 500.0}, {"start_m": 3500.0, "direction": -1}, tick_s=1.0)
    assert run.run(200.0) == ["collision"]
    ((time_s, event), (over_s, over)) = run.events
    assert (event.train, event.other, event.track) == ("t1", "t2", "main")
    assert event.at_m == pytest.approx(2000.0, abs=30.0)
    assert event.level == "error" and "collision of t1 and t2" in event.message
    # They are through each other when both have run the sum of their lengths.
    assert over.over and over.level == "ok" and time_s < over_s


def test_who_follows_too_closely_runs_into_the_one_ahead() -> None:
    run = Judged(straight(), {"start_m": 500.0}, {"start_m": 1500.0, "depart_s": 900.0})
    assert run.run(100.0) == ["collision"]
    _, event = run.events[0]
    assert event.at_m == pytest.approx(1500.0 - 118.0, abs=6.0)


def test_buffer_to_buffer_is_no_collision() -> None:
    run = Judged(
        straight(), {"start_m": 500.0, "depart_s": 90.0}, {"start_m": 618.0, "depart_s": 90.0}
    )
    assert run.run(5.0) == []
    run = Judged(
        straight(), {"start_m": 500.0, "depart_s": 90.0}, {"start_m": 617.9, "depart_s": 90.0}
    )
    assert run.run(5.0) == ["collision"]


def test_a_branch_fouls_its_track_until_they_are_a_clearance_apart() -> None:
    line = branching()
    # On an arc the offset is R (1 - cos(s / R)); both are within the same metre.
    fouling_m = 300.0 * math.acos(1.0 - CLEARANCE_M / 300.0)
    route = line.route(["main", "side"])
    (side, beside) = Fouling(line).stretches(route, 1000.0 + 10.0, 1000.0 + 200.0)
    assert side == ("side", 10.0, 200.0)
    assert (beside.track, beside.low_m) == ("main", 1010.0)
    assert beside.high_m == pytest.approx(1000.0 + fouling_m, abs=2.0)


@pytest.mark.parametrize(("tail_m", "collides"), [(30.0, True), (60.0, False)])
def test_a_train_on_a_branch_is_in_the_way_while_its_tail_fouls(
    tail_m: float, collides: bool
) -> None:
    on_branch = {"route": ["side"], "start_m": tail_m + 118.0, "depart_s": 900.0}
    passing = {"start_m": 900.0}
    assert Judged(branching(), on_branch, passing).run(60.0) == ["collision"] * collides


def test_speed_that_a_curve_bears_is_that_at_which_a_train_tips() -> None:
    line = network(main={"elements": [{"straight_m": 500}, {"arc_m": 2000, "radius_m": 400.0}]})
    curves = CurveSpeed(line.route(["main"]), line)
    g = 9.80665
    bears = g * GAUGE_M / (2.0 * CENTRE_OF_MASS_M) + g * MOST_CANT_M / GAUGE_M
    assert curves.between(1000.0, 1100.0) == pytest.approx(math.sqrt(400.0 * bears), rel=1e-3)
    assert curves.between(0.0, 400.0) == math.inf
    assert curves.least_mps == pytest.approx(math.sqrt(400.0 * bears), rel=1e-3)


def test_on_points_there_is_no_cant() -> None:
    line = branching()
    curves = CurveSpeed(line.route(["main", "side"]), line)
    assert curves.between(1020.0, 1030.0) < curves.between(1100.0, 1200.0)


@pytest.mark.parametrize(("speed_kmh", "derails"), [(120.0, False), (190.0, True)])
def test_a_train_leaves_the_rails_where_it_is_too_fast(speed_kmh: float, derails: bool) -> None:
    line = network(
        main={
            "elements": [
                {"straight_m": 500},
                {"arc_m": 1000, "radius_m": 400.0},
                {"straight_m": 5000},
            ]
        }
    )
    run = Judged(
        line,
        {
            "speed_kmh": speed_kmh,
            "target_speed_kmh": speed_kmh,
            "start_m": 200.0,
            "vehicle": {"preset": "high_speed"},
        },
    )
    assert run.run(40.0) == ["derailment"] * derails
    if derails:
        _, event = run.events[0]
        assert 500.0 <= event.at_m <= 560.0


def test_a_train_that_cannot_stop_passes_the_end_of_the_track() -> None:
    weak = ReducedBraking(train="t1", from_s=0.0, to_s=900.0, service=0.1, emergency=0.1)
    run = Judged(straight(2000.0), {}, conditions=Conditions(reduced=[weak]))
    assert run.run(200.0)[0] == "end of track passed"
    _, event = run.events[0]
    assert event.at_m == 2000.0


def test_who_is_held_for_long_is_stuck_and_said_to_go_on() -> None:
    run = Judged(straight(), {"start_m": 500.0})
    assert run.run(PATIENCE_S, t1=HOLD) == []
    assert run.run(2.0, t1=HOLD) == ["stuck"]
    assert "the service brake; no train is ahead" in run.events[0][1].message
    run.run(5.0)
    assert [event.over for _, event in run.events] == [False, True]


@pytest.mark.parametrize(
    ("command", "cause"),
    [
        (DriveCommand(emergency_brake=True), "the emergency brake"),
        (DriveCommand(traction_cut_off=True), "no traction"),
        (DriveCommand(max_speed_mps=0.0), "no speed permitted"),
    ],
)
def test_it_is_said_what_a_stuck_train_waits_for(command: DriveCommand, cause: str) -> None:
    run = Judged(straight(), {"start_m": 500.0}, {"start_m": 2000.0}, conditions=Conditions())
    assert run.run(PATIENCE_S + 3.0, t1=command, t2=HOLD) == ["stuck", "stuck"]
    (mine,) = (event for _, event in run.events if event.train == "t1")
    assert f"{cause}; t2 is 1382 m ahead" in mine.message


def test_as_long_as_faults_last_nobody_is_stuck() -> None:
    run = Judged(straight(), {"start_m": 500.0}, quiet_from_s=100.0)
    assert run.run(100.0 + PATIENCE_S, t1=HOLD) == []
    assert run.run(2.0, t1=HOLD) == ["stuck"]


@pytest.mark.parametrize(("gap_m", "kinds"), [(100.0, []), (300.0, ["stuck"])])
def test_who_queues_behind_one_with_a_reason_is_not_stuck(gap_m: float, kinds: list[str]) -> None:
    ahead = {"start_m": 2000.0, "depart_s": 900.0}
    behind = {"start_m": 2000.0 - 118.0 - gap_m}
    run = Judged(straight(), ahead, behind, queue_m=200.0)
    assert run.run(PATIENCE_S + 3.0, t2=HOLD) == kinds


def test_two_that_wait_for_each_other_are_both_stuck() -> None:
    run = Judged(straight(), {"start_m": 1900.0}, {"start_m": 2000.0, "direction": -1})
    assert run.run(PATIENCE_S + 3.0, t1=HOLD, t2=HOLD) == ["stuck", "stuck"]


def test_who_comes_behind_one_that_has_just_left_is_given_its_time() -> None:
    run = Judged(straight(), {"start_m": 1000.0, "depart_s": 60.0}, {"start_m": 800.0})
    leader, follower = run.traffic.trains
    while leader.low_m - follower.high_m <= 200.0:
        assert run.run(1.0, t2=HOLD) == []
    assert run.run(PATIENCE_S - 2.0, t2=HOLD) == []
    assert run.run(6.0, t2=HOLD) == ["stuck"]


def test_a_train_that_comes_at_another_is_no_reason_to_stand() -> None:
    slow = {"start_m": 1200.0, "direction": -1, "target_speed_kmh": 10.0}
    run = Judged(straight(), {"start_m": 600.0}, slow, queue_m=1000.0)
    assert run.run(PATIENCE_S + 3.0, t1=HOLD) == ["stuck"]


def test_a_train_that_its_motors_cannot_pull_has_stalled() -> None:
    line = straight(3000.0, gradients=[[0.0, 0.0], [600.0, 60.0]], speed_limits=[[0.0, 80.0]])
    run = Judged(line, {"start_m": 130.0, "vehicle": {"max_traction_n": 120e3}})
    assert run.run(300.0) == ["stall", "stuck"]
    (stalled_s, _), (stuck_s, event) = run.events
    assert stuck_s - stalled_s == pytest.approx(PATIENCE_S - STALL_S, abs=2.0)
    assert "cannot pull" in event.message


def test_a_train_enters_when_place_and_braking_distance_are_free() -> None:
    standing = {"start_m": 700.0, "depart_s": 60.0}
    entering = {"start_m": 500.0, "enters_at_departure": True, "speed_kmh": 72.0, "depart_s": 5.0}
    run = Judged(straight(), standing, entering)
    assert run.run(60.0) == ["entrance"]
    assert "t2 waits at the entrance: t1 is in the way" in run.events[0][1].message
    first, second = run.traffic.trains
    assert second.state == "waiting" and not run.traffic.on_line(1)
    while second.state == "waiting":
        tail_m = first.low_m
        run.run(0.25)
    # 72 km/h at the 0.8 m/s^2 that its driver plans with, and a margin at both ends.
    needed_m = 500.0 + 20.0**2 / (2.0 * 0.8) + ENTRANCE_MARGIN_M
    assert tail_m == pytest.approx(needed_m, abs=6.0)
    assert run.run(60.0) == [] and run.events[-1][1].over


def test_of_two_that_are_due_at_one_place_one_enters() -> None:
    entering = {"start_m": 200.0, "enters_at_departure": True, "depart_s": 1.0}
    run = Judged(straight(), entering, entering)
    run.run(2.0)
    assert [run.traffic.on_line(index) for index in (0, 1)] == [True, False]
    run.run(60.0)
    assert run.traffic.on_line(1)
    assert not any(event.kind == "collision" for _, event in run.events)


def test_a_train_that_comes_from_behind_keeps_another_from_entering() -> None:
    coming = {"start_m": 400.0, "speed_kmh": 72.0}
    entering = {"start_m": 700.0, "enters_at_departure": True, "depart_s": 1.0}
    run = Judged(straight(), coming, entering)
    run.run(3.0)
    assert not run.traffic.on_line(1)
