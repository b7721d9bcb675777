"""Kills: a small scenario is drawn, the equipment that dies in it, and when.

Three metro trains start close together on a line of 2.5 to 3 km with three base stations. What
is drawn besides: gradients, a lower limit, the loss of the train radio, where the trains start,
and, in every other run or so, a train that stops unexpectedly.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from pydantic import Field

from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.equipment.ranging.nodes import CONTROLLER, MEDIUM
from rail_corridor.equipment.train_radio.nodes import CBTC_MEDIUM
from rail_corridor.equipment.train_radio.placement import bases_of
from rail_corridor.loading.schema import parse_scenario
from rail_corridor.run.kills import Kill
from rail_corridor.scenario.model import Scenario
from rail_corridor.study.sources import Drawn
from rail_corridor.study.strict import Strict

DURATION_S: Final = 70.0
TICK_S: Final = 0.25
#: When equipment dies.
EARLIEST_S, LATEST_S = 2.0, 45.0
TRAINS: Final = ("first", "second", "third")
#: A kind of equipment is drawn first, then one piece of it, so that each kind has its turns.
KINDS: Final = (
    *("wrs", "vrs", "zone_controller", "cbtc_base_station", "cbtc_radio", "atp"),
    *("cbtc_medium", "radio_medium"),
)
#: The two kinds that stand for air: dead air is a jammed radio, so they come half as often.
_AIR: Final = ("cbtc_medium", "radio_medium")

_ZONE_M = 350.0
_METRO_M = 118.0
#: Least clear distance between the trains at their start [m]: authorities keep 10 m of it.
_CLEAR_M = 20.0
_STREAM = 91


class KillParameters(Strict):
    """What the drawn scenarios have in common."""

    duration_s: float = Field(DURATION_S, ge=LATEST_S + 5.0, le=3600.0)


def draw_kill(parameters: KillParameters, seed: int) -> Drawn:
    """Three metro trains on a line of 2.5 to 3 km, of whose equipment one piece dies.

    Parameters
    ----------
    parameters : KillParameters
    seed : int
        Of everything: the scenario, its noise, and the kill.
    """
    rng = np.random.default_rng([seed, _STREAM])
    data = _scenario(seed, rng) | {"duration_s": parameters.duration_s}
    equipment = equipment_of(parse_scenario(data))
    weights = np.array([0.5 if kind in _AIR else 1.0 for kind in KINDS])
    kind = str(rng.choice(KINDS, p=weights / weights.sum()))
    node = str(rng.choice(equipment[kind]))
    kill = Kill(node, round(float(rng.uniform(EARLIEST_S, LATEST_S)), 2))
    facts = {
        "kind": kind,
        "node": node,
        "killed_s": kill.time_s,
        "loss_db": data["cbtc"]["extra_loss_db"],
        "train_stops": "faults" in data,
    }
    return Drawn(data, (kill,), facts)


def look_at_kill(drawn: Drawn, report: Mapping[str, Any]) -> dict[str, float | None]:
    """Whether the death was noticed, and the corridor went on to the end of the run."""
    node = drawn.facts["node"]
    ticks = round(drawn.data["duration_s"] / drawn.data["tick_s"])
    return {
        "noticed": float(any(failed["node"] == node for failed in report["failures"])),
        "went_on": float(report["complete"] and report["ticks"] == ticks),
    }


def equipment_of(scenario: Scenario) -> dict[str, list[str]]:
    """Full names of all equipment of a scenario with train control by radio, by kind."""
    trains = [train.name for train in scenario.trains]
    return {
        "wrs": [f"/wayside/{station.name}" for station in layout_of(scenario).stations],
        "vrs": [f"/{train}/vrs" for train in trains],
        "zone_controller": [CONTROLLER],
        "cbtc_base_station": [f"/wayside/{base.name}/cbtc" for base in bases_of(scenario)],
        "cbtc_radio": [f"/{train}/cbtc_radio" for train in trains],
        "atp": [f"/{train}/atp" for train in trains],
        "cbtc_medium": [CBTC_MEDIUM],
        "radio_medium": [MEDIUM],
    }


def _scenario(seed: int, rng: np.random.Generator) -> dict[str, Any]:
    length_m = round(float(rng.uniform(2500.0, 3000.0)), 1)
    # Each train in a zone of its own, as the train describer needs it.
    zone_m = length_m / math.ceil(length_m / _ZONE_M)
    starts_m: list[float] = []
    least_m = _METRO_M + 2.0
    for number in range(len(TRAINS)):
        at_m = float(rng.uniform(number * zone_m + 5.0, (number + 1) * zone_m - 5.0))
        starts_m.insert(0, round(max(at_m, least_m), 1))
        least_m = starts_m[0] + _METRO_M + _CLEAR_M
    fall_m, slow_m = (float(rng.uniform(0.2, 0.6)) * length_m for _ in range(2))
    data: dict[str, Any] = {
        "name": "kills",
        "description": "One run of the study of kills",
        "seed": seed,
        "tick_s": TICK_S,
        "duration_s": DURATION_S,
        "tracks": {
            "main": {
                "elements": [{"straight_m": length_m}],
                "gradients": [
                    [0, 0],
                    [round(fall_m, 1), round(float(rng.uniform(-25.0, 10.0)), 1)],
                    [round(fall_m + 0.2 * length_m, 1), 0],
                ],
                "speed_limits": [
                    [0, 80],
                    [round(slow_m, 1), float(rng.choice([40.0, 60.0, 80.0]))],
                    [round(slow_m + 0.15 * length_m, 1), 80],
                ],
                "stops_m": [round(length_m - 100.0, 1)],
            }
        },
        "stations": {"zone_length_m": _ZONE_M},
        "cbtc": {
            "base_spacing_m": 1000,
            # Half of the runs have a link with margin, half one that loses frames.
            "extra_loss_db": round(float(rng.choice([0.0, rng.uniform(5.0, 24.0)])), 1),
        },
        "trains": [
            {"name": name, "route": ["main"], "start_m": start_m}
            for name, start_m in zip(TRAINS, starts_m, strict=True)
        ],
    }
    if rng.random() < 0.5:
        from_s = round(float(rng.uniform(10.0, 45.0)), 1)
        to_s = round(from_s + float(rng.uniform(5.0, 25.0)), 1)
        train = str(rng.choice(TRAINS[:2]))
        data["faults"] = [{"kind": "train_stop", "train": train, "from_s": from_s, "to_s": to_s}]
    return data
