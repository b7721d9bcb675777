"""Train control by radio as the corridor sees it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from rich.console import RenderableType

from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.node_spec import NodeKind, NodeSpec
from rail_corridor.equipment.run_figures import RunFigures
from rail_corridor.equipment.subsystem import PlanContext, Subsystem, Supervision
from rail_corridor.run_data import RecordSpec, RunData, in_one_message, per_train
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics import train_radio as topics
from rail_msgs_py.topics.train_radio import (
    ATP_STATE,
    AUTHORITY,
    CBTC_LINKS,
    RADIO_LINK,
    REPORTS,
    STRIKES,
)
from rail_msgs_py.topics.world import COMMAND, ODOMETER, STATE
from rail_world.line.description_base import Description

from .checks import check_cbtc
from .nodes import burst_format, cbtc_nodes, controller_parameters, radio_parameters
from .placement import bases_of
from .report import authority_table, cbtc_events, cbtc_metrics
from .section import CBTC, ClockError, DeadBaseStation, NetworkThreats
from .threat_metrics import threat_line, threat_metrics
from .world import cbtc_description, threats_of

_MEDIUM: Final = "rail_world.train_radio"


class TrainRadioSubsystem(Subsystem):
    """The space-time coded radio that carries position reports and movement authorities."""

    name = "train_radio"
    sections = (CBTC,)
    faults = (DeadBaseStation, NetworkThreats, ClockError)
    hazards = (
        "trains.*.cbtc.forged_accepted",
        "trains.*.cbtc.forged_reports",
        "trains.*.cbtc.mislocated",
        "trains.*.atp.passed_authority",
        "trains.*.atp.overspeed_s",
    )
    nodes = (
        NodeKind(
            "cbtc_medium",
            f"{_MEDIUM}.medium_node:CbtcMediumNode",
            sink=True,
            waits=True,
            reads=(STATE,),
        ),
        NodeKind(
            "backbone", f"{_MEDIUM}.backbone_node:BackboneNode", clocked=True, sink=True, waits=True
        ),
        NodeKind(
            "cbtc_base_station",
            "rail_wayside.train_radio.base_station_node:CbtcBaseStationNode",
            clocked=True,
            waits=True,
        ),
        NodeKind(
            "cbtc_radio",
            "rail_onboard.train_radio.radio_node:CbtcRadioNode",
            clocked=True,
            waits=True,
        ),
        NodeKind(
            "atp",
            "rail_onboard.train_radio.atp_node:AtpNode",
            waits=True,
            reads=(ODOMETER,),
        ),
    )
    topics = topics.TOPICS

    def check(self, scenario: Scenario, train_fields: Sequence[str]) -> None:
        """See `Subsystem.check`."""
        check_cbtc(scenario, train_fields)

    def supervision(self, scenario: Scenario) -> Supervision | None:
        """See `Subsystem.supervision`."""
        plan = CBTC.of(scenario)
        if plan is None:
            return None
        return Supervision(
            "atp",
            plan.cab_signals,
            plan.odometer_error,
            queue_m=200.0 + plan.margin_m,
            tells_restrictions=True,
        )

    def plan(self, scenario: Scenario, context: PlanContext) -> Sequence[NodeSpec]:
        """See `Subsystem.plan`."""
        return cbtc_nodes(scenario, context)

    def offer(self, kind: str, scenario: Scenario, train: str) -> Mapping[str, Any]:
        """The zone controller gives authorities; ranges come to the localizer by radio."""
        if not self.present(scenario):
            return {}
        if kind == "localizer":
            return {"told": True, "ranged": False}
        return controller_parameters(scenario) if kind == "zone_controller" else {}

    def world(self, scenario: Scenario) -> Mapping[str, Description]:
        """See `Subsystem.world`."""
        described, threats = cbtc_description(scenario), threats_of(scenario)
        if described is None:
            return {}
        return {"train_radio": described} | ({"threats": threats} if threats.periods else {})

    def announcement(self, scenario: Scenario) -> Mapping[str, Any]:
        """Base stations, and what the bursts are made of."""
        plan = CBTC.of(scenario)
        bases = [
            {
                "name": base.name,
                "track": base.track,
                "at_m": base.chainage_m,
                "position_m": base.position_m,
                "channel": base.channel,
            }
            for base in bases_of(scenario)
        ]
        if plan is None:
            return {"bases": bases, "bursts": None}
        burst = burst_format(plan)
        size = {"data_bits": burst.data_bits, "samples": burst.samples}
        return {"bases": bases, "bursts": radio_parameters(scenario, plan) | size}

    def records(self, scenario: Scenario) -> Sequence[RecordSpec]:
        """Links, authorities and reports at both ends, and what protection commanded."""
        if not self.present(scenario):
            return ()
        names = [train.name for train in scenario.trains]
        rows = per_train(names)
        specs = [
            RecordSpec(RADIO_LINK, rows),
            RecordSpec(ATP_STATE, rows),
            RecordSpec(AUTHORITY, rows),
            RecordSpec(COMMAND, per_train(names, supervision="atp")),
            RecordSpec(REPORTS, rows, estimated=False, events=True),
            RecordSpec(CBTC_LINKS, in_one_message(names), estimated=False, awaited=False),
        ]
        if threats_of(scenario).periods:
            specs.append(RecordSpec(STRIKES, {"backbone": {}}, estimated=False))
        return specs

    def train_report(self, scenario: Scenario, data: RunData, train: int) -> dict[str, Any]:
        """See `Subsystem.train_report`."""
        return cbtc_metrics(scenario, data, train) if self.present(scenario) else {}

    def run_report(self, scenario: Scenario, data: RunData) -> dict[str, Any]:
        """See `Subsystem.run_report`."""
        return {"threats": threat_metrics(data)} if STRIKES in data else {}

    def events(self, scenario: Scenario, data: RunData) -> Iterable[dict[str, Any]]:
        """See `Subsystem.events`."""
        return cbtc_events(scenario, data) if self.present(scenario) else ()

    def tables(self, report: Mapping[str, Any]) -> Iterable[RenderableType]:
        """See `Subsystem.tables`."""
        table = authority_table(report["trains"])
        if table is not None:
            yield table
        line = threat_line(report)
        if line is not None:
            yield line

    def live(self) -> LiveView:
        """See `Subsystem.live`."""
        from .cards import TrainRadioView  # wanted by the live page only

        return TrainRadioView()

    def run_figures(self) -> RunFigures:
        """See `Subsystem.run_figures`."""
        from .run_figures import TrainRadioFigures  # wanted by the figures only

        return TrainRadioFigures()


TRAIN_RADIO: Final = TrainRadioSubsystem()
