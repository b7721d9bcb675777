"""The margin of the train radio: headway and spurious brakings against its level.

Trains depart at moving-block distance on a good link and enter a stretch that costs every link
so many decibels. Nothing is in their way, so that every braking in it is spurious. Beside what is
measured stands what theory says, see `theory`.

The trains do not depart in the stretch itself: fading is frozen while a train stands, so that one
in a fade would never receive its first authority.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import lru_cache
from itertools import pairwise
from typing import Any, Final, Literal

from pydantic import Field

from rail_corridor.equipment.train_radio.report import PASSED_AT
from rail_corridor.loading.schema import parse_scenario
from rail_corridor.study.sources import Drawn
from rail_corridor.study.strict import Strict

from .theory import LinkPrediction, predict

SchemeName = Literal["siso", "mrc", "alamouti_2x1", "alamouti_2x2"]
TICK_S: Final = 0.25
#: The stretch begins here, and headway is measured there: shares of the track.
STRETCH_FROM: Final = 0.3
CHECKPOINTS: Final = (0.4, 0.5, 0.6)

_APART_M = 350.0
_SPACING_M = 600.0
_COVERAGE_RANGE_M = 1.4 * _SPACING_M


class LinkMarginParameters(Strict):
    """A scheme, what the stretch costs its links, and the line."""

    scheme: SchemeName = "siso"
    loss_db: float = Field(30.0, ge=0.0, le=100.0)
    length_m: float = Field(7200.0, ge=3000.0, le=100_000.0)
    trains: int = Field(4, ge=2, le=8)
    duration_s: float = Field(240.0, ge=10.0, le=7200.0)


def draw_link_margin(parameters: LinkMarginParameters, seed: int) -> Drawn:
    """Trains at moving-block distance that come to where the train radio is weak.

    Parameters
    ----------
    parameters : LinkMarginParameters
    seed : int
        Of noise and fading.
    """
    told = _prediction(parameters)
    facts = {
        "es_n0_db": round(told.es_n0_db, 1),
        "frame_loss_at_rest_told": told.frame_loss_at_rest,
        "frame_loss_told": told.frame_loss,
        "brakings_per_h_told": told.brakings_per_hour,
    }
    return Drawn(scenario_data(parameters) | {"seed": seed}, facts=facts)


@lru_cache(maxsize=256)
def _prediction(parameters: LinkMarginParameters) -> LinkPrediction:
    return predict(parse_scenario(scenario_data(parameters)), STRETCH_FROM)


def scenario_data(parameters: LinkMarginParameters) -> dict[str, Any]:
    """A straight line whose further part has a weak link, as plain data."""
    length_m, trains = parameters.length_m, parameters.trains
    cells = math.ceil(length_m / _SPACING_M)
    masts_m = [(cell + 0.5) * length_m / cells for cell in range(cells)]
    # A mast whose foot is walled in has the loss on all of its links, wherever the train is.
    weak = [
        {
            "kind": "cutting",
            "track": "main",
            "from_m": mast_m - 1.0,
            "to_m": mast_m + 1.0,
            "entry_db": parameters.loss_db,
        }
        for mast_m in masts_m
        if mast_m + _COVERAGE_RANGE_M > STRETCH_FROM * length_m
    ]
    return {
        "name": "link_margin",
        "description": "One run of the study of the link margin",
        "tick_s": TICK_S,
        "duration_s": parameters.duration_s,
        "tracks": {
            "main": {"elements": [{"straight_m": length_m}], "speed_limits": [[0, 80]]},
        },
        "stations": {"zone_length_m": _APART_M},
        # Masts far off the track: the mean level changes by 10 dB from mast to mast, no more.
        "cbtc": {
            "scheme": parameters.scheme,
            "base_spacing_m": _SPACING_M,
            "mast_offset_m": 100.0,
            "path_loss_exponent": 2.0,
            "losses": weak,
        },
        "trains": [
            {
                "name": f"train_{index + 1}",
                "route": ["main"],
                "start_m": 150.0 + _APART_M * (trains - 1 - index),
            }
            for index in range(trains)
        ],
    }


def look_at_link_margin(_: Drawn, report: Mapping[str, Any]) -> dict[str, float | None]:
    """Figures of a run; trains are in the order in which they run.

    ``frame_loss`` fraction of the frames, both ways, that were not accepted as data, all losses
    before the stretch (at its border) counted into it: an upper bound; ``headway_s`` mean time
    from one train to the next at the checkpoints, where a train that had not passed at the end of
    the run counts with what it had let wait by then, so that it is a lower bound if ``cut_off`` of
    these times are not over; ``passed`` share of the passings that happened; ``brakings`` spurious
    ones in ``train_hours`` within the stretch.

    A mean over those that passed alone would be the better the fewer do: it is not given.
    """
    start, *places = (PASSED_AT.index(fraction) for fraction in (STRETCH_FROM, *CHECKPOINTS))
    trains = list(report["trains"].values())
    end_s = float(report["sim_time_s"])
    sent = accepted = 0
    inside_s = 0.0
    for train in trains:
        entered_s = train["cbtc"]["passed_s"][start]
        if entered_s is None:
            continue
        inside_s += end_s - entered_s
        sent += 2 * round((end_s - entered_s) / TICK_S)
        # One each way in a tick; on the good link before the stretch they are all accepted.
        before = 2 * round(entered_s / TICK_S)
        accepted += max(0, train["cbtc"]["frames"] - train["cbtc"]["lost"] - before)
    times_s = [[train["cbtc"]["passed_s"][place] for train in trains] for place in places]
    begun = [
        (ahead_s, after_s)
        for each in times_s
        for ahead_s, after_s in pairwise(each)
        if ahead_s is not None
    ]
    waits_s = [(end_s if after_s is None else after_s) - ahead_s for ahead_s, after_s in begun]
    passed = sum(time_s is not None for each in times_s for time_s in each)
    return {
        "frame_loss": min(1.0, max(0.0, 1.0 - accepted / sent)) if sent else None,
        "headway_s": sum(waits_s) / len(waits_s) if waits_s else None,
        "cut_off": sum(after_s is None for _, after_s in begun),
        "passed": passed / (len(trains) * len(places)),
        "brakings": _brakings(report, start),
        "train_hours": inside_s / 3600.0,
    }


def _brakings(report: Mapping[str, Any], start: int) -> int:
    """Losses of authority of trains that are in the stretch: each makes its train brake.

    The one at its border is no matter of the margin: the good mast goes out of reach at once.
    """
    count = 0
    for name, train in report["trains"].items():
        entered_s = train["cbtc"]["passed_s"][start]
        source = f"/{name}/atp: supervision"
        count += entered_s is not None and sum(
            event["name"] == source
            and event["message"] == "no authority"
            and event["time_s"] > entered_s
            for event in report["events"]
        )
    return count
