"""From a run to what must not have happened in it: truth and claims as arrays, then the judge."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rail_corridor.equipment.train_radio.nodes import steepest_fall_permil
from rail_corridor.report.truth_judge import (
    Motion,
    StoppingWay,
    collisions,
    least_limits,
    mislocated,
    overspeed,
    passed_ends,
    passed_tails,
    stuck,
)
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_corridor.study.sources import Drawn
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.train_radio import ATP_STATE, AUTHORITY
from rail_msgs_py.topics.world import COMMAND, STATE
from rail_signals.arrays import BoolArray, FloatArray
from rail_world.trains.vehicle import GRAVITY_MPS2, Vehicle

from .scenario import GOES_ON_S

#: Until the full brake holds, beside the ticks that a command takes [s].
_BUILD_UP_S: Final = 2.5
_COMMAND_TICKS: Final = 4
#: Trains need so long to heed a restriction that comes up before or under them [s].
_RESTRICTION_S: Final = 40.0
#: Least braking that is counted on, on whatever fall [m/s^2].
_LEAST_BRAKING_MPS2: Final = 0.1


def judge_safety(drawn: Drawn, scenario: Scenario, data: RunData) -> dict[str, float | None]:
    """What must be 0 of a run, by its true positions.

    Returns
    -------
    dict
        ``collisions`` pairs of trains; ``passed_ends``, ``passed_tails`` ticks; ``overspeed_s``;
        ``mislocated_atp``, ``mislocated_localizer`` ticks; ``stuck`` trains; further
        ``least_gap_m``, and ``run_m``, the way of all trains. Where equipment died for good
        nobody counts as stuck.
    """
    motion = motion_of(scenario, data)
    passed = passed_ends(
        motion,
        _column(data, AUTHORITY, "end_of_authority_m"),
        stopping_way(scenario),
        on_sight(data),
    )
    tails = passed_tails(motion, _column(data, AUTHORITY, "worst_rear_m"))
    return {
        "collisions": float(len(collisions(motion))),
        "passed_ends": float(np.count_nonzero(passed)),
        "passed_tails": float(np.count_nonzero(tails)),
        "overspeed_s": float(np.count_nonzero(_too_fast(scenario, motion))) * scenario.tick_s,
        "mislocated_atp": float(np.count_nonzero(_mislocated_atp(motion, data))),
        "mislocated_localizer": float(np.count_nonzero(_mislocated_localizer(motion, data))),
        "stuck": float(len(_stuck(drawn, scenario, motion))),
        "least_gap_m": _least_gap_m(motion),
        "run_m": float(np.nansum(np.abs(motion.front_m[-1] - motion.front_m[0]))),
    }


def motion_of(scenario: Scenario, data: RunData) -> Motion:
    """True motion of a run of trains on the first track of their routes."""
    state = data[STATE].upto(data.ticks)

    def column(name: str) -> FloatArray:
        return np.asarray(state[:, :, STATE.index[name]])

    return Motion(
        scenario.tick_s,
        column("track_index"),
        column("chainage_m"),
        column("speed_mps"),
        np.asarray(column("on_line") > 0.0),
        np.array([train.vehicle.length_m for train in scenario.trains]),
        np.array([float(train.direction) for train in scenario.trains]),
    )


def stopping_way(scenario: Scenario) -> StoppingWay:
    """What the weakest brake and the strongest motor make of a withdrawn authority."""
    plan: Any = getattr(scenario, "cbtc")  # noqa: B009 - a field that equipment adds
    falls = [steepest_fall_permil(track) for track in scenario.network.tracks.values()]
    fall_mps2 = 1e-3 * GRAVITY_MPS2 * max(falls)
    return StoppingWay(
        _COMMAND_TICKS * scenario.tick_s + _BUILD_UP_S,
        plan.timeout_s,
        max(plan.braking_mps2 - fall_mps2, _LEAST_BRAKING_MPS2),
        max(Vehicle(train.vehicle).traction_mps2(0.0) for train in scenario.trains) + fall_mps2,
    )


def _column(data: RunData, topic: Topic, name: str) -> FloatArray:
    return np.asarray(data[topic].upto(data.ticks)[:, :, topic.index[name]])


def on_sight(data: RunData) -> BoolArray:
    """Whether a person lets a train run on sight [tick, train]."""
    return np.asarray(_column(data, COMMAND, "on_sight") > 0.0)


def _too_fast(scenario: Scenario, motion: Motion) -> BoolArray:
    (name,) = scenario.tracks
    pairs = scenario.tracks[name].speed_limits
    starts_m, limits_kmh = (np.array(each, dtype=np.float64) for each in zip(*pairs, strict=True))
    limit_mps = least_limits(motion.low_m, motion.high_m, starts_m, limits_kmh / 3.6)
    time_s = scenario.tick_s * np.arange(len(limit_mps))
    for fault in scenario.faults:
        if fault.kind != "speed_restriction":
            continue
        slow: Any = fault
        holds = (time_s > slow.from_s + _RESTRICTION_S) & (time_s < slow.to_s)
        under = (motion.low_m < slow.to_m) & (motion.high_m > slow.from_m) & holds[:, None]
        limit_mps = np.where(under, np.minimum(limit_mps, slow.speed_kmh / 3.6), limit_mps)
    return overspeed(motion, limit_mps)


def _mislocated_atp(motion: Motion, data: RunData) -> BoolArray:
    front_m = _column(data, ATP_STATE, "front_m")
    half_m = _column(data, ATP_STATE, "uncertainty_m")
    heard = ~np.isnan(_column(data, ATP_STATE, "accepted"))
    return mislocated(motion, front_m - half_m, front_m + half_m, heard & (half_m != np.inf))


def _mislocated_localizer(motion: Motion, data: RunData) -> BoolArray:
    if LOCALIZER_STATE not in data:
        return np.zeros(motion.on_line.shape, dtype=bool)
    low_m = _column(data, LOCALIZER_STATE, "low_m")
    high_m = _column(data, LOCALIZER_STATE, "high_m")
    return mislocated(motion, low_m, high_m, _column(data, LOCALIZER_STATE, "status") > 0.0)


def _stuck(drawn: Drawn, scenario: Scenario, motion: Motion) -> list[int]:
    if drawn.kills:
        return []
    last_end_s = max([drawn.facts["last_end_s"], *(train.depart_s for train in scenario.trains)])
    stops_m = [scenario.network.tracks[train.route[0]].stops_m for train in scenario.trains]
    return stuck(
        motion,
        np.array([stops[-1] for stops in stops_m]),
        round(last_end_s / scenario.tick_s),
        round((last_end_s + GOES_ON_S) / scenario.tick_s),
    )


def _least_gap_m(motion: Motion) -> float | None:
    """Least clear distance of two trains on one track."""
    least_m = np.inf
    for one in range(len(motion.length_m)):
        for other in range(one):
            together = motion.on_line[:, one] & motion.on_line[:, other]
            together &= motion.track[:, one] == motion.track[:, other]
            gap_m = np.maximum(motion.low_m[:, one], motion.low_m[:, other]) - np.minimum(
                motion.high_m[:, one], motion.high_m[:, other]
            )
            least_m = min(least_m, float(gap_m[together].min(initial=np.inf)))
    return float(least_m) if np.isfinite(least_m) else None
