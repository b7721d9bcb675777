"""What a scenario holds, for ``rail check`` and ``rail scenarios``."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from .model import Scenario, builtin_scenarios
from .yaml_file import load_yaml

_MOST_ZONES_SHOWN = 24


def print_summary(scenario: Scenario, console: Console) -> None:
    """Show tracks, zones with their channels, and trains."""
    layout, network = scenario.layout, scenario.network
    console.print(f"[bold]{scenario.name}[/bold]: {scenario.description}", soft_wrap=True)
    for name, track in network.tracks.items():
        parent = network.parent_junction(name)
        where = f", branches off {parent.track} at {parent.at_m:.0f} m" if parent else ""
        zones = [zone for zone in layout.zones if zone.track == name]
        longest_m = max(zone.length_m for zone in zones)
        console.print(
            f"track {name}: {track.length_m / 1000.0:.2f} km, {len(track.stops_m)} stops, "
            f"{len(zones)} zones up to {longest_m:.0f} m{where}"
        )
    table = Table(title=f"{len(layout.stations)} stations", title_justify="left")
    for heading in ("zone", "station", "track", "from", "to", "channels"):
        table.add_column(heading, justify="right" if heading in ("from", "to") else "left")
    for zone in layout.zones[:_MOST_ZONES_SHOWN]:
        table.add_row(
            zone.name,
            zone.station,
            zone.track,
            f"{zone.start_m:.1f} m",
            f"{zone.end_m:.1f} m",
            f"CH{zone.downlink_channel}/CH{zone.uplink_channel}",
        )
    console.print(table)
    if len(layout.zones) > _MOST_ZONES_SHOWN:
        console.print(f"... and {len(layout.zones) - _MOST_ZONES_SHOWN} more zones")
    if scenario.circuits:
        circuits = scenario.circuits
        longest_m = max(circuit.length_m for circuit in circuits)
        console.print(
            f"{len(circuits)} track circuits up to {longest_m:.0f} m, "
            f"{circuits[0].name} ... {circuits[-1].name}; trains obey their codes"
        )
    for train in scenario.trains[:_MOST_ZONES_SHOWN]:
        console.print(
            f"train {train.name}: over {', '.join(train.route)} from {train.start_m:.0f} m, "
            f"departs at {train.depart_s:.0f} s"
        )
    if len(scenario.trains) > _MOST_ZONES_SHOWN:
        console.print(f"... and {len(scenario.trains) - _MOST_ZONES_SHOWN} more trains")
    console.print(f"{scenario.ticks} ticks of {scenario.tick_s:g} s, seed {scenario.seed}")


def print_scenarios(console: Console) -> None:
    """Show names and descriptions."""
    for name, path in builtin_scenarios().items():
        data = load_yaml(path)
        console.print(f"[bold]{name:12}[/bold] {data.get('description', '')}", soft_wrap=True)
