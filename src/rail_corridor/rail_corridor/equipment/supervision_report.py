"""From a recording to figures: what supervision on board did, and whether the train was safe."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_corridor.run_data import RunData
from rail_corridor.scenario.faults import SpeedRestrictionFault
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.world import COMMAND, STATE
from rail_signals.arrays import FloatArray

#: A restriction that begins is judged after this time, which trains near it need to brake [s].
NOTICE_S = 30.0
#: Speed above the limit that counts as overspeed [m/s].
OVERSPEED_MPS = 0.5


def supervision_metrics(
    scenario: Scenario, recording: RunData, index: int, on_line: NDArray[np.bool_]
) -> dict[str, Any]:
    """Brakings, overspeed and the least distance to the rear of a train ahead on the same track."""
    mine = recording[STATE].upto(recording.ticks)[:, index]
    command = recording[COMMAND].upto(recording.ticks)[:, index]
    speed_mps = np.abs(mine[:, STATE.index["speed_mps"]])
    limit_mps = _limits(scenario, recording, mine, scenario.trains[index].vehicle.length_m)
    brakes = (command[:, COMMAND.index["service_brake"]] > 0.0) & on_line
    emergency = (command[:, COMMAND.index["emergency_brake"]] > 0.0) & on_line
    moving = speed_mps > 0.0
    over = on_line & (speed_mps > limit_mps + OVERSPEED_MPS)
    beyond = on_line & (speed_mps > command[:, COMMAND.index["permitted_mps"]] + OVERSPEED_MPS)
    margin_m = math.inf
    chainage_m = mine[:, STATE.index["chainage_m"]]
    for ahead, _, rear_m in trains_ahead(scenario, recording, index, on_line):
        margin_m = min(margin_m, float((rear_m - chainage_m)[ahead].min(initial=math.inf)))
    return {
        "interventions": rises((brakes | emergency) & moving),
        "emergency_brakes": rises(emergency & moving),
        "overspeed_s": float(np.count_nonzero(over) * scenario.tick_s),
        "above_permitted_s": float(np.count_nonzero(beyond) * scenario.tick_s),
        "speed_at_end_mps": float(speed_mps[-1]) if on_line.size and on_line[-1] else None,
        "margin_min_m": margin_m if math.isfinite(margin_m) else None,
    }


def trains_ahead(
    scenario: Scenario, recording: RunData, index: int, on_line: NDArray[np.bool_]
) -> Iterator[tuple[NDArray[np.bool_], FloatArray, FloatArray]]:
    """For every other train: ticks in which it is ahead on the same track, its front and rear."""
    state = recording[STATE].upto(recording.ticks)
    mine = state[:, index]
    for other, train in enumerate(scenario.trains):
        if other == index:
            continue
        theirs = state[:, other]
        together = on_line & (theirs[:, STATE.index["on_line"]] > 0.0)
        together &= theirs[:, STATE.index["track_index"]] == mine[:, STATE.index["track_index"]]
        front_m = theirs[:, STATE.index["chainage_m"]]
        # Side by side each is in the other.
        ahead = together & (front_m >= mine[:, STATE.index["chainage_m"]])
        yield ahead, front_m, front_m - train.vehicle.length_m


def rises(flags: NDArray[np.bool_]) -> int:
    """How often something begins."""
    return int(np.count_nonzero(flags[1:] & ~flags[:-1]) + (flags.size > 0 and flags[0]))


def _limits(
    scenario: Scenario, recording: RunData, mine: FloatArray, length_m: float
) -> FloatArray:
    """Limit [m/s] at the front of a train in each tick; of a restriction under all of it."""
    limits = np.full(len(mine), np.inf)
    for track, name in enumerate(recording.tracks):
        there = mine[:, STATE.index["track_index"]] == track
        chainage_m = mine[there, STATE.index["chainage_m"]]
        limits[there] = scenario.network.tracks[name].limit_mps(chainage_m)
    time_s = np.arange(len(mine)) * scenario.tick_s
    chainage_m = mine[:, STATE.index["chainage_m"]]
    for fault in scenario.faults:
        if not isinstance(fault, SpeedRestrictionFault):
            continue
        track = recording.tracks.index(fault.track)
        there = mine[:, STATE.index["track_index"]] == track
        there &= (chainage_m >= fault.from_m) & (chainage_m < fault.to_m + length_m)
        there &= (time_s >= fault.from_s + NOTICE_S) & (time_s < fault.to_s)
        limits[there] = np.minimum(limits[there], fault.speed_kmh / 3.6)
    return limits
