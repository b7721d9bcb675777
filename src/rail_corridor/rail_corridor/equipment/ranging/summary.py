"""What ``rail check`` shows of phase ranging."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from rich.console import RenderableType
from rich.table import Table

from rail_corridor.scenario.model import Scenario

from .layout import layout_of

_MOST_ZONES_SHOWN: Final = 24


def summary(scenario: Scenario) -> Iterator[RenderableType]:
    """Zones with their stations and channels."""
    layout = layout_of(scenario)
    for name in scenario.network.tracks:
        zones = [zone for zone in layout.zones if zone.track == name]
        longest_m = max(zone.length_m for zone in zones)
        yield f"track {name}: {len(zones)} zones up to {longest_m:.0f} m"
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
    yield table
    if len(layout.zones) > _MOST_ZONES_SHOWN:
        yield f"... and {len(layout.zones) - _MOST_ZONES_SHOWN} more zones"
