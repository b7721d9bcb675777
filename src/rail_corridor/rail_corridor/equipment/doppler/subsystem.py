"""Doppler positioning as the corridor sees it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from rich.console import RenderableType

from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.map_scene import MapScene, TrackEstimate
from rail_corridor.equipment.node_spec import NodeKind, NodeSpec
from rail_corridor.equipment.position_errors import position_table
from rail_corridor.equipment.run_figures import RunFigures
from rail_corridor.equipment.subsystem import PlanContext, SectionOption, Subsystem
from rail_corridor.run_data import RecordSpec, RunData, per_train
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics import doppler as topics
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.world import STATE
from rail_world.line.description_base import Description

from .checks import check_doppler
from .nodes import doppler_nodes
from .placement import references_of
from .section import REFERENCES, DeadReference, DetunedReference
from .world import reference_description


class DopplerSubsystem(Subsystem):
    """Reference stations by whose Doppler shifts trains find their place."""

    name = "doppler"
    sections = (REFERENCES,)
    faults = (DeadReference, DetunedReference)
    options = (
        SectionOption("--spacing", "references", "spacing_m"),
        SectionOption("--offset", "references", "offset_m"),
    )
    nodes = (
        NodeKind(
            "reference_medium",
            "rail_world.doppler.medium_node:ReferenceMediumNode",
            sink=True,
            waits=True,
            reads=(STATE,),
        ),
        NodeKind(
            "reference_station",
            "rail_wayside.doppler.reference_station_node:ReferenceStationNode",
            clocked=True,
        ),
        NodeKind(
            "doppler_positioner",
            "rail_onboard.doppler.positioner_node:DopplerPositionerNode",
            waits=True,
        ),
    )
    topics = topics.TOPICS
    locates_by = DOPPLER_FIX

    def check(self, scenario: Scenario, train_fields: Sequence[str]) -> None:
        """See `Subsystem.check`."""
        check_doppler(scenario, train_fields)

    def plan(self, scenario: Scenario, context: PlanContext) -> Sequence[NodeSpec]:
        """See `Subsystem.plan`."""
        return doppler_nodes(scenario, context)

    def offer(self, kind: str, scenario: Scenario, train: str) -> Mapping[str, Any]:
        """The localizer learns that there is a positioner."""
        return {"doppler": True} if kind == "localizer" and self.present(scenario) else {}

    def world(self, scenario: Scenario) -> Mapping[str, Description]:
        """See `Subsystem.world`."""
        described = reference_description(scenario)
        return {} if described is None else {"doppler": described}

    def announcement(self, scenario: Scenario) -> Mapping[str, Any]:
        """Reference stations."""
        return {
            "references": [
                {
                    "name": station.name,
                    "track": station.track,
                    "at_m": station.chainage_m,
                    "position_m": station.position_m,
                }
                for station in references_of(scenario)
            ]
        }

    def records(self, scenario: Scenario) -> Sequence[RecordSpec]:
        """Positions by Doppler shifts."""
        if not self.present(scenario):
            return ()
        return (RecordSpec(DOPPLER_FIX, per_train(train.name for train in scenario.trains)),)

    def train_report(self, scenario: Scenario, data: RunData, train: int) -> dict[str, Any]:
        """See `Subsystem.train_report`."""
        if not self.present(scenario):
            return {}
        # Loaded where it is wanted: the bound takes much of SciPy with it.
        from .report import doppler_metrics

        return doppler_metrics(scenario, data, train)

    def tables(self, report: Mapping[str, Any]) -> Iterable[RenderableType]:
        """See `Subsystem.tables`."""
        table = position_table("positions on board by Doppler shifts", report["trains"], "doppler")
        if table is not None:
            yield table

    def live(self) -> LiveView:
        """See `Subsystem.live`."""
        from .cards import DopplerView  # wanted by the live page only

        return DopplerView()

    def map_estimate(self, scene: MapScene, train: int) -> TrackEstimate | None:
        """See `Subsystem.map_estimate`."""
        row = scene.row(DOPPLER_FIX, train)
        if row is None or row["reason"] != 0.0:
            return None
        return TrackEstimate(scene.first_tracks[train], row["chainage_m"], row["chainage_m2"])

    def run_figures(self) -> RunFigures:
        """See `Subsystem.run_figures`."""
        from .run_figures import DopplerFigures  # wanted by the figures only

        return DopplerFigures()


DOPPLER: Final = DopplerSubsystem()
