"""From a recording to figures: track codes sent and understood, and what came of them."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.topics import COMMAND_COLUMNS, RECEIVED_COLUMNS, SENT_COLUMNS, STATE_COLUMNS

from .recording import FloatArray, Recording
from .scenario import Scenario

#: A valid message may be as old as the longest way through the receiver [s].
OLDEST_S = 8.0
#: Speed above the limit that counts as overspeed [m/s].
OVERSPEED_MPS = 0.5

_STATE = {name: index for index, name in enumerate(STATE_COLUMNS)}
_SENT = {name: index for index, name in enumerate(SENT_COLUMNS)}
_RECEIVED = {name: index for index, name in enumerate(RECEIVED_COLUMNS)}
_COMMAND = {name: index for index, name in enumerate(COMMAND_COLUMNS)}


def code_metrics(scenario: Scenario, recording: Recording, index: int) -> dict[str, Any]:
    """Sections ``track_code`` and ``atp`` of one train."""
    ticks = recording.ticks
    state = recording.state.upto(ticks)
    on_line = state[:, index, _STATE["on_line"]] > 0.0
    circuit = circuit_of(scenario, recording, state[:, index])
    sent = recording.sent.upto(ticks)[:, :, _SENT["word"]]
    here = np.where(on_line, sent[np.arange(ticks), circuit], np.nan)
    received = recording.received.upto(ticks)[:, index]
    command = recording.command.upto(ticks)[:, index]
    return {
        "track_code": _codes(scenario.tick_s, on_line, circuit, here, received),
        "atp": _supervision(scenario, recording, index, on_line, circuit, command),
    }


def circuit_of(scenario: Scenario, recording: Recording, state: FloatArray) -> NDArray[np.intp]:
    """Index of the circuit that the front of a train is in, at each tick."""
    found = np.zeros(len(state), dtype=np.intp)
    for track, name in enumerate(recording.tracks):
        numbers = [i for i, circuit in enumerate(scenario.circuits) if circuit.track == name]
        starts_m = [scenario.circuits[i].start_m for i in numbers]
        there = state[:, _STATE["track_index"]] == track
        places = np.searchsorted(starts_m, state[there, _STATE["chainage_m"]], side="right") - 1
        found[there] = np.array(numbers)[np.clip(places, 0, len(numbers) - 1)]
    return found


def _codes(
    tick_s: float,
    on_line: NDArray[np.bool_],
    circuit: NDArray[np.intp],
    here: FloatArray,
    received: FloatArray,
) -> dict[str, Any]:
    """Messages at the antenna against messages understood.

    One is *sent* each time the word at the antenna changes, *decoded* if it is understood before
    the next change, after ``latency``; a valid message is *wrong* if no such word was at the
    antenna within `OLDEST_S`.
    """
    valid = on_line & (received[:, _RECEIVED["valid"]] > 0.0)
    word = np.where(valid, received[:, _RECEIVED["word"]], np.nan)
    is_new = on_line & ~np.isnan(here)
    is_new[1:] &= (here[1:] != here[:-1]) | (circuit[1:] != circuit[:-1]) | ~on_line[:-1]
    begins = np.flatnonzero(is_new)
    latencies_s = []
    for begin, end in itertools.pairwise([*begins.tolist(), len(here)]):
        understood = np.flatnonzero(word[begin:end] == here[begin])
        if understood.size:
            latencies_s.append(float(understood[0]) * tick_s)
    oldest = math.ceil(OLDEST_S / tick_s)
    wrong = sum(
        word[tick] not in here[max(0, tick - oldest) : tick + 1] for tick in np.flatnonzero(valid)
    )
    here_ticks = int(np.count_nonzero(on_line))
    return {
        "sent": len(begins),
        "decoded": len(latencies_s),
        "wrong": int(wrong),
        "availability": np.count_nonzero(valid) / here_ticks if here_ticks else None,
        "latency_s": float(np.mean(latencies_s)) if latencies_s else None,
        "latency_p95_s": float(np.quantile(latencies_s, 0.95)) if latencies_s else None,
    }


def _supervision(
    scenario: Scenario,
    recording: Recording,
    index: int,
    on_line: NDArray[np.bool_],
    circuit: NDArray[np.intp],
    command: FloatArray,
) -> dict[str, Any]:
    """What supervision did, and whether the train was safe.

    ``entered_occupied`` counts circuits that its front entered while another train was in them,
    ``margin_min_m`` is the least distance to the rear of a train ahead on the same track.
    """
    state = recording.state.upto(recording.ticks)
    mine = state[:, index]
    speed_mps = np.abs(mine[:, _STATE["speed_mps"]])
    limit_mps = _limits(scenario, recording, mine)
    brakes = (command[:, _COMMAND["service_brake"]] > 0.0) & on_line
    emergency = (command[:, _COMMAND["emergency_brake"]] > 0.0) & on_line
    moving = speed_mps > 0.0
    margin_m, entered = _clearance(scenario, recording, index, on_line, circuit)
    over = on_line & (speed_mps > limit_mps + OVERSPEED_MPS)
    beyond = on_line & (speed_mps > command[:, _COMMAND["permitted_mps"]] + OVERSPEED_MPS)
    return {
        "interventions": _rises((brakes | emergency) & moving),
        "emergency_brakes": _rises(emergency & moving),
        "overspeed_s": float(np.count_nonzero(over) * scenario.tick_s),
        "above_permitted_s": float(np.count_nonzero(beyond) * scenario.tick_s),
        "entered_occupied": entered,
        "margin_min_m": margin_m,
    }


def _limits(scenario: Scenario, recording: Recording, mine: FloatArray) -> FloatArray:
    limits = np.full(len(mine), np.inf)
    for track, name in enumerate(recording.tracks):
        there = mine[:, _STATE["track_index"]] == track
        chainage_m = mine[there, _STATE["chainage_m"]]
        limits[there] = scenario.network.tracks[name].limit_mps(chainage_m)
    return limits


def _clearance(
    scenario: Scenario,
    recording: Recording,
    index: int,
    on_line: NDArray[np.bool_],
    circuit: NDArray[np.intp],
) -> tuple[float | None, int]:
    state = recording.state.upto(recording.ticks)
    mine = state[:, index]
    starts_m = np.array([c.start_m for c in scenario.circuits])
    ends_m = np.array([c.end_m for c in scenario.circuits])
    enters = on_line.copy()
    enters[1:] &= (circuit[1:] != circuit[:-1]) & on_line[:-1]
    enters[:1] = False
    least_m, entered = math.inf, 0
    for other, train in enumerate(scenario.trains):
        if other == index:
            continue
        theirs = state[:, other]
        together = on_line & (theirs[:, _STATE["on_line"]] > 0.0)
        together &= theirs[:, _STATE["track_index"]] == mine[:, _STATE["track_index"]]
        front_m = theirs[:, _STATE["chainage_m"]]
        rear_m = front_m - train.vehicle.length_m
        ahead = together & (front_m > mine[:, _STATE["chainage_m"]])
        gap_m = rear_m[ahead] - mine[ahead, _STATE["chainage_m"]]
        least_m = min(least_m, float(gap_m.min(initial=math.inf)))
        inside = ahead & (rear_m < ends_m[circuit]) & (front_m > starts_m[circuit])
        entered += int(np.count_nonzero(enters & inside))
    return (least_m if math.isfinite(least_m) else None), entered


def _rises(flags: NDArray[np.bool_]) -> int:
    return int(np.count_nonzero(flags[1:] & ~flags[:-1]) + (flags.size > 0 and flags[0]))
