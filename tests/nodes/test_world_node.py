"""The world as a node: it drives the ticks, and goes on when a node it waits for is dead."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import WORLD, Plan, make_plan
from rail_msgs_py.failures import failure
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.position import Position
from rail_msgs_py.stamps import clock_from_cdr, to_ns
from rail_msgs_py.table import Table
from rail_msgs_py.topics.tick import (
    CLOCK,
    DONE,
    FAILED,
    FINISHED,
    NO_READER,
    NO_SENDER,
    READY,
    WAITING,
)
from rail_msgs_py.topics.world import CORRIDOR_MARKERS, CORRIDOR_PATH, STATE, TRUTH
from rail_world.world_node import WorldNode

TICK_NS = 100_000_000
SINKS = ("/sink_a", "/sink_b")


class World:
    """The world of the plain line; the test is what it waits for."""

    def __init__(self, graph: Any, plan: Plan, **parameters: Any) -> None:
        self.graph = graph
        (spec,) = (spec for spec in plan.nodes if spec.name == WORLD)
        given = {
            **spec.parameters,
            "nodes": (),
            "sinks": SINKS,
            "clock_readers": 1,
            "observed": False,
            "timeout_s": 20.0,
            **parameters,
        }
        self.clock = graph.mailbox(CLOCK, raw=True)
        self.state = graph.mailbox(STATE)
        self.truth = graph.mailbox(TRUTH, train="train_a")
        self.finished = graph.mailbox(FINISHED)
        self.done = {sink: graph.sender(DONE, node=sink) for sink in given["sinks"]}
        graph.add(WorldNode(context=graph.context, parameters=given))
        graph.connect(WORLD)

    def ticks(self, count: int) -> None:
        """Wait until so many ticks have begun."""
        self.graph.wait(lambda: len(self.clock) >= count and len(self.state) >= count)

    def finish(self, tick: int, *sinks: str) -> None:
        for sink in sinks:
            self.done[sink](header_to_cdr(tick * TICK_NS))


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return make_plan(load_scenario("plain_line"), tmp_path)


def test_a_tick_ends_when_every_sink_is_done(graph: Any, plan: Plan) -> None:
    world = World(graph, plan, ticks=3)
    for tick in range(3):
        world.ticks(tick + 1)
        assert len(world.clock) == tick + 1
        world.finish(tick, *reversed(SINKS))
    graph.wait(lambda: world.finished)
    assert [clock_from_cdr(raw) for raw in world.clock] == [0, TICK_NS, 2 * TICK_NS]
    assert to_ns(world.finished[0].stamp) == 2 * TICK_NS
    assert not graph.failed


def test_a_done_of_another_tick_does_not_count(graph: Any, plan: Plan) -> None:
    world = World(graph, plan, ticks=2)
    world.ticks(1)
    world.finish(0, SINKS[0], SINKS[0])
    world.finish(1, SINKS[0])
    # Had any of these ended the tick, the stamps below would not be the first two.
    world.finish(0, SINKS[1])
    world.ticks(2)
    assert [clock_from_cdr(raw) for raw in world.clock] == [0, TICK_NS]


def test_the_truth_is_that_of_the_scenario(graph: Any, plan: Plan) -> None:
    world = World(graph, plan, ticks=21, sinks=())
    graph.wait(lambda: world.finished and len(world.state) == 21 and len(world.truth) == 3)
    rows = [Table.from_msg(message).row("train_a") for message in world.state]
    speed_mps = 80.0 / 3.6
    assert [row["path_m"] for row in rows] == pytest.approx(
        [40.0 + speed_mps * 0.1 * tick for tick in range(21)], abs=1e-6
    )
    assert np.allclose([(row["y_m"], row["heading_rad"]) for row in rows], 0.0)
    assert {row["on_line"] for row in rows} == {1.0}
    # Once a second, as an odometry of infinite sureness.
    places = [Position.from_msg(message) for message in world.truth]
    assert [place.stamp_ns for place in places] == [0, 10 * TICK_NS, 20 * TICK_NS]
    assert places[1].chainage_m == pytest.approx(40.0 + speed_mps)
    assert (places[1].track, places[1].variance_m2) == ("main", 0.0)


def test_a_dead_sink_is_named_and_the_world_goes_on(graph: Any, plan: Plan) -> None:
    world = World(graph, plan, ticks=4, timeout_s=0.1)
    world.ticks(1)
    world.finish(0, SINKS[0])
    world.ticks(2)
    assert [status.name for status in graph.failed] == [SINKS[1]]
    for tick in (1, 2):
        world.finish(tick, SINKS[0])
        world.ticks(tick + 2)
    # Heard again, it is waited for again.
    world.finish(3, SINKS[1])
    world.finish(3, SINKS[0])
    graph.wait(lambda: world.finished)
    assert len(graph.failed) == 1
    messages = [s.message for array in graph.diagnostics for s in array.status]
    assert f"no answer from {SINKS[1]}" in messages


def test_with_every_sink_dead_the_world_still_ends(graph: Any, plan: Plan) -> None:
    world = World(graph, plan, ticks=5, timeout_s=0.1)
    graph.wait(lambda: world.finished)
    assert len(world.clock) == 5
    assert {status.name for status in graph.failed} == set(SINKS)


def test_it_waits_for_nodes_to_be_ready_but_not_for_ever(graph: Any, plan: Plan) -> None:
    world = World(graph, plan, ticks=1, sinks=(), nodes=("/late",), start_timeout_s=0.1)
    graph.wait(lambda: world.finished)
    assert [status.name for status in graph.failed] == ["/late"]


def waits(node: str, **topics: str) -> DiagnosticStatus:
    values = [KeyValue(key=f"/{topic}/done", value=lacks) for topic, lacks in topics.items()]
    return DiagnosticStatus(name=node, values=values)


def test_it_begins_once_nobody_is_left_to_wait_for(graph: Any, plan: Plan) -> None:
    # One has failed, one waits for what only that one could be, one is late to be ready.
    waiting, failed, ready = graph.sender(WAITING), graph.sender(FAILED), graph.sender(READY)
    nodes = ("/gone", "/waiter", "/late")
    world = World(graph, plan, ticks=1, sinks=(), nodes=nodes)
    waiting(waits("/waiter", gone=NO_SENDER, nobody=NO_READER))
    failed(failure("/gone", "died", "the launcher"))
    graph.wait(lambda: len(graph.failed) == 1)
    assert not world.clock
    ready(String(data="/late"))
    graph.wait(lambda: world.finished)
    assert [status.name for status in graph.failed] == ["/gone"]


def test_what_somebody_living_can_be_is_waited_for_and_then_done_without(
    graph: Any, plan: Plan
) -> None:
    graph.bystander.create_publisher(DONE.type, DONE.name(node="/living"), DONE.qos)
    waiting, failed = graph.sender(WAITING), graph.sender(FAILED)
    world = World(graph, plan, ticks=1, sinks=(), nodes=("/gone", "/waiter"), start_timeout_s=0.5)
    waiting(waits("/waiter", living=NO_SENDER))
    failed(failure("/gone", "died", "the launcher"))
    graph.wait(lambda: world.finished)
    assert [status.name for status in graph.failed] == ["/gone"]
    messages = [s.message for array in graph.diagnostics for s in array.status]
    assert "begins although /waiter waits for /living/done" in messages


def test_who_is_given_up_does_not_let_the_clock_run_ahead_of_the_others(
    graph: Any, plan: Plan
) -> None:
    failed = graph.sender(FAILED)
    world = World(graph, plan, ticks=3, nodes=("/sink_b",))
    failed(failure("/sink_b", "died", "the launcher"))
    for tick in range(3):
        world.ticks(tick + 1)
        assert len(world.clock) == tick + 1
        if tick == 1:  # of a tick that is over: it lives, and is waited for again
            world.finish(0, "/sink_b")
            world.finish(1, "/sink_b")
        world.finish(tick, "/sink_a")
        if tick == 2:
            world.finish(2, "/sink_b")
    graph.wait(lambda: world.finished)
    assert [status.name for status in graph.failed] == ["/sink_b"]


def test_late_joiners_learn_the_map_and_the_end(graph: Any, plan: Plan) -> None:
    world = World(graph, plan, ticks=1, sinks=())
    graph.wait(lambda: world.finished)
    path = graph.mailbox(CORRIDOR_PATH, track="main")
    markers = graph.mailbox(CORRIDOR_MARKERS)
    graph.wait(lambda: path and markers)
    poses = path[0].poses
    assert path[0].header.frame_id == "map"
    assert (poses[0].pose.position.x, poses[-1].pose.position.x) == (0.0, 1200.0)
    names = {marker.text for marker in markers[0].markers if marker.text}
    assert names == {mast.name for mast in plan.world.drawing.masts}


def test_a_reader_with_ros_defaults_hears_the_world(graph: Any, plan: Plan) -> None:
    heard: list[Any] = []
    graph.bystander.create_subscription(
        TRUTH.type, TRUTH.name(train="train_a"), heard.append, QoSProfile(depth=10)
    )
    World(graph, plan, ticks=1, sinks=())
    graph.wait(lambda: heard)
