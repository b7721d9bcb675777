from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from rail_world.line.description import TrackDescription
from rail_world.line.network import Network, build_network
from rail_world.trains.description import VehicleDescription
from rail_world.trains.vehicle import GRAVITY_MPS2, Extent, LineForces, Vehicle, curve_resistance


def network(**description: Any) -> Network:
    return build_network({"main": TrackDescription.model_validate(description)})


def test_preset_fills_what_is_left_out() -> None:
    metro = VehicleDescription.model_validate({})
    assert (metro.preset, metro.mass_kg, metro.max_speed_kmh) == ("metro", 278e3, 80.0)
    fast = VehicleDescription.model_validate(
        {"preset": "high_speed", "mass_kg": 450e3, "davis": {"a_n": 1.0}}
    )
    assert (fast.mass_kg, fast.max_speed_kmh) == (450e3, 500.0)
    assert (fast.davis.a_n, fast.davis.c_n_per_mps2) == (1.0, 5.5)
    assert VehicleDescription.model_validate(fast.model_dump()) == fast


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"preset": "monorail"}, "preset"),
        ({"preset": ["metro"]}, "preset"),
        ({"mass_kg": 0.0}, "mass_kg"),
        ({"mass_kg": math.nan}, "mass_kg"),
        ({"rotating_mass_factor": 0.9}, "rotating_mass_factor"),
        ({"davis": {"a_n": -1.0}}, "davis.a_n"),
        ({"davis": {"d_n": 1.0}}, "davis.d_n"),
        ({"davis": 5.0}, "davis"),
        ({"max_traction_n": 0.0}, "max_traction_n"),
        ({"max_power_w": 1e300}, "max_power_w"),
        ({"max_service_brake_mps2": 0.0}, "max_service_brake_mps2"),
        ({"max_service_brake_mps2": 1.5}, "emergency_brake_mps2: 1.3 is weaker"),
        ({"max_speed_kmh": "fast"}, "max_speed_kmh"),
        ({"length_m": -4.0}, "length_m"),
        ({"weight_kg": 4.0}, "weight_kg"),
    ],
)
def test_wrong_vehicles_are_refused_by_field(change: dict[str, Any], field: str) -> None:
    with pytest.raises(ValidationError) as caught:
        VehicleDescription.model_validate(change)
    first = caught.value.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    assert field in f"{where}: {first['msg']}"
    assert len(caught.value.errors()) == 1


@pytest.mark.parametrize(
    ("radius_m", "newton_per_kilonewton"),
    [(705.0, 1.0), (300.0, 650.0 / 245.0), (280.0, 2.0), (-280.0, 2.0), (100.0, 500.0 / 70.0)],
)
def test_roeckl(radius_m: float, newton_per_kilonewton: float) -> None:
    assert float(curve_resistance(1 / radius_m)) * 1e3 == pytest.approx(newton_per_kilonewton)


def test_roeckl_is_finite_for_every_curvature() -> None:
    values = curve_resistance([0.0, 1 / 55.0, 1 / 30.0, -1 / 20.0])
    np.testing.assert_allclose(values * 1e3, [0.0, *3 * [500.0 / 70.0]])


def test_traction_is_limited_by_force_then_by_power() -> None:
    vehicle = Vehicle(VehicleDescription.model_validate({}))
    mass_kg = 278e3 * 1.06
    assert vehicle.effective_mass_kg == mass_kg
    assert vehicle.traction_mps2(0.0) == pytest.approx(310e3 / mass_kg)
    assert vehicle.traction_mps2(9.9) == pytest.approx(310e3 / mass_kg)
    assert vehicle.traction_mps2(20.0) == pytest.approx(3.1e6 / 20.0 / mass_kg)


def test_davis() -> None:
    vehicle = Vehicle(VehicleDescription.model_validate({"preset": "regional"}))
    at_100_kmh_n = vehicle.running_resistance_mps2(100.0 / 3.6) * vehicle.effective_mass_kg
    # The library gives the coefficients in kN and km/h.
    assert at_100_kmh_n == pytest.approx(1e3 * (2.37888 + 1.698165 + 9.3264))


def test_high_speed_preset_has_the_power_for_500_kmh() -> None:
    vehicle = Vehicle(VehicleDescription.model_validate({"preset": "high_speed"}))
    speed_mps = 500.0 / 3.6
    assert vehicle.traction_mps2(speed_mps) > vehicle.running_resistance_mps2(speed_mps)


def test_slope_is_the_mean_under_the_train() -> None:
    track = network(
        elements=[{"straight_m": 1000.0}], gradients=[[0.0, 0.0], [400.0, 20.0], [900.0, -5.0]]
    )
    forces = LineForces(track.route(["main"]), Extent(100.0, 0.0))
    assert forces.steepest == pytest.approx(0.02)
    assert forces.slope_sine(400.0) == 0.0
    assert forces.slope_sine(450.0) == pytest.approx(math.sin(math.atan(0.010)))
    assert forces.slope_sine(600.0) == pytest.approx(math.sin(math.atan(0.020)))
    # A train that reaches beyond the end stands on the last slope.
    behind = LineForces(track.route(["main"]), Extent(0.0, 100.0))
    assert behind.slope_sine(990.0) == pytest.approx(-math.sin(math.atan(0.005)))


def test_curve_resistance_is_the_mean_under_the_train() -> None:
    track = network(
        elements=[
            {"straight_m": 300.0},
            {"clothoid_m": 100.0, "to_radius_m": 355.0},
            {"arc_m": 300.0, "radius_m": 355.0},
        ]
    )
    forces = LineForces(track.route(["main"]), Extent(100.0, 0.0))
    assert forces.curve_resistance(300.0) == 0.0
    assert forces.curve_resistance(600.0) == pytest.approx(650.0 / 300.0 * 1e-3)
    # On the clothoid k = s / (355 * 100), the mean of 0.65 k / (1 - 55 k) in closed form.
    k = 1.0 / 355.0
    mean = 0.650 / k * (-k / 55.0 - math.log(1.0 - 55.0 * k) / 55.0**2)
    assert forces.curve_resistance(400.0) == pytest.approx(mean, rel=1e-3)


def test_slope_and_curve_cost_nothing_where_there_are_none() -> None:
    forces = LineForces(network(elements=[{"straight_m": 10.0}]).route(["main"]), Extent(5.0, 0.0))
    assert forces.level
    assert (forces.slope_sine(5.0), forces.curve_resistance(5.0)) == (0.0, 0.0)


def test_gravity_acts_on_the_true_mass() -> None:
    vehicle = Vehicle(VehicleDescription.model_validate({"rotating_mass_factor": 1.25}))
    assert vehicle.gravity_mps2 == pytest.approx(GRAVITY_MPS2 / 1.25)
