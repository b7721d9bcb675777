"""Safety: a small scenario is drawn, and what goes wrong in it.

Two to four trains of 20 to 400 m on a short line that falls and rises by up to 40 per mille, with
limits, ticks from 0.1 to 1 s, with and without a localizer, on a link with margin or one that loses
frames, with drivers who see what is permitted or heed nothing but the line's limits.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from pydantic import Field, field_validator

from rail_corridor.loading.schema import parse_scenario
from rail_corridor.study.sources import Drawn
from rail_corridor.study.strict import Strict

from .faults import FAULT_KINDS, LATEST_END_S, FaultKind, draw_faults

#: Time that a train has for going on after the last fault [s].
GOES_ON_S: Final = 60.0
_TICKS_S: Final = {0.1: 0.06, 0.2: 0.1, 0.25: 0.19, 0.5: 0.35, 1.0: 0.3}
_LIMITS_KMH: Final = (25.0, 40.0, 60.0, 80.0)
_STEEPEST_PERMIL: Final = 40.0
_NAMES: Final = ("a", "b", "c", "d")
_SHORTEST_M, _LONGEST_M = 20.0, 400.0
#: Least clear distance between trains at the start, and of the last one to the end of the track.
_CLEAR_M: Final = 25.0
#: Way that the foremost train has before its stop, and what is left of the track beyond.
_LEAST_WAY_M, _MOST_WAY_M, _BEYOND_M = 500.0, 1300.0, 150.0
_STREAM: Final = 92


class SafetyParameters(Strict):
    """What of all that can go wrong is drawn."""

    localizer: float = Field(0.4, ge=0.0, le=1.0, description="share of runs with a localizer")
    heedless: float = Field(0.3, ge=0.0, le=1.0, description="share with heedless drivers")
    released: float = Field(
        0.25, ge=0.0, le=1.0, description="share in which people release the trains, on sight"
    )
    kinds: tuple[FaultKind, ...] = Field(
        FAULT_KINDS, min_length=1, description="kinds of faults that are drawn"
    )

    @field_validator("kinds")
    @classmethod
    def _each_once(cls, kinds: tuple[FaultKind, ...]) -> tuple[FaultKind, ...]:
        if len(set(kinds)) != len(kinds):
            raise ValueError("one comes twice")
        return kinds


def draw_safety(parameters: SafetyParameters, seed: int) -> Drawn:
    """Two to four trains on a short steep line, some of whose equipment fails and comes back.

    Parameters
    ----------
    parameters : SafetyParameters
    seed : int
        Of everything: the scenario, its noise, and the faults.
    """
    rng = np.random.default_rng([seed, _STREAM])
    data = _line(seed, rng, parameters)
    drawn = draw_faults(parse_scenario(data), parameters.kinds, rng)
    duration_s = max(drawn.last_end_s, 10.0) + GOES_ON_S
    data |= {"duration_s": round(duration_s + 2.0 * data["tick_s"], 2)}
    if drawn.faults:
        data["faults"] = list(drawn.faults)
    if rng.random() < parameters.released:
        data["actions"] = _releases(rng, data["trains"], drawn.last_end_s)
    facts = {
        "fault": "+".join(sorted(drawn.kinds)) or "none",
        "tick_s": data["tick_s"],
        "trains": len(data["trains"]),
        "localizer": "localizer" in data,
        "heedless": not data["cbtc"]["cab_signals"],
        "released": "actions" in data,
        "loss_db": data["cbtc"]["extra_loss_db"],
        "last_end_s": drawn.last_end_s,
        "faults": str(drawn),
    }
    return Drawn(data, drawn.kills, facts)


def _releases(
    rng: np.random.Generator, trains: list[dict[str, Any]], last_end_s: float
) -> list[dict[str, Any]]:
    """Whoever is held may go on by sight, sooner or later after the faults."""
    return [
        {
            "kind": "release_on_sight",
            "train": train["name"],
            "at_s": round(last_end_s + float(rng.uniform(-5.0, 20.0)), 1) if last_end_s else 5.0,
        }
        for train in trains
    ]


def _line(seed: int, rng: np.random.Generator, parameters: SafetyParameters) -> dict[str, Any]:
    trains, length_m, zone_m = _placed(rng)
    data: dict[str, Any] = {
        "name": "safety",
        "description": "One run of the study of safety",
        "seed": seed,
        "tick_s": float(rng.choice(list(_TICKS_S), p=list(_TICKS_S.values()))),
        "duration_s": LATEST_END_S + GOES_ON_S,
        "tracks": {
            "main": {
                "elements": [{"straight_m": length_m}],
                "gradients": _gradients(rng, length_m),
                "speed_limits": _limits(rng, length_m),
                "stops_m": [round(length_m - _BEYOND_M, 1)],
            }
        },
        "stations": {"zone_length_m": zone_m},
        "cbtc": {
            "base_spacing_m": float(rng.choice([600.0, 1000.0])),
            # Half of the runs have a link with margin, half one that loses frames.
            "extra_loss_db": round(float(rng.choice([0.0, rng.uniform(5.0, 22.0)])), 1),
            "timeout_s": float(rng.choice([3.0, 5.0])),
            "cab_signals": bool(rng.random() >= parameters.heedless),
        },
        "trains": trains,
    }
    if rng.random() < parameters.localizer:
        data |= {"references": {"spacing_m": 500.0}, "localizer": {}}
    return data


def _placed(rng: np.random.Generator) -> tuple[list[dict[str, Any]], float, float]:
    """Trains, length of the line, and of its zones, in each of which one train starts at most."""
    while True:
        most_m = float(rng.uniform(250.0, 380.0))
        trains = _trains(rng, most_m)
        ahead_m = float(rng.uniform(_LEAST_WAY_M, _MOST_WAY_M))
        length_m = round(trains[0]["start_m"] + ahead_m + _BEYOND_M, 1)
        # Zones are all alike, and none is longer.
        zone_m = length_m / math.ceil(length_m / round(most_m, 1))
        if len({int(train["start_m"] / zone_m) for train in trains}) == len(trains):
            return trains, length_m, round(most_m, 1)


def _trains(rng: np.random.Generator, zone_m: float) -> list[dict[str, Any]]:
    """Trains in the order in which they run, a zone apart as a rule."""
    trains: list[dict[str, Any]] = []
    least_m = 0.0
    for name in reversed(_NAMES[: int(rng.integers(2, 5))]):
        long_m = float(np.exp(rng.uniform(np.log(_SHORTEST_M), np.log(_LONGEST_M))))
        front_m = least_m + long_m + float(rng.uniform(2.0, 200.0))
        if trains and int(front_m / zone_m) == int(trains[0]["start_m"] / zone_m):
            front_m = (int(front_m / zone_m) + 1) * zone_m + 5.0 + float(rng.uniform(0.0, 50.0))
        least_m = front_m + _CLEAR_M
        train: dict[str, Any] = {
            "name": name,
            "route": ["main"],
            "start_m": round(front_m, 1),
            "vehicle": {"length_m": round(long_m, 1)},
        }
        if rng.random() < 0.3:
            train["depart_s"] = round(float(rng.uniform(1.0, 12.0)), 1)
        trains.insert(0, train)
    return trains


def _gradients(rng: np.random.Generator, length_m: float) -> list[list[float]]:
    """Slopes of 200 to 600 m, level in every third run."""
    if rng.random() < 1.0 / 3.0:
        return []
    found: list[list[float]] = []
    at_m = 0.0
    while at_m < length_m - 50.0:
        slope = float(rng.uniform(-_STEEPEST_PERMIL, _STEEPEST_PERMIL))
        found.append([round(at_m, 1), round(slope, 1)])
        at_m += float(rng.uniform(200.0, 600.0))
    return found


def _limits(rng: np.random.Generator, length_m: float) -> list[list[float]]:
    found: list[list[float]] = []
    at_m = 0.0
    while at_m < length_m - 50.0:
        limit_kmh = float(rng.choice(_LIMITS_KMH, p=[0.1, 0.2, 0.25, 0.45]))
        if not found or limit_kmh != found[-1][1]:
            found.append([round(at_m, 1), limit_kmh])
        at_m += float(rng.uniform(250.0, 700.0))
    return found
