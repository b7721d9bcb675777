"""The zone map: from distance to chainage on every shape of track; ways across junctions."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from rail_signals.arrays import FloatArray
from rail_wayside.ranging.zone_map import NEIGHBOURHOOD, MappedZone, ZoneMap

OFFSET_M, HEIGHT_M = 3.0, 5.0


def straight(s_m: FloatArray) -> FloatArray:
    """Distance from a mast beside chainage 0 of a straight track."""
    return np.asarray(np.sqrt(s_m**2 + OFFSET_M**2 + HEIGHT_M**2))


def curved(radius_m: float, s_m: FloatArray) -> FloatArray:
    """Distance from a mast outside chainage 0 of an arc: law of cosines to its centre."""
    mast_m = radius_m + OFFSET_M
    chord2_m2 = mast_m**2 + radius_m**2 - 2 * mast_m * radius_m * np.cos(s_m / radius_m)
    return np.asarray(np.sqrt(chord2_m2 + HEIGHT_M**2))


def fine_then_coarse(length_m: float) -> FloatArray:
    return np.concatenate([np.arange(0.0, 20.0, 0.05), np.arange(20.0, length_m + 0.5, 1.0)])


def zone(
    name: str = "z", start_m: float = 500.0, length_m: float = 200.0, **more: str
) -> MappedZone:
    """Return a zone on straight track with a table that goes on through the next zone."""
    s_m = fine_then_coarse(2.0 * length_m)
    settings = {"site": f"wrs_{name}", "track": "main", **more}
    return MappedZone(
        name, settings["site"], settings["track"], start_m, start_m + length_m, start_m + s_m,
        straight(s_m),
    )  # fmt: skip


# The table --------------------------------------------------------------------------------


@pytest.mark.parametrize("radius_m", [math.inf, 200.0, 450.0])
def test_every_place_of_a_zone_is_found_again(radius_m: float) -> None:
    s_m = fine_then_coarse(400.0)
    distance_m = straight(s_m) if math.isinf(radius_m) else curved(radius_m, s_m)
    here = MappedZone("z", "wrs", "main", 1000.0, 1200.0, 1000.0 + s_m, distance_m)
    for way_m in np.linspace(0.5, 399.0, 300):
        array = np.array(way_m)
        exact = straight(array) if math.isinf(radius_m) else curved(radius_m, array)
        found = here.locate(float(exact), 0.01)
        assert found is not None
        # What linear interpolation leaves, largest beside the mast.
        assert found[0] - 1000.0 == pytest.approx(way_m, abs=0.01)


@pytest.mark.parametrize("way_m", [2.0, 10.0, 57.3, 180.0])
def test_the_variance_follows_the_slope_of_the_table(way_m: float) -> None:
    distance_m = float(straight(np.array(way_m)))
    found = zone(start_m=0.0).locate(distance_m, 0.04)
    assert found is not None
    # ds/dd = d/s on a straight track: beside the mast a range says little of the place.
    assert found[1] == pytest.approx(0.04 * (distance_m / way_m) ** 2, rel=0.06)


def test_closer_than_the_track_passes_is_beside_the_mast() -> None:
    nearest_m = math.hypot(OFFSET_M, HEIGHT_M)
    for range_m in (nearest_m, nearest_m - 0.5, nearest_m - 1.5):
        found = zone().locate(range_m, 0.04)
        assert found is not None
        assert found[0] == 500.0
        # Such a range tells nothing finer than the bend of the table.
        assert found[1] > 100.0 * 0.04


def test_much_closer_than_the_track_passes_is_nowhere() -> None:
    # A range that the comparator has folded: from beyond its unambiguous interval.
    for range_m in (3.5, 0.0, -15.0):
        assert zone().locate(range_m, 0.04) is None


def test_past_the_end_of_the_table_is_nowhere() -> None:
    end_m = float(zone().distance_m[-1])
    for sigma_m in (0.1, 2.0):
        inside = zone().locate(end_m + 3.9 * sigma_m, sigma_m**2)
        assert inside is not None
        assert inside[0] == pytest.approx(900.0)
        assert zone().locate(end_m + 4.1 * sigma_m, sigma_m**2) is None


# The ways ---------------------------------------------------------------------------------


def junction() -> ZoneMap:
    """Return zones a, b, then main c, d and branch e, f; chainage of the branch starts at 0."""
    zones = [
        zone("a", 0.0, 200.0),
        zone("b", 200.0, 300.0),
        zone("c", 500.0, 150.0),
        zone("d", 650.0, 150.0),
        zone("e", 60.0, 180.0, track="branch"),
        zone("f", 240.0, 100.0, track="branch"),
    ]
    return ZoneMap(zones, {"a": ["b"], "b": ["c", "e"], "c": ["d"], "e": ["f"]})


@pytest.mark.parametrize(
    ("start", "end", "way_m"),
    [
        (("a", 50.0), ("a", 150.0), 100.0),
        (("a", 50.0), ("b", 250.0), 200.0),
        (("a", 50.0), ("c", 550.0), 500.0),
        (("a", 50.0), ("d", 700.0), 650.0),
        # Zone b ends at 500 where zone e begins, at 60 of the branch.
        (("b", 490.0), ("e", 70.0), 20.0),
        (("a", 50.0), ("f", 250.0), 150.0 + 300.0 + 180.0 + 10.0),
        # Places past the end of a zone, as its table goes on, count on.
        (("b", 510.0), ("e", 70.0), 0.0),
    ],
)
def test_the_way_is_the_same_there_and_back(
    start: tuple[str, float], end: tuple[str, float], way_m: float
) -> None:
    lines = junction()
    assert lines.path_distance_m(*start, *end) == pytest.approx(way_m)
    assert lines.path_distance_m(*end, *start) == pytest.approx(-way_m)


@pytest.mark.parametrize(("one", "other"), [("c", "e"), ("c", "f"), ("d", "f")])
def test_no_train_gets_from_one_leg_to_the_other_without_reversing(one: str, other: str) -> None:
    lines = junction()
    here, there = lines.zones[one], lines.zones[other]
    assert lines.path_distance_m(one, here.start_m, other, there.start_m) is None
    assert lines.path_distance_m(other, there.start_m, one, here.start_m) is None


def test_what_is_far_away_is_out_of_reach() -> None:
    names = [f"z{n}" for n in range(8)]
    zones = [zone(name, 200.0 * n) for n, name in enumerate(names)]
    lines = ZoneMap(zones, {a: [b] for a, b in itertools.pairwise(names)})
    for n, name in enumerate(names):
        way_m = lines.path_distance_m("z0", 0.0, name, 200.0 * n)
        assert way_m == (200.0 * n if n <= NEIGHBOURHOOD else None)


def test_the_length_of_a_zone() -> None:
    assert zone(start_m=500.0, length_m=200.0).length_m == 200.0
