"""Phase ranging as the corridor sees it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np
from rich.console import RenderableType

from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.map_scene import MapMarkers, MapScene, TrackEstimate
from rail_corridor.equipment.node_spec import NodeKind, NodeSpec
from rail_corridor.equipment.run_figures import RunFigures
from rail_corridor.equipment.subsystem import PlanContext, SectionOption, Subsystem
from rail_corridor.run_data import RecordSpec, RunData, in_one_message, per_train
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.position import position_from_cdr
from rail_msgs_py.topics import ranging as topics
from rail_msgs_py.topics.ranging import LINKS, POSITION, VRS_CHANNEL
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray
from rail_world.line.description_base import Description
from rail_world.line.drawing import Drawing

from .calibration import transponders_of
from .checks import check_ranging
from .layout import layout_of
from .nodes import ranging_nodes
from .report import POSITION_COLUMNS, ranging_table, train_metrics
from .section import CHANNELS, RADIO, SIGNAL, STATIONS, TRANSPONDER, DeadStation, Jam
from .summary import summary
from .world import drawing_of, radio_of


class RangingSubsystem(Subsystem):
    """Wayside stations that range trains by the phase of a tone, and who tracks them by it."""

    name = "ranging"
    sections = (STATIONS, CHANNELS, SIGNAL, RADIO, TRANSPONDER)
    faults = (DeadStation, Jam)
    options = (SectionOption("--zone-length", "stations", "zone_length_m", ("positions",)),)
    hazards = (
        "trains.*.phase_ranging.wrong_track_ticks",
        "trains.*.phase_ranging.misleading_ticks",
    )
    nodes = (
        NodeKind(
            "radio_medium",
            "rail_world.ranging.medium_node:RadioMediumNode",
            sink=True,
            waits=True,
            reads=(STATE,),
        ),
        NodeKind("wrs", "rail_wayside.ranging.wrs_node:WrsNode", clocked=True),
        NodeKind(
            "zone_controller",
            "rail_wayside.zone_controller_node:ZoneControllerNode",
            clocked=True,
            sink=True,
            waits=True,
        ),
        NodeKind("vrs", "rail_onboard.ranging.vrs_node:VrsNode"),
    )
    topics = topics.TOPICS
    locates_by = POSITION

    def check(self, scenario: Scenario, train_fields: Sequence[str]) -> None:
        """See `Subsystem.check`."""
        check_ranging(scenario, train_fields)

    def plan(self, scenario: Scenario, context: PlanContext) -> Sequence[NodeSpec]:
        """See `Subsystem.plan`."""
        return ranging_nodes(scenario, context)

    def offer(self, kind: str, scenario: Scenario, train: str) -> Mapping[str, Any]:
        """The localizer learns where another station starts to range."""
        if kind != "localizer":
            return {}
        track = next(each.route[0] for each in scenario.trains if each.name == train)
        zones = [zone for zone in layout_of(scenario).zones if zone.track == track]
        return {"zone_starts_m": tuple(sorted(zone.start_m for zone in zones)), "ranged": True}

    def world(self, scenario: Scenario) -> Mapping[str, Description]:
        """See `Subsystem.world`."""
        return {"ranging": radio_of(scenario)}

    def drawing(self, scenario: Scenario) -> Drawing:
        """See `Subsystem.drawing`."""
        return drawing_of(scenario)

    def announcement(self, scenario: Scenario) -> Mapping[str, Any]:
        """Stations and zones."""
        layout = layout_of(scenario)
        return {
            "stations": [
                {"name": s.name, "track": s.track, "at_m": s.at_m, "position_m": s.position_m}
                for s in layout.stations
            ],
            "zones": [
                {
                    "name": zone.name,
                    "station": zone.station,
                    "track": zone.track,
                    "start_m": zone.start_m,
                    "end_m": zone.end_m,
                    "downlink": zone.downlink_channel,
                    "uplink": zone.uplink_channel,
                }
                for zone in layout.zones
            ],
        }

    def summary(self, scenario: Scenario) -> Iterable[RenderableType]:
        """See `Subsystem.summary`."""
        return summary(scenario)

    def records(self, scenario: Scenario) -> Sequence[RecordSpec]:
        """Positions, channels in force, and the truth of the links."""
        names = tuple(train.name for train in scenario.trains)
        tracks = {name: index for index, name in enumerate(scenario.tracks)}
        channels = len({zone.downlink_channel for zone in layout_of(scenario).zones})

        def position(raw: bytes) -> tuple[int, FloatArray]:
            stamp_ns, track, (chainage_m, variance_m2, speed_mps, _) = position_from_cdr(raw)
            values = (tracks.get(track, -1), chainage_m, variance_m2, speed_mps)
            return stamp_ns, np.array([values])

        return (
            RecordSpec(POSITION, per_train(names), columns=len(POSITION_COLUMNS), decode=position),
            RecordSpec(VRS_CHANNEL, per_train(names), columns=2 + channels),
            RecordSpec(LINKS, in_one_message(names), estimated=False),
        )

    def train_report(self, scenario: Scenario, data: RunData, train: int) -> dict[str, Any]:
        """See `Subsystem.train_report`."""
        errors = train_metrics(scenario, data, train)
        unit = transponders_of(scenario)[data.trains[train]]
        errors["phase_ranging"]["calibration_residual_m"] = unit.residual_m
        return errors

    def tables(self, report: Mapping[str, Any]) -> Iterable[RenderableType]:
        """See `Subsystem.tables`."""
        yield ranging_table(report)

    def live(self) -> LiveView:
        """See `Subsystem.live`."""
        from .cards import RangingView  # wanted by the live page only

        return RangingView()

    def run_figures(self) -> RunFigures:
        """See `Subsystem.run_figures`."""
        from .run_figures import RangingFigures  # wanted by the figures only

        return RangingFigures()

    def map_markers(self, scene: MapScene) -> MapMarkers:
        """See `Subsystem.map_markers`."""
        from .map_markers import position_markers  # wanted by the report only

        return position_markers(scene)

    def map_estimate(self, scene: MapScene, train: int) -> TrackEstimate | None:
        """See `Subsystem.map_estimate`."""
        from .map_markers import position_estimate  # wanted by the report only

        return position_estimate(scene, train)


RANGING: Final = RangingSubsystem()
