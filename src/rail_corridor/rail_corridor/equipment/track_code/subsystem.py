"""Track codes as the corridor sees them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from rich.console import RenderableType

from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.node_spec import NodeKind, NodeSpec
from rail_corridor.equipment.subsystem import PlanContext, Subsystem, Supervision
from rail_corridor.run_data import RecordSpec, RunData, per_train
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics import track_code as topics
from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_SENT, OCCUPANCY
from rail_msgs_py.topics.world import COMMAND, ODOMETER, STATE
from rail_world.line.description_base import Description

from .checks import check_codes
from .line_speeds import allowed_kmh, speeds_of
from .nodes import code_nodes
from .placement import circuits_of
from .report import code_metrics, code_table
from .run_events import code_events
from .section import RAIL_FAULTS, TRACK_CIRCUITS
from .world import rails_of

_SUPERVISION: Final = "code_supervision"


class TrackCodeSubsystem(Subsystem):
    """FM codes in the rails, which trains decode and obey."""

    name = "track_code"
    sections = (TRACK_CIRCUITS,)
    faults = RAIL_FAULTS
    hazards = (
        "trains.*.track_code.wrong",
        "trains.*.atp.entered_occupied",
        "trains.*.atp.overspeed_s",
        "trains.*.atp.above_code_s",
        "trains.*.atp.foreign_obeyed_s",
        "trains.*.track_code.false_clear_s",
    )
    nodes = (
        NodeKind(
            "rail_medium",
            "rail_world.track_code.medium_node:RailMediumNode",
            sink=True,
            waits=True,
            reads=(STATE,),
        ),
        NodeKind(
            "track_code_transmitter",
            "rail_wayside.track_code.transmitter_node:TrackCodeTransmitterNode",
            clocked=True,
            waits=True,
        ),
        NodeKind(
            "track_code_receiver",
            "rail_onboard.track_code.receiver_node:TrackCodeReceiverNode",
        ),
        NodeKind(
            _SUPERVISION,
            "rail_onboard.track_code.supervision_node:CodeSupervisionNode",
            waits=True,
            reads=(ODOMETER,),
        ),
    )
    topics = topics.TOPICS

    def check(self, scenario: Scenario, train_fields: Sequence[str]) -> None:
        """See `Subsystem.check`."""
        check_codes(scenario, train_fields)

    def supervision(self, scenario: Scenario) -> Supervision | None:
        """See `Subsystem.supervision`."""
        plan = TRACK_CIRCUITS.of(scenario)
        if plan is None:
            return None
        # The block before an occupied one may be barred too.
        queue_m = 200.0 + 2.0 * plan.length_m
        return Supervision(_SUPERVISION, plan.cab_signals, plan.odometer_error, queue_m)

    def plan(self, scenario: Scenario, context: PlanContext) -> Sequence[NodeSpec]:
        """See `Subsystem.plan`."""
        return code_nodes(scenario, context)

    def offer(self, kind: str, scenario: Scenario, train: str) -> Mapping[str, Any]:
        """The localizer learns the joints on its way, and the carriers behind them."""
        if kind != "localizer":
            return {}
        described = next(each for each in scenario.trains if each.name == train)
        joints = [c for c in circuits_of(scenario) if c.track == described.route[0]]
        forward = described.direction > 0
        behind = joints[1:] if forward else joints[:-1]
        return {
            "joints_m": tuple(c.start_m if forward else c.end_m for c in behind),
            "joint_carriers_hz": tuple(c.carrier_hz for c in behind),
        }

    def world(self, scenario: Scenario) -> Mapping[str, Description]:
        """See `Subsystem.world`."""
        rails = rails_of(scenario)
        return {} if rails is None else {"track_code": rails}

    def announcement(self, scenario: Scenario) -> Mapping[str, Any]:
        """Circuits, and the speeds that their codes can tell."""
        return {
            "code_speeds_kmh": speeds_of(scenario),
            "circuits": [
                {
                    "name": circuit.name,
                    "track": circuit.track,
                    "start_m": circuit.start_m,
                    "end_m": circuit.end_m,
                    "carrier_hz": circuit.carrier_hz,
                }
                for circuit in circuits_of(scenario)
            ],
        }

    def summary(self, scenario: Scenario) -> Iterable[RenderableType]:
        """See `Subsystem.summary`."""
        circuits = circuits_of(scenario)
        if circuits:
            longest_m = max(circuit.length_m for circuit in circuits)
            yield (
                f"{len(circuits)} track circuits up to {longest_m:.0f} m, "
                f"{circuits[0].name} ... {circuits[-1].name}; trains obey their codes"
            )
        yield from slow_blocks(scenario)

    def records(self, scenario: Scenario) -> Sequence[RecordSpec]:
        """Codes sent and understood, and what supervision commanded."""
        if not self.present(scenario):
            return ()
        names = [train.name for train in scenario.trains]
        circuits = {circuit.name: {"circuit": circuit.name} for circuit in circuits_of(scenario)}
        return (
            RecordSpec(CODE_RECEIVED, per_train(names)),
            RecordSpec(COMMAND, per_train(names, supervision=_SUPERVISION)),
            RecordSpec(CODE_SENT, circuits, estimated=False, awaited=False),
            RecordSpec(OCCUPANCY, circuits, estimated=False, awaited=False),
        )

    def train_report(self, scenario: Scenario, data: RunData, train: int) -> dict[str, Any]:
        """See `Subsystem.train_report`."""
        return code_metrics(scenario, data, train) if self.present(scenario) else {}

    def events(self, scenario: Scenario, data: RunData) -> Iterable[dict[str, Any]]:
        """See `Subsystem.events`."""
        return code_events(scenario, data) if self.present(scenario) else ()

    def tables(self, report: Mapping[str, Any]) -> Iterable[RenderableType]:
        """See `Subsystem.tables`."""
        table = code_table(report["trains"])
        if table is not None:
            yield table

    def live(self) -> LiveView:
        """See `Subsystem.live`."""
        from .cards import TrackCodeView  # wanted by the live page only

        return TrackCodeView()


def slow_blocks(scenario: Scenario) -> Iterable[str]:
    """What codes allow, where it is less than the limit."""
    plan, circuits = TRACK_CIRCUITS.of(scenario), circuits_of(scenario)
    if plan is None:
        return
    speeds = speeds_of(scenario)
    slow: dict[tuple[float, float, float], list[str]] = {}
    allowed = allowed_kmh(circuits, plan.braking_mps2, speeds)
    for circuit in circuits:
        limit_kmh = 3.6 * circuit.limit_mps
        if allowed[circuit.name] < limit_kmh - 1e-6:
            key = (round(circuit.length_m, 1), allowed[circuit.name], round(limit_kmh, 1))
            slow.setdefault(key, []).append(circuit.name)
    for (length_m, kmh, limit_kmh), names in slow.items():
        yield (
            f"blocks of {length_m:.0f} m allow {kmh:g} km/h of {limit_kmh:g}: {names[0]}"
            + (f" and {len(names) - 1} more" if names[1:] else "")
        )


TRACK_CODE: Final = TrackCodeSubsystem()
