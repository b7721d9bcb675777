"""Medium, detection point and evaluator as nodes, each through its topics alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from axle_counter.signals.section_counter import Occupancy
from axle_counter.signals.wheel_sensor import WheelSensor
from axle_counter.topics import COILS, PASSAGES, RESET, SECTIONS
from axle_counter.wayside.detection_point_node import DetectionPointNode
from axle_counter.wayside.evaluator_node import AxleEvaluatorNode
from axle_counter.world.medium_node import WheelSensorMediumNode
from builders import Graph
from std_msgs.msg import String

from rail_corridor.plan.plan import make_plan
from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.table import Table, TableWriter
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.waveform import Waveform

TICK_NS = 100_000_000
SENSOR = WheelSensor()


def values(message: Any) -> dict[str, dict[str, float]]:
    """Return the rows of a table by name."""
    table = Table.from_msg(message)
    return {name: table.row(name) for name in table.rows}


def test_the_medium_delivers_the_amplitudes_of_every_sensor(
    graph: Graph, tmp_path: Path, scenario: Callable[..., Any]
) -> None:
    plan = make_plan(scenario(), tmp_path)
    (spec,) = (spec for spec in plan.nodes if spec.kind == "wheel_sensor_medium")
    graph.add(WheelSensorMediumNode(context=graph.context, parameters=spec.parameters))
    boxes = {point: graph.mailbox(COILS, point=point) for point in ("dp1", "dp2", "dp3")}
    done = graph.mailbox(DONE, node=spec.name)
    send = graph.sender(STATE)
    writer = TableWriter(("a",), STATE.columns)
    axle_m = scenario().derive(lambda made: made.axle_counters.cars.axles_m(118.0))[0]
    for tick, path_m in enumerate((200.0, 200.0 + axle_m)):
        row = np.zeros((1, len(STATE.columns)))
        row[0, STATE.index["path_m"]] = row[0, STATE.index["chainage_m"]] = path_m
        row[0, STATE.index["on_line"]] = 1.0
        send(writer.write(tick * TICK_NS, row))
        graph.wait(lambda tick=tick: len(done) > tick)
    graph.wait(lambda: all(len(box) == 2 for box in boxes.values()))
    blocks = {point: Waveform.from_msg(box[1]) for point, box in boxes.items()}
    assert {block.stamp_ns for block in blocks.values()} == {TICK_NS}
    assert {block.samples.shape for block in blocks.values()} == {(2, 800)}
    assert {block.sample_rate_hz for block in blocks.values()} == {8000.0}
    # An axle has just come to the middle of the first sensor; the others have none near.
    on_both_v = SENSOR.rest_v - float(SENSOR.dip_v(0.5 * SENSOR.coil_spacing_m))
    assert blocks["dp1"].samples[:, -1].real == pytest.approx([on_both_v] * 2, abs=0.03)
    assert np.abs(blocks["dp2"].samples.real - SENSOR.rest_v).max() < 0.03


class Point:
    """A detection point whose coils the test plays."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.node = graph.add(DetectionPointNode(namespace="/wayside/dp7", context=graph.context))
        self.box = graph.mailbox(PASSAGES, point="dp7")
        self._send = graph.sender(COILS, point="dp7")
        self._tick = -1

    def shows(self, samples_v: Any) -> dict[str, float]:
        """Return what is told of the samples [coil, sample] of one more tick."""
        self._tick += 1
        samples = np.asarray(samples_v, dtype=np.complex128)
        self._send(Waveform(self._tick * TICK_NS, 8000.0, 0.0, 0, samples).to_msg())
        self.graph.wait(lambda: len(self.box) > self._tick)
        assert Table.from_msg(self.box[-1]).stamp_ns == self._tick * TICK_NS
        return values(self.box[-1])["dp7"]


def of_wheel(path_m: Any) -> Any:
    """Return what the coils show of a wheel [coil, sample]."""
    return SENSOR.rest_v - SENSOR.dip_v(np.asarray(path_m) - np.array(SENSOR.coils_m)[:, None])


REST = {"forward": 0.0, "backward": 0.0, "unclear": 0.0, "busy": 0.0, "valid": 1.0}


def test_a_detection_point_counts_an_axle_that_two_blocks_share(graph: Graph) -> None:
    point, half = Point(graph), np.linspace(-0.5, 0.0, 800)
    assert point.shows(np.ones((2, 800))) == REST
    assert point.shows(of_wheel(half)) == {**REST, "busy": 1.0}
    assert point.shows(of_wheel(half + 0.5)) == {**REST, "forward": 1.0}
    assert point.shows(of_wheel(-half)) == {**REST, "busy": 1.0}
    assert point.shows(of_wheel(-half - 0.5)) == {**REST, "backward": 1.0}


def test_a_detection_point_that_is_off_or_without_samples_says_so(graph: Graph) -> None:
    point = Point(graph)
    assert point.shows(np.ones((2, 800)))["valid"] == 1.0
    assert point.shows(np.empty((2, 0)))["valid"] == 0.0  # silence
    assert point.shows(np.ones((1, 800)))["valid"] == 0.0  # one coil alone
    assert point.shows(np.full((2, 800), np.nan))["valid"] == 0.0
    point.node.trigger_deactivate()
    assert point.shows(of_wheel(np.linspace(-0.5, 0.0, 800)))["valid"] == 0.0
    # Switched on again with a wheel above it, it cannot tell where that came from.
    point.node.trigger_activate()
    assert point.shows(of_wheel(np.zeros(800))) == {**REST, "busy": 1.0}
    assert point.shows(of_wheel(np.linspace(0.0, 0.5, 800))) == {**REST, "unclear": 1.0}


EVALUATOR = {
    "sections": ("s1", "s2"),
    "border_sections": ("s1", "s1", "s2", "s2"),
    "border_points": ("a", "b", "b", "c"),
    "border_inward": (1, -1, 1, -1),
    "empty_at_start": ("s1", "s2"),
}


class Evaluator:
    """An evaluator with three detection points that the test plays."""

    def __init__(self, graph: Graph, **parameters: Any) -> None:
        self.graph = graph
        given = {**EVALUATOR, **parameters}
        self.node = graph.add(AxleEvaluatorNode(context=graph.context, parameters=given))
        self.box = graph.mailbox(SECTIONS)
        self.done = graph.mailbox(DONE, node="/wayside/axle_counter")
        self._clock = graph.sender(CLOCK)
        self._points = {point: graph.sender(PASSAGES, point=point) for point in "abc"}
        self.reset = graph.sender(RESET)
        self._tick = -1

    def tick(self, dead: str = "", **seen: str) -> tuple[int, int]:
        """Return occupancies after a tick, in which points say other than that nothing passed."""
        self._tick += 1
        self._clock(clock_to_cdr(self._tick * TICK_NS))
        for point, send in self._points.items():
            if point not in dead:
                row = dict(REST)
                if point in seen:
                    row[seen[point]] = 1.0
                figures = np.array([[row[name] for name in PASSAGES.columns]])
                writer = TableWriter((point,), PASSAGES.columns)
                send(writer.write(self._tick * TICK_NS, figures))
        self.graph.wait(lambda: len(self.done) > self._tick and len(self.box) > self._tick)
        rows = values(self.box[-1])
        return int(rows["s1"]["occupancy"]), int(rows["s2"]["occupancy"])


FREE, OCCUPIED, NOT_KNOWN = (int(each) for each in Occupancy)


def test_an_evaluator_follows_a_train_through_its_sections(graph: Graph) -> None:
    evaluator = Evaluator(graph)
    assert evaluator.tick() == (FREE, FREE)
    assert evaluator.tick(a="forward") == (OCCUPIED, FREE)
    assert evaluator.tick(b="busy") == (OCCUPIED, OCCUPIED)
    assert evaluator.tick(b="forward") == (FREE, OCCUPIED)
    assert evaluator.tick(c="forward") == (FREE, FREE)
    assert evaluator.tick(b="unclear") == (NOT_KNOWN, NOT_KNOWN)


def test_an_evaluator_that_is_switched_on_again_knows_nothing_until_reset_and_swept(
    graph: Graph,
) -> None:
    evaluator = Evaluator(graph)
    assert evaluator.tick() == (FREE, FREE)
    evaluator.node.trigger_deactivate()
    assert evaluator.tick(a="forward") == (NOT_KNOWN, NOT_KNOWN)
    evaluator.node.trigger_activate()
    assert evaluator.tick() == (NOT_KNOWN, NOT_KNOWN)
    asked = evaluator.node._asked
    evaluator.reset(String(data="s2"))
    evaluator.reset(String(data="no_such_section"))
    graph.wait(lambda: len(asked) == 2)
    assert evaluator.tick() == (NOT_KNOWN, NOT_KNOWN)
    assert evaluator.tick(b="forward") == (NOT_KNOWN, NOT_KNOWN)
    assert evaluator.tick(c="forward") == (NOT_KNOWN, FREE)
    assert evaluator.tick(b="forward") == (NOT_KNOWN, OCCUPIED)


def test_a_reset_at_a_known_time_and_only_then(graph: Graph) -> None:
    resets = {"reset_sections": ("s1",), "reset_times_s": (0.25,), "reset": "conditional"}
    evaluator = Evaluator(graph, empty_at_start=(), **resets)
    assert [evaluator.tick()[0] for _ in range(5)] == [NOT_KNOWN] * 3 + [FREE] * 2
    assert evaluator.tick()[1] == NOT_KNOWN


def test_a_point_that_is_not_heard_makes_its_sections_not_known(graph: Graph) -> None:
    evaluator = Evaluator(graph, timeout_s=0.2)
    assert evaluator.tick() == (FREE, FREE)
    assert evaluator.tick(dead="a") == (NOT_KNOWN, FREE)
    assert evaluator.tick() == (NOT_KNOWN, FREE)  # it is there again, but what has it missed?


@pytest.mark.parametrize(
    ("kind", "wrong", "line"),
    [
        (DetectionPointNode, {"release": 0.5}, "release"),
        (DetectionPointNode, {"pulse_m": 5.0}, "pulse_m"),
        (AxleEvaluatorNode, {**EVALUATOR, "reset": "never"}, "reset: never"),
        (AxleEvaluatorNode, {**EVALUATOR, "border_points": ("a",)}, "border_points"),
        (AxleEvaluatorNode, {**EVALUATOR, "reset_sections": ("s1",)}, "reset_times_s"),
        (AxleEvaluatorNode, {**EVALUATOR, "empty_at_start": ("s9",)}, "s9"),
        (WheelSensorMediumNode, {"timeout_s": 0.0}, "timeout_s"),
    ],
)
def test_wrong_parameters_are_one_line(
    graph: Graph, kind: Any, wrong: dict[str, Any], line: str
) -> None:
    with pytest.raises(ParameterError, match=line):
        kind(context=graph.context, parameters=wrong)
