"""Handovers: scenarios in which trains cross many stations are drawn.

Two corridors: *plain* alternates two channel pairs along one track (Jeong et al., Fig 7);
*branching* has a junction whose station watches both tracks, and half of the trains take the
branch (Fig 8). Trains run through, stand at stations, or turn back over them.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np
from pydantic import Field

from rail_corridor.equipment.ranging.layout import Layout, Zone, layout_of
from rail_corridor.loading.schema import parse_scenario
from rail_corridor.study.sources import Drawn
from rail_corridor.study.strict import Strict

Corridor = Literal["plain", "branching"]
Manoeuvre = Literal["running", "standing", "reversing"]

ZONE_M = 200.0
#: Trains of one run: through trains follow each other, the others have a stretch each.
MOST_TRAINS: dict[Manoeuvre, int] = {"running": 10, "standing": 4, "reversing": 4}

_PLAIN_M = 4000.0
_TRUNK_M = 2000.0
_AFTER_M = 2200.0
#: Trains stay out of the reach of each other's stations: two zones ahead, two behind.
_APART_M = 5.0 * ZONE_M
_HEADWAY_S = 32.0
#: Lateral acceleration that the branch is built for [m/s^2], and its tightest radius [m].
_LATERAL_MPS2 = 0.65
_TIGHTEST_M = 300.0
_ARC_OFFSET_M = 12.0
_STANDS = 4
_TURNS = 12
_MANOEUVRES_S = 200.0


class HandoverParameters(Strict):
    """A situation, and how many trains are in it: manoeuvres have room for four."""

    corridor: Corridor = "plain"
    manoeuvre: Manoeuvre = "running"
    speed_kmh: float = Field(80.0, ge=10.0, le=500.0)
    trains: int = Field(4, ge=1, le=10)

    @property
    def name(self) -> str:
        """Name of its scenarios."""
        return f"{self.corridor}_{self.manoeuvre}_{self.speed_kmh:.0f}"


def draw_handover(parameters: HandoverParameters, seed: int) -> Drawn:
    """Trains that cross the stations of a plain or a branching line.

    Parameters
    ----------
    parameters : HandoverParameters
    seed : int
        Of everything random: where trains start and turn, noise, oscillators, transponders.
    """
    return Drawn(
        _scenario(parameters, min(parameters.trains, MOST_TRAINS[parameters.manoeuvre]), seed)
    )


def _scenario(situation: HandoverParameters, trains: int, seed: int) -> dict[str, Any]:
    rng = np.random.default_rng([seed, 90])
    data: dict[str, Any] = {
        "name": situation.name,
        "description": "One run of the study of handovers",
        "seed": seed,
        "tick_s": 0.1,
        "duration_s": _MANOEUVRES_S,
        "end_when_arrived": True,
        "stations": {"zone_length_m": ZONE_M},
        **_tracks(situation),
    }
    if situation.manoeuvre == "running":
        data["trains"] = [_through_train(situation, index, rng) for index in range(trains)]
        route_m = max(_PLAIN_M, _TRUNK_M + _AFTER_M)
        last_s = data["trains"][-1]["depart_s"]
        data["duration_s"] = last_s + route_m / (situation.speed_kmh / 3.6) + 2.0
    else:
        layout = layout_of(parse_scenario(data))
        places = _places(situation, layout, seed)[:trains]
        data["trains"] = [
            _shunting_train(situation, f"train_{index + 1}", *place, rng)
            for index, place in enumerate(places)
        ]
    return data


def _tracks(situation: HandoverParameters) -> dict[str, Any]:
    limits = [[0, situation.speed_kmh]]
    if situation.corridor == "plain":
        main = {"elements": [{"straight_m": _PLAIN_M}], "speed_limits": limits}
        return {"tracks": {"main": main}}
    radius_m = max(_TIGHTEST_M, (situation.speed_kmh / 3.6) ** 2 / _LATERAL_MPS2)
    # The arc ends where the tracks are well apart; the rest of the branch runs straight.
    arc_m = math.sqrt(2.0 * radius_m * _ARC_OFFSET_M)
    branch = [
        {"arc_m": arc_m, "radius_m": radius_m},
        {"clothoid_m": 0.4 * arc_m, "from_radius_m": radius_m},
        {"straight_m": _AFTER_M - 1.4 * arc_m},
    ]
    trunk = [{"straight_m": _TRUNK_M + _AFTER_M}]
    return {
        "tracks": {
            "main": {"elements": trunk, "speed_limits": limits},
            "branch": {"elements": branch, "speed_limits": limits},
        },
        "junctions": [{"track": "main", "at_m": _TRUNK_M, "branch": "branch"}],
    }


def _route(situation: HandoverParameters, index: int) -> list[str]:
    """Every other train takes the branch, where there is one."""
    return ["main", "branch"] if situation.corridor == "branching" and index % 2 else ["main"]


def _through_train(
    situation: HandoverParameters, index: int, rng: np.random.Generator
) -> dict[str, Any]:
    apart_s = max(_HEADWAY_S, _APART_M / (situation.speed_kmh / 3.6))
    return {
        "name": f"train_{index + 1}",
        "route": _route(situation, index),
        # Trains meet the stations in every phase of the tick.
        "start_m": 10.0 + 100.0 * rng.random(),
        "depart_s": index * apart_s,
        "speed_kmh": situation.speed_kmh,
        "enters_at_departure": True,
        "leaves_on_arrival": True,
        "vehicle": {"preset": "high_speed"},
    }


def _places(
    situation: HandoverParameters, layout: Layout, seed: int
) -> list[tuple[list[str], float, list[Zone]]]:
    """Route, chainage to start near, and zones ahead of each train that stands or turns back."""
    main = [zone for zone in layout.zones if zone.track == "main"]
    if situation.corridor == "plain":
        first = (1, 6, 11, 16)
        return [(["main"], main[index].start_m, main[index:]) for index in first]
    branch = [zone for zone in layout.zones if zone.track == "branch"]
    parting = next(i for i, zone in enumerate(main) if zone.station == branch[0].station)
    at_m = main[parting].start_m
    # One train at the junction, bound for either track; the others where it does not reach.
    if seed % 2:
        at_junction = (["main", "branch"], at_m, branch[:5])
    else:
        at_junction = (["main"], at_m, main[parting : parting + 5])
    return [
        at_junction,
        (["main"], main[parting - 6].start_m, main[parting - 6 : parting - 2]),
        (["branch"], branch[6].start_m, branch[6:]),
    ]


def _shunting_train(
    situation: HandoverParameters,
    name: str,
    route: list[str],
    at_m: float,
    ahead: list[Zone],
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Return a train that stands at the next stations, or turns back over the next one."""
    train: dict[str, Any] = {
        "name": name,
        "route": route,
        "start_m": at_m - 80.0 - 50.0 * rng.random(),
        "target_speed_kmh": situation.speed_kmh,
    }
    if situation.manoeuvre == "standing":
        # Every other stop is exactly at the station, the others within a few metres.
        train["dwell_s"] = 6.0
        train["stop_at_m"] = [
            {"track": zone.track, "at_m": zone.start_m + (index % 2) * rng.uniform(-6.0, 6.0)}
            for index, zone in enumerate(ahead[:_STANDS])
        ]
        return train
    turns = []
    for index in range(_TURNS):
        depth_m = rng.uniform(1.0, 8.0) if index % 6 > 3 else rng.uniform(28.0, 55.0)
        side = -1.0 if index % 2 else 1.0
        place_m = ahead[0].start_m + side * depth_m
        turns.append({"track": ahead[0].track, "at_m": place_m, "dwell_s": 1.0})
    train["reverse_at"] = turns
    return train
