"""What a corridor reports of itself on ``/world/scenario``: one JSON object, complete in itself.

Beside the scenario as it was loaded it holds what follows from it - where all equipment stands -
so that who draws or replays a run needs none of this package.
"""

from __future__ import annotations

import json
from typing import Any

from rail_corridor.equipment.registry import subsystems
from rail_corridor.scenario.model import Scenario


def announcement(scenario: Scenario) -> str:
    """JSON text of a scenario and its layout."""
    found: dict[str, Any] = _line(scenario)
    for subsystem in subsystems():
        found |= subsystem.announcement(scenario)
    return json.dumps(found | {"scenario": json.loads(scenario.to_json())})


def _line(scenario: Scenario) -> dict[str, Any]:
    network = scenario.network
    junctions = {junction.branch: junction for junction in network.junctions}
    return {
        "name": scenario.name,
        "description": scenario.description,
        "seed": scenario.seed,
        "tick_s": scenario.tick_s,
        "duration_s": scenario.duration_s,
        "tracks": [
            {
                "name": name,
                "length_m": track.length_m,
                "from": junctions[name].track if name in junctions else None,
                "from_m": junctions[name].at_m if name in junctions else 0.0,
            }
            for name, track in network.tracks.items()
        ],
        "trains": [
            {
                "name": train.name,
                "length_m": train.vehicle.length_m,
                "direction": train.direction,
                "route": list(train.route),
            }
            for train in scenario.trains
        ],
        "faults": [
            fault.model_dump(mode="json") | {"subject": fault.subject} for fault in scenario.faults
        ],
    }
