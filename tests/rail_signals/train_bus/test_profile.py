"""Profiles of train bus cables: the tables of S2, Fig 6, and what is refused."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from rail_signals.train_bus.profile import bus_profile_names, load_bus_profile

CM2 = load_bus_profile("CM2")


@pytest.mark.parametrize(
    ("name", "length_m", "limits_m"),
    [("CM2", 47, (42.3, 51.7)), ("CM3", 47, (42.3, 51.7)), ("CM4", 27, (24.3, 29.7))],
)
def test_the_tables(name: str, length_m: float, limits_m: tuple[float, float]) -> None:
    profile = load_bus_profile(name)
    assert profile.length_m == length_m
    assert profile.length_limits_m == pytest.approx((0.9 * length_m, 1.1 * length_m))
    assert profile.length_limits_m == limits_m
    assert profile.impedance_limits_ohm == (95.0, 115.0)
    assert profile.attenuation_limit_db == 15.0


def test_cables_have_velocities_of_their_own() -> None:
    """0.428 of light for the example, 0.66 for polyethylene: 65 and 42.1 pF/m at 120 ohm."""
    example, solid = load_bus_profile("example").cable, load_bus_profile("polyethylene").cable
    assert example.velocity_m_per_s == pytest.approx(1.282e8, abs=5e4)
    assert solid.velocity_m_per_s == pytest.approx(0.66 * 299_792_458)
    assert example.capacitance_f_per_m == 65e-12
    assert solid.capacitance_f_per_m == pytest.approx(42.1e-12, abs=5e-14)
    # The example fails the document's own window: kinds of cable are profiles, not constants.
    low, high = CM2.impedance_limits_ohm
    assert not low <= example.impedance_ohm <= high


def test_the_train_bus() -> None:
    wtb = load_bus_profile("wtb")
    assert wtb.impedance_limits_ohm == (108.0, 132.0)
    assert wtb.attenuation_limit_db_per_km == 10.0
    assert (wtb.longest_bus_m, wtb.most_nodes) == (860.0, 32)


def test_every_profile_loads_and_owns_up() -> None:
    for name in bus_profile_names():
        profile = load_bus_profile(name)
        assert profile.name == name
        assert profile.unconfirmed and profile.source and profile.description
    with pytest.raises(ValueError, match=r"name must be one of .*'CM5'"):
        load_bus_profile("CM5")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"length_limits_m": (51.7, 42.3)}, "length_limits_m must be two rising"),
        ({"impedance_limits_ohm": (0.0, 115.0)}, "impedance_limits_ohm must be two rising"),
        ({"impedance_limits_ohm": (107.0, 115.0)}, "cable must have an impedance within 107"),
        ({"length_m": 52.0}, "length_m must lie within its limits, got 52.0"),
        ({"attenuation_limit_db": None}, "must be given, not both, got None and None"),
        ({"attenuation_limit_db_per_km": 10.0}, "must be given, not both, got 15.0 and 10.0"),
        ({"attenuation_limit_db": -1.0}, "attenuation_limit_db must be above 0 or nothing"),
        ({"termination_ohm": 0.0}, "termination_ohm must be above 0, got 0.0"),
        ({"most_nodes": 1}, "most_nodes must be 2 or more, got 1"),
    ],
)
def test_what_a_profile_refuses(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        dataclasses.replace(CM2, **changes)
