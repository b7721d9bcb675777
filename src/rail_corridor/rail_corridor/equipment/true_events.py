"""From a recording to events: what went wrong for a train, by the truth, and where."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.world import STATE


def events_of(
    kind: str,
    text: str,
    flags: NDArray[np.bool_],
    scenario: Scenario,
    recording: RunData,
    index: int,
) -> Iterator[dict[str, Any]]:
    """An event for each tick in which something begins.

    Parameters
    ----------
    kind, text : str
        What it is; the text goes on after the name of the train.
    flags : bool array [tick]
        Whether it is so.
    scenario : Scenario
    recording : RunData
    index : int
        Of the train.
    """
    begins = flags.copy()
    begins[1:] &= ~flags[:-1]
    state = recording[STATE].upto(recording.ticks)
    name = scenario.trains[index].name
    for tick in np.flatnonzero(begins).tolist():
        mine = state[tick, index]
        track = recording.tracks[int(mine[STATE.index["track_index"]])]
        at_m = float(mine[STATE.index["chainage_m"]])
        yield {
            "time_s": tick * scenario.tick_s,
            "kind": kind,
            "train": name,
            "track": track,
            "at_m": at_m,
            "message": f"{name} {text}, at {at_m:.1f} m of {track}",
        }
