"""From a recording to figures: track codes sent and understood, and what came of them."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_corridor.equipment.supervision_report import supervision_metrics, trains_ahead
from rail_corridor.report.run_data import FloatArray, Recording
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_SENT
from rail_msgs_py.topics.world import STATE

#: A valid message may be as old as the longest way through the receiver [s].
OLDEST_S = 8.0


def code_metrics(scenario: Scenario, recording: Recording, index: int) -> dict[str, Any]:
    """Sections ``track_code`` and ``atp`` of one train."""
    ticks = recording.ticks
    state = recording.state.upto(ticks)
    on_line = state[:, index, STATE.index["on_line"]] > 0.0
    circuit = circuit_of(scenario, recording, state[:, index])
    sent = recording.sent.upto(ticks)[:, :, CODE_SENT.index["word"]]
    here = np.where(on_line, sent[np.arange(ticks), circuit], np.nan)
    received = recording.received.upto(ticks)[:, index]
    return {
        "track_code": _codes(scenario.tick_s, on_line, circuit, here, received),
        "atp": supervision_metrics(scenario, recording, index, on_line)
        | {"entered_occupied": _entered_occupied(scenario, recording, index, on_line, circuit)},
    }


def circuit_of(scenario: Scenario, recording: Recording, state: FloatArray) -> NDArray[np.intp]:
    """Index of the circuit that the front of a train is in, at each tick."""
    found = np.zeros(len(state), dtype=np.intp)
    for track, name in enumerate(recording.tracks):
        numbers = [i for i, circuit in enumerate(scenario.circuits) if circuit.track == name]
        starts_m = [scenario.circuits[i].start_m for i in numbers]
        there = state[:, STATE.index["track_index"]] == track
        places = (
            np.searchsorted(starts_m, state[there, STATE.index["chainage_m"]], side="right") - 1
        )
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
    valid = on_line & (received[:, CODE_RECEIVED.index["valid"]] > 0.0)
    word = np.where(valid, received[:, CODE_RECEIVED.index["word"]], np.nan)
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


def _entered_occupied(
    scenario: Scenario,
    recording: Recording,
    index: int,
    on_line: NDArray[np.bool_],
    circuit: NDArray[np.intp],
) -> int:
    """Circuits that the front of a train entered while another train was in them."""
    starts_m = np.array([c.start_m for c in scenario.circuits])
    ends_m = np.array([c.end_m for c in scenario.circuits])
    enters = on_line.copy()
    enters[1:] &= (circuit[1:] != circuit[:-1]) & on_line[:-1]
    enters[:1] = False
    entered = 0
    for ahead, front_m, rear_m in trains_ahead(scenario, recording, index, on_line):
        inside = ahead & (rear_m < ends_m[circuit]) & (front_m > starts_m[circuit])
        entered += int(np.count_nonzero(enters & inside))
    return entered
