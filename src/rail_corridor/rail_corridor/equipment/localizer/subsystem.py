"""The localizer as the corridor sees it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import isfinite
from typing import Any, Final

from rich.console import RenderableType

from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.map_scene import MapMarkers, MapScene, TrackEstimate
from rail_corridor.equipment.node_spec import NodeKind, NodeSpec
from rail_corridor.equipment.one_way import check_one_way
from rail_corridor.equipment.position_errors import position_table
from rail_corridor.equipment.run_figures import RunFigures
from rail_corridor.equipment.subsystem import PlanContext, Subsystem
from rail_corridor.run_data import RecordSpec, RunData, per_train
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics import localizer as topics
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.world import ODOMETER

from .nodes import localizer_nodes
from .report import localizer_metrics
from .section import LOCALIZER_SECTION

#: Nodes that run on its position where there is one.
_READERS: Final = ("atp", "code_supervision", "doppler_positioner")


class LocalizerSubsystem(Subsystem):
    """One position on board from all sensors, which trains then run on."""

    name = "localizer"
    sections = (LOCALIZER_SECTION,)
    hazards = ("trains.*.localizer.exceeded",)
    nodes = (
        NodeKind(
            "localizer",
            "rail_onboard.localizer.localizer_node:LocalizerNode",
            waits=True,
            reads=(ODOMETER,),
        ),
    )
    topics = topics.TOPICS
    locates_by = LOCALIZER_STATE

    def check(self, scenario: Scenario, train_fields: Sequence[str]) -> None:
        """See `Subsystem.check`."""
        if self.present(scenario):
            check_one_way(scenario, train_fields, LOCALIZER_SECTION.name)

    def odometer_error(self, scenario: Scenario) -> float | None:
        """See `Subsystem.odometer_error`."""
        plan = LOCALIZER_SECTION.of(scenario)
        return None if plan is None else plan.odometer_error

    def plan(self, scenario: Scenario, context: PlanContext) -> Sequence[NodeSpec]:
        """See `Subsystem.plan`."""
        return localizer_nodes(scenario, context)

    def offer(self, kind: str, scenario: Scenario, train: str) -> Mapping[str, Any]:
        """Those who run on a position learn that it comes from here."""
        return {"localizer": True} if kind in _READERS and self.present(scenario) else {}

    def records(self, scenario: Scenario) -> Sequence[RecordSpec]:
        """Positions with their protection levels."""
        if not self.present(scenario):
            return ()
        return (RecordSpec(LOCALIZER_STATE, per_train(train.name for train in scenario.trains)),)

    def train_report(self, scenario: Scenario, data: RunData, train: int) -> dict[str, Any]:
        """See `Subsystem.train_report`."""
        return localizer_metrics(data, train) if self.present(scenario) else {}

    def tables(self, report: Mapping[str, Any]) -> Iterable[RenderableType]:
        """See `Subsystem.tables`."""
        title = "positions on board from all sensors"
        more = ("protection_level_m", "exceeded")
        table = position_table(title, report["trains"], "localizer", *more)
        if table is not None:
            yield table

    def live(self) -> LiveView:
        """See `Subsystem.live`."""
        from .cards import LocalizerView  # wanted by the live page only

        return LocalizerView()

    def run_figures(self) -> RunFigures:
        """See `Subsystem.run_figures`."""
        from .run_figures import LocalizerFigures  # wanted by the figures only

        return LocalizerFigures()

    def map_markers(self, scene: MapScene) -> MapMarkers:
        """See `Subsystem.map_markers`."""
        from .map_markers import interval_markers  # wanted by the report only

        return interval_markers(scene)

    def map_estimate(self, scene: MapScene, train: int) -> TrackEstimate | None:
        """See `Subsystem.map_estimate`."""
        row = scene.row(LOCALIZER_STATE, train)
        if row is None or not isfinite(row["front_m"]):
            return None
        return TrackEstimate(scene.first_tracks[train], row["front_m"], row["sigma_m"] ** 2)


LOCALIZER: Final = LocalizerSubsystem()
