"""Where the base stations of the train radio stand: evenly along every track."""

from __future__ import annotations

import math
from dataclasses import dataclass

from rail_corridor.scenario.model import Scenario
from rail_world.line.network import Network

from .section import CBTC, CbtcPlan


@dataclass(frozen=True)
class Base:
    """One base station.

    ``chainage_m`` is the place on its track beside which it stands, ``position_m`` that of its
    antennas in the map [m].
    """

    name: str
    track: str
    chainage_m: float
    position_m: tuple[float, float, float]
    channel: int


def bases_of(scenario: Scenario) -> tuple[Base, ...]:
    """Base stations of a scenario in the order of its tracks; none without the section."""
    return scenario.derive(_placed)


def _placed(scenario: Scenario) -> tuple[Base, ...]:
    plan = CBTC.of(scenario)
    return () if plan is None else place_bases(scenario.network, plan)


def place_bases(network: Network, plan: CbtcPlan) -> tuple[Base, ...]:
    """Base stations in the middle of equal cells, none longer than planned, channels in turn."""
    bases: list[Base] = []
    for name, track in network.tracks.items():
        count = max(1, math.ceil(track.length_m / plan.base_spacing_m - 1e-9))
        for index in range(count):
            chainage_m = (index + 0.5) * track.length_m / count
            pose = track.pose(chainage_m)
            # To the right of the track, as the masts of the ranging stations.
            x = float(pose.x_m) + plan.mast_offset_m * math.sin(float(pose.heading_rad))
            y = float(pose.y_m) - plan.mast_offset_m * math.cos(float(pose.heading_rad))
            z = float(pose.z_m) + plan.mast_height_m
            channel = len(bases) % plan.channels + 1
            bases.append(Base(f"base{len(bases) + 1}", name, chainage_m, (x, y, z), channel))
    return tuple(bases)
