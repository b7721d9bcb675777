"""Names of nodes and topics that remapping rules change, and names that are taken."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from rail_corridor.equipment.registry import node_kinds
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import make_plan
from rail_corridor.run.host import make_node
from rail_msgs_py import namesakes
from rail_msgs_py.namesakes import NameTakenError, sole_bearer
from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.topics.ranging import RANGE, WRS_RX, WRS_TX
from rail_msgs_py.topics.tick import CLOCK, READY
from rail_onboard.ranging.vrs_node import VrsNode
from rail_onboard.train_bus.terminal_node import BusTerminalNode
from rail_wayside.ranging.wrs_node import WrsNode

#: Only ever reached by a test that fails.
PATIENCE_S = 30.0


@contextmanager
def started(kind: Any, domain: int, *rules: str, **parameters: Any) -> Iterator[Any]:
    """Make a node as on the command line."""
    context = rclpy.Context()
    rclpy.init(
        args=["--ros-args", *(part for rule in rules for part in ("-r", rule))],
        context=context,
        domain_id=domain,
        signal_handler_options=SignalHandlerOptions.NO,
    )
    node = None
    try:
        node = kind(context=context, services=False, parameters=parameters)
        yield node
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown(context=context)


def topics_of(node: Any) -> set[str]:
    return {name for name, _ in node.get_topic_names_and_types()}


def test_a_station_is_named_after_its_site_and_takes_its_topics_along(ros_domain: int) -> None:
    with started(WrsNode, ros_domain, "__node:=wrs9", "__ns:=/x/wayside") as node:
        assert node.place == "wrs9"
        assert {"/x/wayside/wrs9/zone1/tx", "/x/wayside/wrs9/zone1/rx", "/clock"} <= topics_of(node)


def test_equipment_that_is_renamed_takes_its_own_topics_along(ros_domain: int) -> None:
    with started(VrsNode, ros_domain, "__node:=spare", "__ns:=/train_b") as node:
        assert node.place == "train_b"
        assert "/train_b/spare/tx" in topics_of(node)
        assert not any("vrs" in name for name in topics_of(node))
    with started(BusTerminalNode, ros_domain, "__node:=rear", end="tail") as node:
        assert "/train_1/rear/tx" in topics_of(node)


def test_a_namespace_that_names_no_train_is_one_line(ros_domain: int) -> None:
    with (
        pytest.raises(ParameterError, match=r"vrs: __ns: '/': names neither a train nor a site"),
        started(VrsNode, ros_domain, "__ns:=/"),
    ):
        pass


def test_a_node_with_remapped_topics_says_that_it_is_ready(ros_domain: int) -> None:
    rules = ("/clock:=/x/clock", "/wayside/wrs1/zone1/rx:=/x/rx")
    with started(WrsNode, ros_domain, *rules) as station:
        others = Node("others", context=station.context, use_global_arguments=False)
        for topic, name in ((CLOCK, "/x/clock"), (WRS_RX, "/x/rx")):
            others.create_publisher(topic.type, name, topic.qos)
        for topic in (WRS_TX, RANGE):
            name = topic.name(site="wrs1", zone="zone1")
            others.create_subscription(topic.type, name, lambda message: None, topic.qos)
        ready: list[str] = []
        others.create_subscription(READY.type, READY.name(), ready.append, READY.qos)
        executor = SingleThreadedExecutor(context=station.context)
        for node in (station, others):
            executor.add_node(node)
        deadline_s = time.monotonic() + PATIENCE_S
        while not ready and time.monotonic() < deadline_s:
            executor.spin_once(timeout_sec=0.05)
        executor.shutdown()
        others.destroy_node()
        assert [message.data for message in ready] == ["/wayside/wrs1"]


@pytest.mark.parametrize("name", ["branch", "failing_bus", "hostile_network", "located_codes"])
def test_without_rules_every_node_is_under_its_listed_name(
    graph: Any, tmp_path: Path, name: str
) -> None:
    plan = make_plan(load_scenario(name), tmp_path)
    for spec in {spec.kind: spec for spec in plan.nodes}.values():
        node = graph.add(make_node(spec, graph.context, False))
        assert node.listed_name == node.get_fully_qualified_name() == spec.name


@pytest.mark.parametrize("kind", node_kinds())
def test_a_node_that_cannot_do_without_parameters_names_one_and_its_value(
    graph: Any, kind: str
) -> None:
    try:
        graph.add(node_kinds()[kind].load()(context=graph.context, services=False))
    except ParameterError as error:
        assert re.fullmatch(r"\w+: \w+: (''|\(\)): .+", str(error))


def test_a_name_is_held_on_this_host_until_it_is_let_go(
    graph: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(namesakes, "LOOK_S", 0.0)
    node = Node("only", context=graph.context, start_parameter_services=False)
    with (
        sole_bearer(node),
        pytest.raises(NameTakenError, match=r"^/only: a node of this name is running in ROS"),
        sole_bearer(node),
    ):
        pass
    with sole_bearer(node):
        pass
    node.destroy_node()


def test_a_namesake_elsewhere_counts_only_if_it_answers(graph: Any) -> None:
    silent = Node("twin", context=graph.context, start_parameter_services=False)
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=graph.context.get_domain_id())
    lone = Node("twin", context=context, start_parameter_services=False)
    try:
        with sole_bearer(lone):  # as of a node that was killed, and is still shown
            pass
        executor = SingleThreadedExecutor(context=graph.context)
        executor.add_node(silent)
        thread = threading.Thread(target=executor.spin, daemon=True)
        thread.start()
        with pytest.raises(NameTakenError, match=r"^/twin: "):
            sole_bearer(lone).__enter__()
        executor.shutdown()
        thread.join()
    finally:
        lone.destroy_node()
        silent.destroy_node()
        rclpy.try_shutdown(context=context)
