"""Scenarios, launcher and report of the corridor; `simulate` runs one in a Python loop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .stepped.simulation import Simulation


def simulate(
    scenario: Any, *, seed: int | None = None, duration_s: float | None = None
) -> Simulation:
    """A scenario as a loop over its ticks; see `rail_corridor.stepped.simulation`."""
    from .stepped.simulation import Simulation

    return Simulation(scenario, seed=seed, duration_s=duration_s)
