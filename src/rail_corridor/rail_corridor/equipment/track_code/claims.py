"""Claims of track circuits and of supervision against the truth: clear, occupied, and the code.

A circuit has `REACTION_S` to notice a train, and `RELEASE_S` to notice that there is none.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.quantities import CLAIM_SIGMAS
from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_SENT, OCCUPANCY
from rail_msgs_py.topics.world import COMMAND, STATE
from rail_signals.arrays import BoolArray, FloatArray
from rail_signals.track_code.scales import CodeScales

from .line_speeds import speeds_of
from .placement import circuits_of
from .section import TRACK_CIRCUITS

#: Until a circuit with a train in it must be occupied [s], besides two ticks.
REACTION_S: Final = 1.0
#: Until a circuit that a train has left may still be occupied [s], besides two ticks.
RELEASE_S: Final = 3.0
#: A valid message may be as old as the longest way through the receiver [s].
OLDEST_S: Final = 8.0
#: Excess of the speed that makes supervision brake [m/s].
SERVICE_OVER_MPS: Final = 0.7
#: The code of the block before may be obeyed for that long in a new one [s].
RESPONSE_S: Final = 4.0

#: With so many free circuits ahead a train has no reason to stand: one is kept free before the
#: end of the line, and one more is spare.
FREE: Final = 3

Ticks = NDArray[np.bool_]


def circuit_claims(
    scenario: Scenario,
    recording: RunData,
    index: int,
    on_line: Ticks,
    circuit: NDArray[np.intp],
) -> dict[str, float]:
    """What circuits said that one train is in, or runs to.

    Returns
    -------
    dict
        ``clear_over_train_s``, in which a circuit with the train inside was clear;
        ``false_clear_s``, in which moreover no circuit was occupied between the one of the next
        train behind and that: nothing kept another train away;
        ``false_occupied_s``, in which the one ahead of it was occupied by nobody;
        ``stands_free_s``, for which it has stood at the end of the run with `FREE` circuits
        ahead of it that have no train in them.
    """
    circuits = circuits_of(scenario)
    occupied = recording[OCCUPANCY].upto(recording.ticks)[:, :, OCCUPANCY.index["occupied"]]
    inside = np.stack([_inside(scenario, recording, i) for i in range(len(scenario.trains))])
    taken_now: BoolArray = np.logical_or.reduce(inside, axis=0)
    react = math.ceil(REACTION_S / scenario.tick_s) + 2
    release = math.ceil(RELEASE_S / scenario.tick_s) + 2
    # What has not been received of a circuit is no claim.
    clear = occupied == 0.0
    over_train = _lasting(inside[index], react) & clear
    false_clear = over_train & ~_guarded(scenario, recording, index, occupied > 0.0)
    empty = _lasting(~taken_now, release) & (occupied > 0.0)
    ahead = np.minimum(circuit + 1, len(circuits) - 1)
    tracks = np.array([each.track for each in circuits])
    is_ahead = on_line & (ahead > circuit) & (tracks[ahead] == tracks[circuit])
    hindered = is_ahead & empty[np.arange(len(empty)), ahead]
    speed_mps = recording[STATE].upto(recording.ticks)[:, index, STATE.index["speed_mps"]]
    numbers = circuit[:, None] + np.arange(1, FREE + 1)
    known = numbers < len(circuits)
    numbers = np.minimum(numbers, len(circuits) - 1)
    known &= tracks[numbers] == tracks[circuit][:, None]
    taken = taken_now[np.arange(len(empty))[:, None], numbers]
    waits = on_line & (speed_mps == 0.0) & (known & ~taken).all(axis=1)
    since_end = np.flatnonzero(~waits[::-1])
    stands = int(since_end[0]) if since_end.size else len(waits)
    return {
        "stands_free_s": float(stands * scenario.tick_s),
        "clear_over_train_s": float(np.count_nonzero(over_train.any(axis=1)) * scenario.tick_s),
        "false_clear_s": float(np.count_nonzero(false_clear.any(axis=1)) * scenario.tick_s),
        "false_occupied_s": float(np.count_nonzero(hindered) * scenario.tick_s),
    }


def code_claims(
    scenario: Scenario,
    recording: RunData,
    index: int,
    on_line: Ticks,
    circuit: NDArray[np.intp],
) -> dict[str, float]:
    """What one train made of its codes.

    Returns
    -------
    dict
        ``above_code_s``, with its true speed above the code without a brake;
        ``foreign_obeyed_s``, in which it ran on by the code of a circuit that it was not in.
    """
    plan, circuits = TRACK_CIRCUITS.of(scenario), circuits_of(scenario)
    assert plan is not None
    ticks = recording.ticks
    command = recording[COMMAND].upto(ticks)[:, index]
    speed_mps = np.abs(recording[STATE].upto(ticks)[:, index, STATE.index["speed_mps"]])
    sent = recording[CODE_SENT].upto(ticks)
    received = recording[CODE_RECEIVED].upto(ticks)[:, index]
    braked = command[:, COMMAND.index["service_brake"]] > 0.0
    braked |= command[:, COMMAND.index["emergency_brake"]] > 0.0
    free = on_line & ~braked & (speed_mps > 0.0)
    scales = CodeScales(speeds_kmh=speeds_of(scenario))
    speeds_mps = np.array(scales.speeds_kmh) / 3.6
    own = sent[np.arange(ticks), circuit, CODE_SENT.index["speed"]]
    now_mps = speeds_mps[np.where(np.isnan(own), 0.0, own).astype(np.intp) // 16 % 16]
    told_mps = _highest_since(now_mps, math.ceil(OLDEST_S / scenario.tick_s))
    permitted_mps = np.fmin(command[:, COMMAND.index["permitted_mps"]], told_mps)
    allowed = SERVICE_OVER_MPS + CLAIM_SIGMAS.default * plan.odometer_error * speed_mps
    above = free & (speed_mps > permitted_mps + allowed)
    valid = received[:, CODE_RECEIVED.index["valid"]] > 0.0
    word = received[:, CODE_RECEIVED.index["word"]]
    settle = math.ceil(RESPONSE_S / scenario.tick_s) + 1
    settled = _lasting(circuit[:, None] == np.arange(len(circuits)), settle)
    under = settled[np.arange(ticks), circuit]
    words = sent[:, :, CODE_SENT.index["word"]]
    oldest = math.ceil(OLDEST_S / scenario.tick_s)
    foreign = np.zeros(ticks, dtype=np.bool_)
    for tick in np.flatnonzero(free & valid & under).tolist():
        since = max(0, tick - oldest)
        own_words = words[since : tick + 1, circuit[tick]]
        foreign[tick] = word[tick] not in own_words
    return {
        "above_code_s": float(np.count_nonzero(above) * scenario.tick_s),
        "foreign_obeyed_s": float(np.count_nonzero(foreign) * scenario.tick_s),
    }


def _inside(scenario: Scenario, recording: RunData, index: int) -> BoolArray:
    """Whether axles of a train are in a circuit [tick, circuit]."""
    state = recording[STATE].upto(recording.ticks)[:, index]
    front_m = state[:, STATE.index["chainage_m"], None]
    rear_m = front_m - scenario.trains[index].vehicle.length_m
    circuits = circuits_of(scenario)
    tracks = np.array([recording.tracks.index(each.track) for each in circuits])
    starts_m = np.array([each.start_m for each in circuits])
    ends_m = np.array([each.end_m for each in circuits])
    there = (state[:, STATE.index["on_line"], None] > 0.0) & (
        state[:, STATE.index["track_index"], None] == tracks
    )
    inside: BoolArray = there & (front_m > starts_m) & (rear_m < ends_m)
    return inside


def _guarded(scenario: Scenario, recording: RunData, index: int, occupied: BoolArray) -> BoolArray:
    """Whether an occupied circuit lies between each circuit and the next train behind a train."""
    state = recording[STATE].upto(recording.ticks)
    fronts_m = state[:, :, STATE.index["chainage_m"]]
    tracks = state[:, :, STATE.index["track_index"]]
    circuits = circuits_of(scenario)
    starts_m = np.array([each.start_m for each in circuits])
    mine_m, mine = fronts_m[:, index, None], tracks[:, index, None]
    behind = (tracks == mine) & (fronts_m < mine_m)
    behind &= state[:, :, STATE.index["on_line"]] > 0.0
    nearest_m = np.where(behind, fronts_m, -np.inf).max(axis=1)[:, None]
    places = np.array([recording.tracks.index(each.track) for each in circuits])
    here = (places == mine) & (starts_m > nearest_m) & occupied
    first_m = np.where(here, starts_m, np.inf).min(axis=1)[:, None]
    guarded: BoolArray = first_m < starts_m
    return guarded


def _lasting(flags: BoolArray, ticks: int) -> BoolArray:
    """Where flags [tick, ...] have been true for so many ticks before, and are."""
    number = np.arange(len(flags)).reshape(-1, *([1] * (flags.ndim - 1)))
    last_false = np.maximum.accumulate(np.where(flags, -1, number), axis=0)
    lasting: BoolArray = number - last_false > ticks
    return lasting


def _highest_since(values: FloatArray, ticks: int) -> FloatArray:
    """The highest of each value and so many before it."""
    padded = np.concatenate([np.full(ticks, values[0]), values])
    windows = np.lib.stride_tricks.sliding_window_view(padded, ticks + 1)
    highest: FloatArray = windows.max(axis=1)
    return highest
