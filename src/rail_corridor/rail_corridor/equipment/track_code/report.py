"""From a run to values: track codes sent and understood, and what came of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from rail_corridor.equipment.supervision_report import supervision_metrics, trains_ahead
from rail_corridor.equipment.tables import new_table
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_SENT
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray

from .claims import OLDEST_S, circuit_claims, code_claims
from .placement import circuits_of

__all__ = ["OLDEST_S", "circuit_of", "code_metrics", "code_table"]


def code_metrics(scenario: Scenario, recording: RunData, index: int) -> dict[str, Any]:
    """Sections ``track_code`` and ``atp`` of one train."""
    ticks = recording.ticks
    state = recording[STATE].upto(ticks)
    on_line = state[:, index, STATE.index["on_line"]] > 0.0
    circuit = circuit_of(scenario, recording, state[:, index])
    sent = recording[CODE_SENT].upto(ticks)[:, :, CODE_SENT.index["word"]]
    here = np.where(on_line, sent[np.arange(ticks), circuit], np.nan)
    received = recording[CODE_RECEIVED].upto(ticks)[:, index]
    return {
        "track_code": _codes(scenario.tick_s, on_line, circuit, here, received)
        | circuit_claims(scenario, recording, index, on_line, circuit),
        "atp": supervision_metrics(scenario, recording, index, on_line)
        | {"entered_occupied": _entered_occupied(scenario, recording, index, on_line, circuit)}
        | code_claims(scenario, recording, index, on_line, circuit),
    }


def circuit_of(scenario: Scenario, recording: RunData, state: FloatArray) -> NDArray[np.intp]:
    """Index of the circuit that the front of a train is in, at each tick."""
    sensed = np.zeros(len(state), dtype=np.intp)
    for track, name in enumerate(recording.tracks):
        numbers = [i for i, circuit in enumerate(circuits_of(scenario)) if circuit.track == name]
        starts_m = [circuits_of(scenario)[i].start_m for i in numbers]
        there = state[:, STATE.index["track_index"]] == track
        places = (
            np.searchsorted(starts_m, state[there, STATE.index["chainage_m"]], side="right") - 1
        )
        sensed[there] = np.array(numbers)[np.clip(places, 0, len(numbers) - 1)]
    return sensed


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
    recording: RunData,
    index: int,
    on_line: NDArray[np.bool_],
    circuit: NDArray[np.intp],
) -> int:
    """Circuits that the front of a train entered while another train was in them."""
    starts_m = np.array([c.start_m for c in circuits_of(scenario)])
    ends_m = np.array([c.end_m for c in circuits_of(scenario)])
    enters = on_line.copy()
    enters[1:] &= (circuit[1:] != circuit[:-1]) & on_line[:-1]
    enters[:1] = False
    entered = 0
    for ahead, front_m, rear_m in trains_ahead(scenario, recording, index, on_line):
        inside = ahead & (rear_m < ends_m[circuit]) & (front_m > starts_m[circuit])
        entered += int(np.count_nonzero(enters & inside))
    return entered


def code_table(trains: Mapping[str, Any]) -> Table | None:
    """What trains understood from the rails, and what supervision did; None without circuits."""
    obeying = {name: train for name, train in trains.items() if "track_code" in train}
    if not obeying:
        return None
    table = new_table(
        "codes understood, and supervision",
        *(
            "train",
            "codes",
            "wrong",
            "valid",
            "after s",
            "braked",
            "over s",
            "above s",
            "entered",
            "gap m",
        ),
    )
    for name, train in obeying.items():
        code, atp = train["track_code"], train["atp"]
        margin_m = atp["margin_min_m"]
        table.add_row(
            name,
            f"{code['decoded']}/{code['sent']}",
            str(code["wrong"]),
            "-" if code["availability"] is None else f"{100.0 * code['availability']:.0f} %",
            "-" if code["latency_s"] is None else f"{code['latency_s']:.2f}",
            str(atp["interventions"]),
            f"{atp['overspeed_s']:.1f}",
            f"{atp['above_code_s']:.1f}",
            str(atp["entered_occupied"]),
            "-" if margin_m is None else f"{margin_m:.0f}",
        )
    return table
