"""A whole corridor in one process, against the documented topics and parameters."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from rail_corridor.cli.topic_docs import declared_by, document, ends_of, main, type_name
from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.registry import kind_of, node_kinds, topics
from rail_corridor.loading.loader import load_scenario
from rail_corridor.loading.overrides import Overrides
from rail_corridor.plan.plan import make_plan
from rail_corridor.report.observer import Observer
from rail_corridor.run.host import make_node
from rail_msgs_py.quantity import quantity_of
from rail_msgs_py.topics import doppler, localizer, track_code, train_bus, train_radio
from rail_msgs_py.topics.ranging import LINKS, POSITION, VRS_CHANNEL
from rail_msgs_py.topics.train_radio import BACKBONE_DOWN, BACKBONE_UP, STRIKES
from rail_msgs_py.topics.world import COMMAND, ODOMETER, STATE

TICKS = 12
RADIO, RAILS, BUS = train_radio.TOPICS, track_code.TOPICS, train_bus.TOPICS
THREATS = [BACKBONE_DOWN, BACKBONE_UP, STRIKES]
PLACES = [*doppler.TOPICS, *localizer.TOPICS]
SUPERVISION = [ODOMETER, COMMAND]
#: Scenarios with every kind of node between them, and the topics that each does without.
SCENARIOS = {
    "follow_codes": [*RADIO, *PLACES, *BUS],
    "hostile_network": [*RAILS, *PLACES, *BUS],
    "located_block": [*RAILS, *THREATS, *BUS],
    "failing_bus": [*RADIO, *RAILS, *SUPERVISION, *PLACES, *THREATS],
}
#: What rclpy itself offers beside the corridor's topics.
ROS_OWN = ("/rosout", "/parameter_events")


@dataclasses.dataclass
class Corridor:
    """The nodes of a run, by kind, and the report's ear."""

    nodes: dict[str, list[Any]]
    observer: Observer
    specs: dict[str, NodeSpec]


def start(graph: Any, directory: Path, name: str = "follow_codes") -> Corridor:
    """Run a few ticks of a scenario, all nodes in this process, to the end."""
    scenario = load_scenario(name, overrides=Overrides(duration_s=0.25 * TICKS))
    plan = make_plan(scenario, directory)
    nodes: dict[str, list[Any]] = {}
    for spec in plan.nodes:
        node = graph.add(make_node(spec, graph.context, True))
        nodes.setdefault(spec.kind, []).append(node)
    observer = Observer(plan, lambda: None, context=graph.context)
    graph.add(observer)
    graph.wait(lambda: observer.complete)
    return Corridor(nodes, observer, {spec.name: spec for spec in plan.nodes})


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_every_topic_and_every_parameter_is_documented_and_used_as_documented(
    graph: Any, tmp_path: Path, scenario: str
) -> None:
    corridor = start(graph, tmp_path, scenario)
    kinds = {spec.name: spec.kind for spec in corridor.specs.values()}
    kinds["/report"] = "report"
    seen = set()
    strangers = []
    for name, types in graph.bystander.get_topic_names_and_types():
        if name in ROS_OWN or name.endswith("/transition_event"):
            continue
        topic = kind_of(name)
        assert topic is not None, name
        seen.add(topic.pattern)
        assert types == [type_name(topic.type)]
        sender, readers = ends_of(topic)
        for role, documented, ends in (
            ("sends", sender, graph.bystander.get_publishers_info_by_topic(name)),
            ("reads", readers, graph.bystander.get_subscriptions_info_by_topic(name)),
        ):
            for end in ends:
                assert end.qos_profile.reliability == topic.qos.reliability
                assert end.qos_profile.durability == topic.qos.durability
                if end.node_name != "bystander":
                    kind = kinds[f"{end.node_namespace.rstrip('/')}/{end.node_name}"]
                    if kind not in documented and "every node" not in documented:
                        strangers.append((name, role, kind))
    assert strangers == []
    # And every documented topic is there.
    assert seen == {topic.pattern for topic in topics() if topic not in SCENARIOS[scenario]}
    check_parameters(corridor)


def test_every_kind_of_node_runs_here(tmp_path: Path) -> None:
    plans = [make_plan(load_scenario(name), tmp_path) for name in SCENARIOS]
    kinds = {spec.kind for plan in plans for spec in plan.nodes}
    assert kinds == set(node_kinds())


def check_parameters(corridor: Corridor) -> None:
    """Every parameter that a node declares is one of its kind, described as there."""
    ros_own = {"use_sim_time", "start_type_description_service"}
    for kind, nodes in corridor.nodes.items():
        fields = declared_by(kind)
        for node in nodes:
            declared = set(node.list_parameters([], 0).names)
            declared = {name for name in declared if not name.startswith("qos_overrides")}
            assert declared - ros_own == set(fields)
            for name, field in fields.items():
                described = node.describe_parameter(name)
                assert described.description == quantity_of(field).description
                assert described.read_only


def test_the_run_is_whole_and_nothing_was_lost(graph: Any, tmp_path: Path) -> None:
    observer = start(graph, tmp_path).observer
    recording = observer.recording
    assert observer.failures == []
    assert recording.ticks == observer.finished_ticks == TICKS
    for record in (recording[STATE], recording[LINKS], recording[VRS_CHANNEL], recording[POSITION]):
        assert record.ticks == TICKS


def test_the_document_is_fresh() -> None:
    path = Path(__file__).resolve().parents[2] / "docs" / "topics.md"
    again = "run: python -m rail_corridor.cli.topic_docs docs/topics.md"
    assert path.read_text(encoding="utf-8") == document(), again


def test_the_document_is_written_or_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "topics.md"
    assert main([str(path)]) == 0
    assert main([]) == 0
    assert capsys.readouterr().out == path.read_text(encoding="utf-8")
    assert main(["a", "b"]) == 2


def test_every_field_of_every_node_is_described() -> None:
    for kind in node_kinds():
        for field in declared_by(kind).values():
            assert quantity_of(field).text.strip()
            suffix = field.name.rpartition("_")[2]
            units = {"s": "s", "hz": "Hz", "m": "m", "dbm": "dBm"}
            if suffix in units:
                assert quantity_of(field).unit == units[suffix], field.name
