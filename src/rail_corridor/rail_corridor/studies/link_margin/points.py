"""The link-margin sweep: headway and spurious brakings against link SNR for the four schemes.

Trains depart at moving-block distance on a good link and enter a stretch that costs every link
so many decibels. Nothing is in their way, so that every braking in it is spurious. Each point is
a generated scenario that goes through the same node graph as ``rail run``, in a process of its
own. Beside what is measured stands what theory says, see `link_margin_theory`.

The trains do not depart in the stretch itself: fading is frozen while a train stands, so that one
in a fade would never receive its first authority.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

from scipy.stats import chi2

from rail_corridor.equipment.train_radio.report import PASSED_AT

from .theory import LinkPrediction

SCHEMES: Final = ("siso", "mrc", "alamouti_2x1", "alamouti_2x2")
#: Loss of the stretch at each point [dB]: from hardly any lost frame to more than half of them.
LOSSES_DB: Final[Mapping[str, tuple[float, ...]]] = {
    "siso": (20.0, 24.0, 28.0, 31.0, 34.0, 37.0),
    "mrc": (26.0, 30.0, 34.0, 37.0, 40.0, 43.0),
    "alamouti_2x1": (24.0, 28.0, 32.0, 35.0, 38.0, 41.0),
    "alamouti_2x2": (30.0, 34.0, 37.0, 40.0, 43.0, 46.0),
}
TICK_S: Final = 0.25
#: The stretch begins here, and headway is measured there: shares of the track.
STRETCH_FROM: Final = 0.3
CHECKPOINTS: Final = (0.4, 0.5, 0.6)

_APART_M = 350.0
_SPACING_M = 600.0
_COVERAGE_RANGE_M = 1.4 * _SPACING_M


@dataclass(frozen=True)
class Point:
    """One run: a scheme, and what the stretch costs its links [dB]."""

    scheme: str
    loss_db: float
    quick: bool = False
    seed: int = 11

    @property
    def name(self) -> str:
        """Name of its scenario."""
        return f"link_margin_{self.scheme}_{self.loss_db:g}db"


@dataclass(frozen=True)
class LinkMarginRow:
    """What came of one point, of one run or of several that differ in their seeds.

    ``es_n0_db`` median in the stretch of the mean Es/N0 per receive antenna [dB];
    ``frame_loss`` fraction of the frames, both ways, that were not accepted as data, all losses
    before the stretch (at its border) counted into it: an upper bound;
    ``age_p95_s`` of the authorities over the whole run, the worst train's [s]; ``headway_s`` mean
    time from one train to the next at the checkpoints, ``headway_p95_s`` the 95th percentile [s];
    ``unpassed`` passings that did not happen before the end of the run, of ``passings``;
    ``brakings`` spurious ones in ``train_hours`` within the stretch.
    """

    scheme: str
    loss_db: float
    es_n0_db: float
    frame_loss: float | None
    age_p95_s: float | None
    without_authority_s: float
    headway_s: float | None
    headway_p95_s: float | None
    unpassed: int
    passings: int
    brakings: int
    train_hours: float
    passed_authority: int
    prediction: LinkPrediction

    @property
    def brakings_per_hour(self) -> float | None:
        """Spurious brakings per hour of a train in the stretch."""
        return self.brakings / self.train_hours if self.train_hours > 0.0 else None


def points(
    schemes: Iterable[str], losses_db: Mapping[str, Sequence[float]], *, quick: bool = False
) -> list[Point]:
    """Every scheme with each of its losses [dB]."""
    return [Point(scheme, loss, quick) for scheme in schemes for loss in losses_db[scheme]]


def scenario_data(point: Point) -> dict[str, Any]:
    """Scenario of a point, as plain data: a straight line whose further part has a weak link."""
    length_m, trains, duration_s = (4000.0, 3, 140.0) if point.quick else (7200.0, 4, 240.0)
    cells = math.ceil(length_m / _SPACING_M)
    masts_m = [(cell + 0.5) * length_m / cells for cell in range(cells)]
    # A mast whose foot is walled in has the loss on all of its links, wherever the train is.
    weak = [
        {
            "kind": "cutting",
            "track": "main",
            "from_m": mast_m - 1.0,
            "to_m": mast_m + 1.0,
            "entry_db": point.loss_db,
        }
        for mast_m in masts_m
        if mast_m + _COVERAGE_RANGE_M > STRETCH_FROM * length_m
    ]
    return {
        "name": point.name.replace(".", "_"),
        "description": "One point of the link-margin sweep",
        "seed": point.seed,
        "tick_s": TICK_S,
        "duration_s": duration_s,
        "tracks": {
            "main": {"elements": [{"straight_m": length_m}], "speed_limits": [[0, 80]]},
        },
        "stations": {"zone_length_m": _APART_M},
        # Masts far off the track: the mean level changes by 10 dB from mast to mast, no more.
        "cbtc": {
            "scheme": point.scheme,
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


def aggregate(
    point: Point, reports: Sequence[Mapping[str, Any]], prediction: LinkPrediction
) -> LinkMarginRow:
    """Row of a point from the reports of its runs; trains are in the order in which they run."""
    start, *places = (PASSED_AT.index(fraction) for fraction in (STRETCH_FROM, *CHECKPOINTS))
    sent = accepted = unpassed = passings = brakings = passed_authority = 0
    inside_s = without_s = 0.0
    headways_s: list[float] = []
    ages_s: list[float] = []
    for report in reports:
        trains = list(report["trains"].values())
        end_s = float(report["sim_time_s"])
        for train in trains:
            passed_authority += train["atp"]["passed_authority"]
            without_s += train["cbtc"]["without_authority_s"]
            if train["cbtc"]["age_p95_s"] is not None:
                ages_s.append(train["cbtc"]["age_p95_s"])
            entered_s = train["cbtc"]["passed_s"][start]
            if entered_s is None:
                continue
            inside_s += end_s - entered_s
            sent += 2 * round((end_s - entered_s) / TICK_S)
            # One each way in a tick; on the good link before the stretch they are all accepted.
            before = 2 * round(entered_s / TICK_S)
            accepted += max(0, train["cbtc"]["frames"] - train["cbtc"]["lost"] - before)
        for place in places:
            times_s = [train["cbtc"]["passed_s"][place] for train in trains]
            unpassed += times_s.count(None)
            headways_s += [
                after - ahead
                for ahead, after in pairwise(times_s)
                if ahead is not None and after is not None
            ]
        passings += len(trains) * len(places)
        brakings += _brakings(report, start)
    headways_s.sort()
    return LinkMarginRow(
        scheme=point.scheme,
        loss_db=point.loss_db,
        es_n0_db=prediction.es_n0_db,
        frame_loss=min(1.0, max(0.0, 1.0 - accepted / sent)) if sent else None,
        age_p95_s=max(ages_s, default=None),
        without_authority_s=without_s,
        headway_s=sum(headways_s) / len(headways_s) if headways_s else None,
        headway_p95_s=headways_s[int(0.95 * (len(headways_s) - 1))] if headways_s else None,
        unpassed=unpassed,
        passings=passings,
        brakings=brakings,
        train_hours=inside_s / 3600.0,
        passed_authority=passed_authority,
        prediction=prediction,
    )


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


def rate_interval(count: int, hours: float) -> tuple[float, float]:
    """Exact 95 % interval of a rate per hour from a count (Garwood, 1936)."""
    low = float(chi2.ppf(0.025, 2 * count)) / 2.0 if count else 0.0
    return low / hours, float(chi2.ppf(0.975, 2 * count + 2)) / 2.0 / hours
