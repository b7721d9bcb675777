"""Brakes that build up, brakes and rails that fail, driving on sight, boards: by closed forms."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rail_world.line.description import TrackDescription
from rail_world.line.network import Network, build_network
from rail_world.trains.conditions import Conditions
from rail_world.trains.description import (
    LowAdhesion,
    ReducedBraking,
    SpeedRestriction,
    TrainDescription,
    WheelSlip,
)
from rail_world.trains.drive_command import DriveCommand
from rail_world.trains.motion import TrainMotion
from rail_world.trains.traffic import Traffic
from rail_world.trains.wheels import Wheels

PLAIN: dict[str, Any] = {
    "mass_kg": 100e3,
    "rotating_mass_factor": 1.1,
    "davis": {"a_n": 0.0, "b_n_per_mps": 0.0, "c_n_per_mps2": 0.0},
    "max_traction_n": 110e3,
    "max_power_w": 1e8,
    "max_service_brake_mps2": 1.0,
    "emergency_brake_mps2": 1.5,
    "brake_build_up_s": 2.0,
    "max_speed_kmh": 360.0,
    "length_m": 100.0,
}
SERVICE, EMERGENCY = DriveCommand(service_brake=True), DriveCommand(emergency_brake=True)


def network(length_m: float = 10_000.0, **more: Any) -> Network:
    described = {"elements": [{"straight_m": length_m}], **more}
    return build_network({"main": TrackDescription.model_validate(described)})


def description(**changes: Any) -> TrainDescription:
    given = {"name": "t1", "route": ["main"], "vehicle": PLAIN, **changes}
    return TrainDescription.model_validate(given)


def motion(line: Network | None = None, tick_s: float = 0.1, **changes: Any) -> TrainMotion:
    return TrainMotion(description(**changes), line or network(), tick_s)


@pytest.mark.parametrize(("command", "b"), [(SERVICE, 1.0), (EMERGENCY, 1.5)])
@pytest.mark.parametrize("tick_s", [0.1, 0.5])
def test_a_brake_that_builds_up_costs_half_the_ramp(
    command: DriveCommand, b: float, tick_s: float
) -> None:
    # While it rises over T: v - b T / 2 is left, and v T - b T^2 / 6 run.
    v, ramp = 25.0, 2.0
    train = motion(speed_kmh=3.6 * v, tick_s=tick_s)
    while train.speed_mps > 0.0:
        train.step(command)
    after = v - b * ramp / 2.0
    expected = v * ramp - b * ramp**2 / 6.0 + after**2 / (2.0 * b)
    assert train.path_m == pytest.approx(expected, abs=0.05)


def test_a_driver_who_knows_where_to_stop_applies_the_brake_in_time() -> None:
    train = motion(stop_at_m=[3000.0])
    while train.state == "running":
        train.step()
        assert train.time_s < 500.0
    assert train.path_m == pytest.approx(3000.0, abs=1e-3)


def test_motors_that_are_cut_off_do_not_pull() -> None:
    train = motion(speed_kmh=36.0)
    for _ in range(100):
        train.step(DriveCommand(traction_cut_off=True))
    assert train.speed_mps == pytest.approx(10.0)
    train.step()
    assert train.speed_mps > 10.0


@pytest.mark.parametrize(("service", "emergency"), [(0.5, 1.0), (1.0, 0.4)])
def test_reduced_brakes_need_the_longer_way(service: float, emergency: float) -> None:
    vehicle = {**PLAIN, "brake_build_up_s": 0.0}
    for command, b in ((SERVICE, service * 1.0), (EMERGENCY, emergency * 1.5)):
        fault = ReducedBraking(
            train="t1", from_s=0.0, to_s=900.0, service=service, emergency=emergency
        )
        traffic = Traffic(
            [description(speed_kmh=90.0, vehicle=vehicle)],
            network(),
            0.1,
            Conditions(reduced=[fault]),
        )
        (train,) = traffic.trains
        while train.speed_mps > 0.0:
            traffic.step({"t1": command})
        assert train.path_m == pytest.approx(25.0**2 / (2.0 * b), rel=1e-3)


def test_a_train_with_weak_brakes_passes_its_stop_and_goes_on() -> None:
    fault = ReducedBraking(train="t1", from_s=0.0, to_s=900.0, service=0.4, emergency=0.4)
    traffic = Traffic(
        [description(stop_at_m=[3000.0, 6000.0], dwell_s=10.0)],
        network(speed_limits=[[0.0, 100.0]]),
        0.1,
        Conditions(reduced=[fault]),
    )
    (train,) = traffic.trains
    while train.state == "running":
        traffic.step()
    assert train.state == "dwelling"
    assert 3100.0 < train.path_m < 4000.0
    for _ in range(200):
        traffic.step()
    assert train.speed_mps > 0.0


def test_a_train_that_cannot_stop_runs_off_the_end() -> None:
    fault = ReducedBraking(train="t1", from_s=0.0, to_s=900.0, service=0.1, emergency=0.1)
    traffic = Traffic([description()], network(2000.0), 0.1, Conditions(reduced=[fault]))
    (train,) = traffic.trains
    for _ in range(1500):
        traffic.step()
    assert train.path_m == 2000.0
    assert train.ran_off_mps > 10.0


def test_rails_bear_no_more_than_their_adhesion_and_the_wheels_slide() -> None:
    rails = LowAdhesion(train="t1", from_s=0.0, to_s=900.0, adhesion=0.05)
    vehicle = {**PLAIN, "brake_build_up_s": 0.0}
    traffic = Traffic(
        [description(speed_kmh=90.0, vehicle=vehicle)], network(), 0.1, Conditions(slippery=[rails])
    )
    (train,) = traffic.trains
    least = 1.0
    while train.speed_mps > 0.0:
        traffic.step({"t1": EMERGENCY})
        _, wheels_mps = traffic.travelled()["t1"]
        if train.speed_mps > 5.0:
            least = min(least, wheels_mps / train.speed_mps)
    b = 0.05 * 9.80665 / 1.1
    assert train.path_m == pytest.approx(25.0**2 / (2.0 * b), rel=1e-3)
    assert least == pytest.approx(0.75)
    # What was lost is about a quarter of the way.
    travelled_m, _ = traffic.travelled()["t1"]
    assert travelled_m == pytest.approx(0.75 * train.path_m, rel=0.05)


def test_motors_that_pull_more_than_the_rails_bear_spin_the_wheels() -> None:
    rails = LowAdhesion(train="t1", from_s=0.0, to_s=20.0, adhesion=0.05)
    traffic = Traffic([description()], network(), 0.1, Conditions(slippery=[rails]))
    (train,) = traffic.trains
    for _ in range(150):
        traffic.step()
    assert train.speed_mps == pytest.approx(0.05 * 9.80665 / 1.1 * 15.0, rel=0.01)
    assert traffic.travelled()["t1"][1] > 1.2 * train.speed_mps
    for _ in range(60):
        traffic.step()
    assert traffic.travelled()["t1"][1] == train.speed_mps


@pytest.mark.parametrize("free_m", [math.inf, 300.0, 40.0])
def test_on_sight_a_train_can_always_stop_short_of_what_is_ahead(free_m: float) -> None:
    train = motion(tick_s=0.25)
    fastest = 0.0
    for _ in range(800):
        left_m = free_m - train.path_m
        train.step(DriveCommand(on_sight=True), free_ahead_m=left_m)
        fastest = max(fastest, train.speed_mps)
    # v T / 2 + v^2 / (2 b) of the 80 m that he sees, at the 0.8 m/s^2 that he plans with.
    highest = math.sqrt(0.8**2 + 2.0 * 0.8 * 80.0) - 0.8
    assert fastest <= highest + 1e-6
    if free_m == math.inf:
        assert fastest == pytest.approx(highest, rel=0.02)
    else:
        assert train.speed_mps == 0.0
        assert free_m - 8.0 < train.path_m < free_m


def test_on_sight_it_goes_on_when_the_obstacle_does() -> None:
    trains = [
        description(start_m=200.0),
        description(name="t2", start_m=600.0, depart_s=60.0),
    ]
    traffic = Traffic(trains, network(), 0.25)
    for _ in range(220):
        traffic.step({"t1": DriveCommand(on_sight=True)})
    behind, ahead = traffic.trains
    assert behind.speed_mps == 0.0
    assert ahead.low_m - behind.high_m == pytest.approx(5.0, abs=1.0)
    for _ in range(100):
        traffic.step({"t1": DriveCommand(on_sight=True)})
        assert behind.high_m < ahead.low_m
    assert behind.speed_mps > 5.0


def test_drivers_keep_to_boards_with_the_whole_train_while_they_stand() -> None:
    board = SpeedRestriction(
        track="main", from_m=1000.0, to_m=1500.0, speed_kmh=36.0, from_s=0.0, to_s=300.0
    )
    traffic = Traffic(
        [description()],
        network(speed_limits=[[0.0, 100.0]]),
        0.1,
        Conditions(restrictions=[board]),
    )
    (train,) = traffic.trains
    seen = set()
    while train.path_m < 3000.0:
        traffic.step()
        if train.high_m > 1000.0 and train.low_m < 1500.0:
            assert train.speed_mps <= 10.0 + 1e-9
            seen.add(round(train.speed_mps, 3))
    assert 10.0 in seen
    assert train.speed_mps > 20.0


def test_an_odometer_counts_whole_pulses() -> None:
    wheels = Wheels(0.01, pulse_m=0.5)
    assert wheels.count(0.1, 10.2, 3.0) == (10.0, 3.0 * 1.01)
    assert wheels.count(0.2, 10.4, 3.0)[0] == 10.5
    slipping = Wheels(0.0, [WheelSlip(train="a", from_s=0.0, to_s=9.0, ratio=0.5)], 0.5)
    assert slipping.count(0.1, 10.2, 3.0) == (5.0, 1.5)
