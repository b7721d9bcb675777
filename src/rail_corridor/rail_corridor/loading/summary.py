"""What a scenario holds, for ``rail check`` and ``rail scenarios``."""

from __future__ import annotations

from typing import Final

from rich.console import Console

from rail_corridor.equipment.registry import subsystems
from rail_corridor.scenario.model import Scenario
from rail_corridor.yaml_file import load_yaml

from .loader import builtin_scenarios
from .start_checks import climbing_troubles

_MOST_TRAINS_SHOWN: Final = 24


def print_summary(scenario: Scenario, console: Console) -> None:
    """Show tracks, what all equipment makes of them, and trains."""
    network = scenario.network
    about = f": {scenario.description}" if scenario.description else ""
    console.print(f"[bold]{scenario.name}[/bold]{about}", soft_wrap=True)
    for name, track in network.tracks.items():
        parent = network.parent_junction(name)
        where = f", branches off {parent.track} at {parent.at_m:.0f} m" if parent else ""
        length_km = track.length_m / 1000.0
        console.print(f"track {name}: {length_km:.2f} km, {len(track.stops_m)} stops{where}")
    for subsystem in subsystems():
        for part in subsystem.summary(scenario):
            console.print(part)
    for train in scenario.trains[:_MOST_TRAINS_SHOWN]:
        console.print(
            f"train {train.name}: over {', '.join(train.route)} from {train.start_m:.0f} m, "
            f"departs at {train.depart_s:.0f} s"
        )
    if len(scenario.trains) > _MOST_TRAINS_SHOWN:
        console.print(f"... and {len(scenario.trains) - _MOST_TRAINS_SHOWN} more trains")
    for trouble in climbing_troubles(scenario):
        console.print(f"[yellow]warning[/yellow]: {trouble}", soft_wrap=True, highlight=False)
    console.print(f"{scenario.ticks} ticks of {scenario.tick_s:g} s, seed {scenario.seed}")


def print_scenarios(console: Console) -> None:
    """Show names and descriptions."""
    for name, path in builtin_scenarios().items():
        data = load_yaml(path)
        console.print(f"[bold]{name:12}[/bold] {data.get('description', '')}", soft_wrap=True)
