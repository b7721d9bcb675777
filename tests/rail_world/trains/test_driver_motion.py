from __future__ import annotations

import math
from typing import Any

import pytest
from pydantic import ValidationError

from rail_world.errors import WorldDataError
from rail_world.line.description import JunctionDescription, TrackDescription
from rail_world.line.network import Network, build_network
from rail_world.trains.description import TrainDescription
from rail_world.trains.drive_command import DriveCommand
from rail_world.trains.motion import TrainMotion

# No resistance at all, and power without end: constant accelerations.
IDEAL: dict[str, Any] = {
    "mass_kg": 100e3,
    "rotating_mass_factor": 1.0,
    "davis": {"a_n": 0.0, "b_n_per_mps": 0.0, "c_n_per_mps2": 0.0},
    "max_traction_n": 100e3,
    "max_power_w": 1e8,
    "max_service_brake_mps2": 1.0,
    "emergency_brake_mps2": 1.5,
    "brake_build_up_s": 0.0,
    "max_speed_kmh": 360.0,
    "length_m": 100.0,
}
COASTING: dict[str, Any] = {**IDEAL, "max_traction_n": 1e-12}


def line(length_m: float = 10_000.0, **more: Any) -> Network:
    description = {"elements": [{"straight_m": length_m}], **more}
    return build_network({"main": TrackDescription.model_validate(description)})


def train(network: Network | None = None, tick_s: float = 0.1, **changes: Any) -> TrainMotion:
    description = {"name": "t1", "route": ["main"], "vehicle": IDEAL, **changes}
    return TrainMotion(TrainDescription.model_validate(description), network or line(), tick_s)


def run_until(motion: TrainMotion, state: str, limit_s: float = 2000.0) -> None:
    while motion.state != state:
        motion.step()
        assert motion.time_s < limit_s, f"never {state}"


def test_constant_force_from_rest_is_galilei() -> None:
    motion = train()
    for _ in range(500):
        motion.step()
    assert motion.time_s == 50.0
    assert motion.speed_mps == pytest.approx(50.0)
    assert motion.path_m == pytest.approx(0.5 * 50.0**2)
    assert motion.acceleration_mps2 == pytest.approx(1.0)


def test_work_of_traction_is_kinetic_and_potential_energy() -> None:
    motion = train(line(gradients=[[0.0, 20.0]]), vehicle={**IDEAL, "rotating_mass_factor": 1.2})
    while motion.path_m < 1000.0:
        motion.step()
    mass_kg, s = 100e3, motion.path_m
    kinetic_j = 0.5 * 1.2 * mass_kg * motion.speed_mps**2
    potential_j = mass_kg * 9.80665 * s * math.sin(math.atan(0.020))
    assert kinetic_j + potential_j == pytest.approx(100e3 * s, rel=1e-9)


def test_power_limited_acceleration() -> None:
    # P t = m v^2 / 2 once the power is the limit, which it is from v = P/F = 10 m/s, t = 10 s on.
    motion = train(vehicle={**IDEAL, "max_power_w": 1e6})
    for _ in range(600):
        motion.step()
    expected = math.sqrt(10.0**2 + 2.0 * 1e6 * 50.0 / 100e3)
    assert motion.speed_mps == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("davis", "speed_mps"),
    [
        ({"a_n": 5e3}, lambda v0, t: v0 - 0.05 * t),
        ({"b_n_per_mps": 500.0}, lambda v0, t: v0 * math.exp(-0.005 * t)),
        ({"c_n_per_mps2": 50.0}, lambda v0, t: v0 / (1.0 + 0.0005 * v0 * t)),
    ],
)
def test_coasting_decays_as_the_resistance_says(davis: dict[str, float], speed_mps: Any) -> None:
    vehicle = {**COASTING, "davis": {**IDEAL["davis"], **davis}}
    motion = train(speed_kmh=108.0, vehicle=vehicle)
    for _ in range(600):
        motion.step()
    assert motion.speed_mps == pytest.approx(speed_mps(30.0, 60.0), rel=1e-3)


def test_coasting_in_a_curve_loses_roeckls_share() -> None:
    description = {"elements": [{"arc_m": 3000.0, "radius_m": 705.0}]}
    curve = build_network({"main": TrackDescription.model_validate(description)})
    motion = train(curve, start_m=100.0, speed_kmh=108.0, vehicle=COASTING)
    for _ in range(300):
        motion.step()
    assert motion.speed_mps == pytest.approx(30.0 - 9.80665e-3 * 30.0)


@pytest.mark.parametrize(
    ("command", "deceleration_mps2"),
    [
        (DriveCommand(service_brake=True), 1.0),
        (DriveCommand(emergency_brake=True), 1.5),
        (DriveCommand(service_brake=True, emergency_brake=True), 1.5),
        (DriveCommand(max_speed_mps=0.0), 1.0),
    ],
)
@pytest.mark.parametrize("tick_s", [0.1, 0.25, 0.03])
def test_braking_distance_is_v_squared_over_2a(
    command: DriveCommand, deceleration_mps2: float, tick_s: float
) -> None:
    motion = train(speed_kmh=90.0, tick_s=tick_s)
    while motion.speed_mps > 0.0:
        motion.step(command)
    assert motion.path_m == pytest.approx(25.0**2 / (2 * deceleration_mps2))
    assert motion.time_s == pytest.approx(25.0 / deceleration_mps2, abs=tick_s)
    for _ in range(10):
        motion.step(command)
    assert motion.path_m == motion.distance_m == pytest.approx(25.0**2 / (2 * deceleration_mps2))
    assert motion.state == "running"
    motion.step()
    assert motion.speed_mps > 0.0


def test_supervision_caps_the_speed_and_lets_go() -> None:
    motion = train(speed_kmh=90.0)
    for _ in range(300):
        motion.step(DriveCommand(max_speed_mps=20.0))
    assert motion.speed_mps == 20.0
    for _ in range(50):
        motion.step()
    assert motion.speed_mps == pytest.approx(25.0)


@pytest.mark.parametrize("speed", [-1.0, math.nan])
def test_command_wants_a_speed(speed: float) -> None:
    with pytest.raises(ValueError, match="max_speed_mps"):
        DriveCommand(max_speed_mps=speed)


def test_train_held_on_a_slope_stays() -> None:
    motion = train(line(gradients=[[0.0, -40.0]]))
    for _ in range(100):
        motion.step(DriveCommand(emergency_brake=True))
    assert (motion.path_m, motion.speed_mps) == (0.0, 0.0)


@pytest.mark.parametrize("speed_kmh", [80.0, 300.0, 500.0])
@pytest.mark.parametrize("direction", [1, -1])
def test_constant_speed_runs(speed_kmh: float, direction: int) -> None:
    network = line(60_000.0, speed_limits=[[0.0, 500.0]])
    motion = train(
        network,
        start_m=30_000.0,
        direction=direction,
        speed_kmh=speed_kmh,
        target_speed_kmh=speed_kmh,
        vehicle={"preset": "high_speed"},
    )
    for _ in range(600):
        motion.step()
        assert motion.speed_mps == pytest.approx(direction * speed_kmh / 3.6, abs=1e-9)
    assert motion.path_m == pytest.approx(30_000.0 + direction * speed_kmh / 3.6 * 60.0)
    assert motion.direction == direction


@pytest.mark.parametrize("direction", [1, -1])
def test_slow_zone_is_kept_with_the_whole_train(direction: int) -> None:
    network = line(4000.0, speed_limits=[[0.0, 100.0], [1500.0, 40.0], [1700.0, 100.0]])
    motion = train(network, direction=direction, start_m=0.0 if direction > 0 else 4000.0)
    slowest = math.inf
    while motion.state != "arrived":
        motion.step()
        head = motion.path_m
        body = (head - 100.0, head) if direction > 0 else (head, head + 100.0)
        inside = body[1] > 1500.0 and body[0] < 1700.0
        if inside:
            slowest = min(slowest, abs(motion.speed_mps))
            assert abs(motion.speed_mps) <= 40.0 / 3.6 + 1e-9
        assert abs(motion.speed_mps) <= motion.permitted_mps + 1e-9 <= motion.limit_mps + 2e-9
    # The driver is not slower than he has to be.
    assert slowest == pytest.approx(40.0 / 3.6, abs=0.1)
    assert motion.path_m == (4000.0 if direction > 0 else 0.0)


def test_stops_dwells_and_arrives() -> None:
    network = line(3000.0, stops_m=[0.0, 1000.0, 2500.0])
    motion = train(network, dwell_s=20.0, depart_s=5.0, stop_at_m=[1200.5])
    stands: list[tuple[str, float, float]] = [("waiting", 0.0, 0.0)]
    while motion.state != "arrived":
        motion.step()
        if motion.state != stands[-1][0]:
            stands.append((motion.state, motion.time_s, motion.path_m))
    states = [state for state, _, _ in stands]
    assert states == ["waiting", "running", "dwelling", "running", "dwelling", "running", "arrived"]
    assert [p for s, _, p in stands if s in ("dwelling", "arrived")] == [1000.0, 1200.5, 2500.0]
    assert stands[1][1] == pytest.approx(5.1)
    assert stands[3][1] - stands[2][1] == pytest.approx(20.0, abs=0.11)
    assert motion.next_stop_path_m is None
    motion.step()
    assert (motion.path_m, motion.speed_mps, motion.acceleration_mps2) == (2500.0, 0.0, 0.0)


def test_without_stops_the_run_ends_with_the_track() -> None:
    motion = train(line(1500.0), speed_kmh=72.0)
    run_until(motion, "arrived")
    assert motion.path_m == motion.chainage_m == 1500.0


def test_reversal_at_a_point() -> None:
    motion = train(line(3000.0, stops_m=[500.0]), reverse_at=[{"at_m": 1400.0, "dwell_s": 7.0}])
    run_until(motion, "dwelling")
    assert (motion.path_m, motion.direction) == (500.0, 1)
    run_until(motion, "running")
    run_until(motion, "dwelling")
    assert motion.path_m == 1400.0
    arrived_s = motion.time_s
    run_until(motion, "running")
    assert motion.time_s - arrived_s == pytest.approx(7.0, abs=0.11)
    assert motion.direction == -1
    assert motion.speed_mps < 0.0
    assert motion.acceleration_mps2 < 0.0
    run_until(motion, "arrived")
    assert motion.path_m == 500.0
    assert motion.distance_m == pytest.approx(1400.0 + 900.0)


def test_reversal_at_a_time_and_back_again() -> None:
    motion = train(
        line(8000.0),
        start_m=2000.0,
        target_speed_kmh=72.0,
        speed_kmh=72.0,
        reverse_at=[{"at_s": 30.0, "dwell_s": 0.0}, {"at_m": 1500.0}],
    )
    run_until(motion, "dwelling")
    # 30 s at 20 m/s, then the driver's own braking.
    expected = 2000.0 + 600.0 + 20.0**2 / (2 * motion.planned_deceleration_mps2)
    assert motion.path_m == pytest.approx(expected)
    run_until(motion, "running")
    assert motion.direction == -1
    run_until(motion, "dwelling")
    assert motion.path_m == 1500.0
    run_until(motion, "arrived")
    assert (motion.path_m, motion.direction) == (8000.0, 1)


def test_train_waits_at_the_last_stop_to_turn_back() -> None:
    network = line(2000.0, stops_m=[0.0, 1000.0])
    motion = train(network, dwell_s=5.0, reverse_at=[{"at_s": 300.0}])
    run_until(motion, "dwelling")
    run_until(motion, "running")
    assert motion.time_s == pytest.approx(300.1, abs=0.11)
    run_until(motion, "arrived")
    assert motion.path_m == 0.0


def test_run_onto_a_branch() -> None:
    tracks = {
        "main": TrackDescription.model_validate(
            {"elements": [{"straight_m": 2000.0}], "speed_limits": [[0.0, 90.0]]}
        ),
        "branch": TrackDescription.model_validate(
            {
                "elements": [{"arc_m": 600.0, "radius_m": 300.0}],
                "speed_limits": [[0.0, 40.0]],
                "stops_m": [500.0],
            }
        ),
    }
    junctions = [JunctionDescription(track="main", at_m=1200.0, branch="branch")]
    network = build_network(tracks, junctions)
    motion = train(
        network, route=["main", "branch"], stop_at_m=[{"track": "branch", "at_m": 100.0}]
    )
    seen = []
    while motion.state != "arrived":
        motion.step()
        if not seen or seen[-1] != motion.track:
            seen.append(motion.track)
        if motion.track == "branch":
            assert motion.speed_mps <= 40.0 / 3.6 + 1e-9
            assert motion.path_m == pytest.approx(1200.0 + motion.chainage_m)
    assert seen == ["main", "branch"]
    assert motion.chainage_m == 500.0
    back = train(network, route=["branch", "main"], direction=-1, start_m=500.0)
    run_until(back, "arrived")
    assert (back.track, back.chainage_m) == ("main", 0.0)
    assert back.distance_m == pytest.approx(1700.0)


def test_description_survives_its_own_dump() -> None:
    description = TrainDescription.model_validate(
        {
            "name": "t1",
            "route": ["main", "branch"],
            "stop_at_m": [5.0, {"track": "branch", "at_m": 7.0}],
            "reverse_at": [{"at_m": 50.0}, {"at_s": 100.0}],
            "vehicle": {"preset": "regional", "mass_kg": 1e5, "davis": {"a_n": 5.0}},
        }
    )
    dumped = description.model_dump_json()
    assert TrainDescription.model_validate_json(dumped) == description


def test_two_runs_are_the_same_to_the_last_bit() -> None:
    network = line(6000.0, gradients=[[0.0, 7.0], [900.0, -13.0]], stops_m=[0.0, 3000.0])
    runs = []
    for _ in range(2):
        motion = train(network, vehicle={"preset": "regional"}, depart_s=1.0)
        run = []
        for tick in range(2500):
            motion.step(DriveCommand(max_speed_mps=10.0) if 300 < tick < 500 else None)
            run.append((motion.time_s, motion.path_m, motion.speed_mps, motion.acceleration_mps2))
        runs.append(run)
    assert runs[0] == runs[1]


@pytest.mark.parametrize(
    ("changes", "field", "reason"),
    [
        ({"route": ["siding"]}, "route.0", "no such track"),
        ({"start_m": 10_001.0}, "start_m", "off the route"),
        ({"stop_at_m": [5.0, 1e5]}, "stop_at_m.1", "off the route"),
        ({"stop_at_m": [{"track": "siding", "at_m": 5.0}]}, "stop_at_m.0", "does not use"),
        ({"reverse_at": [{"at_m": 1e5}]}, "reverse_at.0.at_m", "off the route"),
        ({"start_m": 500.0, "reverse_at": [{"at_m": 400.0}]}, "reverse_at.0.at_m", "ahead"),
        ({"reverse_at": [{"at_m": 400.0}, {"at_m": 500.0}]}, "reverse_at.1.at_m", "ahead"),
        ({"speed_kmh": 361.0}, "speed_kmh", "permitted at the start"),
        ({"speed_kmh": 100.0, "target_speed_kmh": 90.0}, "speed_kmh", "90.0 km/h permitted"),
        ({"speed_kmh": 100.0, "start_m": 9990.0}, "speed_kmh", "permitted at the start"),
        ({"speed_kmh": 100.0, "start_m": 10_000.0}, "speed_kmh", "0.0 km/h permitted"),
    ],
)
def test_trains_that_do_not_fit_are_refused(
    changes: dict[str, Any], field: str, reason: str
) -> None:
    with pytest.raises(WorldDataError, match=reason) as caught:
        train(**changes)
    assert caught.value.field == f"trains.t1.{field}"


def test_train_that_could_not_hold_the_slope_is_refused() -> None:
    with pytest.raises(WorldDataError, match="too weak for a slope of 110 per mille"):
        train(line(gradients=[[0.0, -110.0]]))


def test_slopes_take_from_the_planned_braking() -> None:
    assert train().planned_deceleration_mps2 == pytest.approx(0.8)
    steep = train(line(gradients=[[0.0, 60.0]]))
    assert steep.planned_deceleration_mps2 == pytest.approx(1.0 - 9.80665 * 0.060)


@pytest.mark.parametrize("gradient_permil", [-60.0, 60.0])
def test_stops_exactly_on_steep_slopes(gradient_permil: float) -> None:
    network = line(3000.0, gradients=[[0.0, gradient_permil]], stops_m=[2000.0])
    motion = train(network, vehicle={"preset": "metro"})
    while motion.state != "arrived":
        motion.step()
        # No more than the brake gives against the slope.
        assert motion.acceleration_mps2 >= -1.0 - 9.81 * 0.060
    assert motion.path_m == 2000.0


def test_train_that_enters_at_departure_enters_at_speed() -> None:
    motion = train(depart_s=3.0, speed_kmh=72.0, target_speed_kmh=72.0, enters_at_departure=True)
    for _ in range(30):
        motion.step()
    assert (motion.state, motion.speed_mps, motion.path_m) == ("waiting", 0.0, 0.0)
    for _ in range(10):
        motion.step()
        assert motion.acceleration_mps2 == 0.0
    assert (motion.speed_mps, motion.path_m) == (20.0, pytest.approx(20.0))


@pytest.mark.parametrize("direction", [1, -1])
def test_train_that_leaves_runs_out_of_the_track(direction: int) -> None:
    motion = train(
        line(2000.0),
        start_m=1000.0,
        direction=direction,
        speed_kmh=180.0,
        target_speed_kmh=180.0,
        leaves_on_arrival=True,
    )
    while motion.state != "arrived":
        assert abs(motion.speed_mps) == pytest.approx(50.0)
        motion.step()
    assert motion.time_s == pytest.approx(20.0, abs=0.11)
    assert motion.path_m == (2000.0 if direction > 0 else 0.0)
    assert motion.distance_m == pytest.approx(1000.0)
    assert (motion.speed_mps, motion.acceleration_mps2) == (0.0, 0.0)


def test_train_that_leaves_still_stops_at_its_last_stop() -> None:
    motion = train(line(2000.0, stops_m=[1500.0]), leaves_on_arrival=True)
    run_until(motion, "arrived")
    assert motion.path_m == 1500.0


@pytest.mark.parametrize("tick_s", [0.0, -1.0, math.nan, 1e9])
def test_tick_is_a_time(tick_s: float) -> None:
    with pytest.raises(ValueError, match="tick_s"):
        train(tick_s=tick_s)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"name": "Train 1"}, "name"),
        ({"name": "1t"}, "name"),
        ({"name": "t" * 41}, "name"),
        ({"route": []}, "route"),
        ({"route": ["main", "main"]}, "route"),
        ({"start_m": -1.0}, "start_m"),
        ({"start_m": math.nan}, "start_m"),
        ({"depart_s": -1.0}, "depart_s"),
        ({"speed_kmh": -1.0}, "speed_kmh"),
        ({"speed_kmh": 50.0, "depart_s": 5.0}, "speed_kmh"),
        ({"direction": 0}, "direction"),
        ({"direction": "up"}, "direction"),
        ({"dwell_s": math.inf}, "dwell_s"),
        ({"target_speed_kmh": 0.0}, "target_speed_kmh"),
        ({"stop_at_m": 5.0}, "stop_at_m"),
        ({"stop_at_m": [-5.0]}, "stop_at_m.0.at_m"),
        ({"stop_at_m": [True]}, "stop_at_m.0"),
        ({"reverse_at": [{}]}, "either at_m or at_s"),
        ({"reverse_at": [{"at_m": 1.0, "at_s": 1.0}]}, "either at_m or at_s"),
        ({"reverse_at": [{"at_s": 1.0, "track": "main"}]}, "goes with at_m only"),
        ({"reverse_at": [{"at_s": -1.0}]}, "reverse_at.0.at_s"),
        ({"vehicle": "metro"}, "vehicle"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_wrong_trains_are_refused_by_field(change: dict[str, Any], field: str) -> None:
    with pytest.raises(ValidationError) as caught:
        TrainDescription.model_validate({"name": "t1", "route": ["main"], **change})
    first = caught.value.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    assert field in f"{where}: {first['msg']}"
