"""What went wrong under track codes, by the truth: blocks entered that were occupied."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_corridor.equipment.supervision_report import trains_ahead
from rail_corridor.equipment.true_events import events_of
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.world import STATE

from .placement import circuits_of
from .report import circuit_of


def code_events(scenario: Scenario, recording: RunData) -> Iterator[dict[str, Any]]:
    """An event for each occupied block that the front of a train entered."""
    for index in range(len(scenario.trains)):
        flags = entered_occupied(scenario, recording, index)
        text = "entered an occupied block"
        yield from events_of("occupied block entered", text, flags, scenario, recording, index)


def entered_occupied(scenario: Scenario, recording: RunData, index: int) -> NDArray[np.bool_]:
    """Ticks [tick] in which the front of a train comes to a circuit in which another one is."""
    state = recording[STATE].upto(recording.ticks)
    on_line = state[:, index, STATE.index["on_line"]] > 0.0
    circuit = circuit_of(scenario, recording, state[:, index])
    starts_m = np.array([each.start_m for each in circuits_of(scenario)])[circuit]
    ends_m = np.array([each.end_m for each in circuits_of(scenario)])[circuit]
    enters = on_line.copy()
    enters[1:] &= (circuit[1:] != circuit[:-1]) & on_line[:-1]
    enters[:1] = False
    occupied = np.zeros(len(state), dtype=bool)
    for ahead, front_m, rear_m in trains_ahead(scenario, recording, index, on_line):
        occupied |= ahead & (front_m > starts_m) & (rear_m < ends_m)
    entered: NDArray[np.bool_] = enters & occupied
    return entered
