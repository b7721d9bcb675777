"""Where the reference stations stand: evenly along every track, on both sides in turn."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rail_corridor.scenario.model import Scenario
from rail_world.line.network import Network

from .section import REFERENCES, ReferencePlan


@dataclass(frozen=True)
class Reference:
    """One reference station.

    ``chainage_m`` is the place on its track beside which it stands, ``position_m`` that of its
    antenna in the map [m], ``slot`` that of its tone.
    """

    name: str
    track: str
    chainage_m: float
    position_m: tuple[float, float, float]
    slot: int


def references_of(scenario: Scenario) -> tuple[Reference, ...]:
    """Reference stations of a scenario in the order of its tracks; none without the section."""
    return scenario.derive(_placed)


def _placed(scenario: Scenario) -> tuple[Reference, ...]:
    plan = REFERENCES.of(scenario)
    return () if plan is None else place_references(scenario.network, plan)


def place_references(network: Network, plan: ReferencePlan) -> tuple[Reference, ...]:
    """Reference stations from the start to the end of every track, evenly, tones in turn."""
    references: list[Reference] = []
    for name, track in network.tracks.items():
        cells = max(1, math.ceil(track.length_m / plan.spacing_m - 1e-9))
        for index in range(cells + 1):
            chainage_m = index * track.length_m / cells
            pose = track.pose(chainage_m)
            # Positive is to the left.
            aside_m = plan.offset_m * (1.0 if len(references) % 2 else -1.0)
            x = float(pose.x_m) - aside_m * math.sin(float(pose.heading_rad))
            y = float(pose.y_m) + aside_m * math.cos(float(pose.heading_rad))
            place = (x, y, float(pose.z_m) + plan.height_m)
            slot = len(references) % plan.slots
            references.append(Reference(f"ref{len(references) + 1}", name, chainage_m, place, slot))
    return tuple(references)
