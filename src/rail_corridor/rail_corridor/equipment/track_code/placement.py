"""Where the track circuits lie: blocks in a row along every track, their carriers in turn."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from rail_corridor.scenario.model import Scenario
from rail_signals.track_code.scales import IDENTITIES
from rail_world.line.network import Network
from rail_world.line.track import Track

from .section import TRACK_CIRCUITS, TrackCircuitPlan


@dataclass(frozen=True)
class Circuit:
    """One track circuit.

    From ``start_m`` to ``end_m`` [m] of chainage; trains run towards ``end_m``, where the
    transmitter stands. ``identity`` is what its codes say of themselves. ``limit_mps`` is the
    lowest speed limit in it, ``gradient_permil`` the steepest fall (negative: downhill in the
    running direction), both under any part of the longest train whose front is in the circuit.
    """

    name: str
    track: str
    start_m: float
    end_m: float
    carrier_hz: float
    identity: int
    limit_mps: float
    gradient_permil: float

    @property
    def length_m(self) -> float:
        """Length along the track [m]."""
        return self.end_m - self.start_m


def circuits_of(scenario: Scenario) -> tuple[Circuit, ...]:
    """Track circuits of a scenario in the order of its tracks; none without the section."""
    return scenario.derive(_placed)


def _placed(scenario: Scenario) -> tuple[Circuit, ...]:
    plan = TRACK_CIRCUITS.of(scenario)
    if plan is None:
        return ()
    longest_m = max((train.vehicle.length_m for train in scenario.trains), default=0.0)
    return place_circuits(scenario.network, plan, longest_m)


def place_circuits(
    network: Network, plan: TrackCircuitPlan, longest_train_m: float = 0.0
) -> tuple[Circuit, ...]:
    """Divide every track into circuits of equal length, none longer than planned."""
    circuits: list[Circuit] = []
    for name, track in network.tracks.items():
        count = max(1, math.ceil(track.length_m / plan.length_m - 1e-9))
        borders = np.linspace(0.0, track.length_m, count + 1).tolist()
        for index, (start_m, end_m) in enumerate(itertools.pairwise(borders)):
            circuits.append(
                Circuit(
                    f"tc{len(circuits) + 1}",
                    name,
                    start_m,
                    end_m,
                    plan.carriers_hz[index % len(plan.carriers_hz)],
                    IDENTITIES[index % len(IDENTITIES)],
                    *_worst(track, max(0.0, start_m - longest_train_m), end_m),
                )
            )
    return tuple(circuits)


def _worst(track: Track, start_m: float, end_m: float) -> tuple[float, float]:
    """Lowest limit [m/s] and steepest fall [permil] of a part of a track."""
    places_m = np.append(np.arange(start_m, end_m, 1.0), end_m)
    # A limit that begins where the circuit ends belongs to the next one.
    inside = places_m[places_m < end_m - 1e-6]
    return float(track.limit_mps(inside).min()), float(track.gradient_permil(inside).min())
