"""The zone controller as a node: positions from ranges, and stations that stay silent."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pytest
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header

from rail_corridor.equipment.ranging.nodes import CONTROLLER
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import Plan, make_plan
from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.position import Position
from rail_msgs_py.ranging.range_reading import RangeReading
from rail_msgs_py.stamps import clock_to_cdr, to_ns
from rail_msgs_py.topics.ranging import POSITION, RANGE
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_wayside.zone_controller_node import ZoneControllerNode

TICK_NS = 100_000_000
MAST_M = math.hypot(3.0, 5.0)


class Controller:
    """The controller of the plain line; the test reads the ranges to it."""

    def __init__(self, graph: Any, plan: Plan, **parameters: Any) -> None:
        self.graph = graph
        (spec,) = (spec for spec in plan.nodes if spec.name == CONTROLLER)
        given = {**spec.parameters, **parameters}
        self.places = dict(zip(given["zones"], given["sites"], strict=True))
        self._send = {
            zone: graph.sender(RANGE, site=site, zone=zone) for zone, site in self.places.items()
        }
        self._clock = graph.sender(CLOCK)
        self.positions = graph.mailbox(POSITION, train="train_a")
        self.done = graph.mailbox(DONE, raw=True, node=CONTROLLER)
        graph.add(ZoneControllerNode(context=graph.context, parameters=given))
        graph.connect(CONTROLLER)

    def read(self, tick: int, ranges_m: dict[str, float], missing: tuple[str, ...] = ()) -> None:
        """Send clock and readings of a tick; zones that are not named hear nothing."""
        self._clock(clock_to_cdr(tick * TICK_NS))
        for zone, send in self._send.items():
            if zone not in missing:
                range_m = ranges_m.get(zone, math.inf)
                variance_m2 = 0.04 if math.isfinite(range_m) else math.inf
                send(
                    RangeReading(tick * TICK_NS, zone, range_m, variance_m2, -20.0, 380.0).to_msg()
                )

    def position(self, ticks: int) -> Position:
        """Return the last position once this many ticks are done."""
        self.graph.wait(lambda: len(self.done) >= ticks and len(self.positions) >= ticks)
        stamp_ns = to_ns(deserialize_message(self.done[-1], Header).stamp)
        assert stamp_ns == to_ns(self.positions[-1].header.stamp)
        return Position.from_msg(self.positions[-1])


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return make_plan(load_scenario("plain_line"), tmp_path)


def distance_m(way_m: float) -> float:
    return math.hypot(way_m, MAST_M)


def test_ranges_become_positions(graph: Any, plan: Plan) -> None:
    controller = Controller(graph, plan)
    for tick, (zone, way_m, chainage_m) in enumerate(
        [("zone1", 150.0, 150.0), ("zone1", 152.0, 152.0), ("zone1", 154.0, 154.0)]
    ):
        controller.read(tick, {zone: distance_m(way_m)})
        place = controller.position(tick + 1)
        assert (place.track, place.train) == ("main", "train_a")
        assert place.chainage_m == pytest.approx(chainage_m, abs=1e-3)
        assert place.known


def test_a_train_that_nobody_hears_is_not_known(graph: Any, plan: Plan) -> None:
    controller = Controller(graph, plan)
    controller.read(0, {"zone1": distance_m(150.0)})
    assert controller.position(1).known
    controller.read(1, {})
    lost = controller.position(2)
    assert not lost.known
    assert lost.chainage_m == pytest.approx(150.0, abs=1e-3)


def test_a_station_that_does_not_answer_is_named_and_the_tick_goes_on(
    graph: Any, plan: Plan
) -> None:
    controller = Controller(graph, plan, timeout_s=0.05)
    controller.read(0, {"zone1": distance_m(150.0)}, missing=("zone4",))
    assert controller.position(1).known
    assert [status.name for status in graph.failed] == [f"/wayside/{controller.places['zone4']}"]
    (failed,) = graph.failed
    assert failed.message.startswith("no answer within")
    values = {pair.key: pair.value for pair in failed.values}
    assert values == {"detected_by": CONTROLLER, "time_s": "0.0"}
    # It is not waited for in the next tick, and again once it is heard.
    controller.read(1, {"zone1": distance_m(152.0)}, missing=("zone4",))
    assert controller.position(2).known
    controller.read(2, {"zone1": distance_m(154.0)})
    assert controller.position(3).known
    assert len(graph.failed) == 1


def test_a_line_whose_stations_are_all_gone_still_has_ticks(graph: Any, plan: Plan) -> None:
    controller = Controller(graph, plan, timeout_s=0.05)
    everything = tuple(controller.places)
    for tick in range(3):
        controller.read(tick, {}, missing=everything)
        assert not controller.position(tick + 1).known
    assert len(graph.failed) == len(set(controller.places.values()))


def test_the_order_of_the_readings_does_not_matter(graph: Any, plan: Plan) -> None:
    controller = Controller(graph, plan)
    controller.read(0, {"zone1": distance_m(150.0)}, missing=("zone1", "zone2"))
    controller.read(0, {"zone1": distance_m(150.0)}, missing=tuple(controller.places)[1:])
    controller.read(0, {}, missing=tuple(z for z in controller.places if z != "zone2"))
    assert controller.position(1).chainage_m == pytest.approx(150.0, abs=1e-3)
    assert len(controller.done) == 1


@pytest.mark.parametrize("field", ["sites", "starts_m", "table_sizes", "table_chainage_m"])
def test_arrays_that_do_not_fit_are_one_line(graph: Any, plan: Plan, field: str) -> None:
    (spec,) = (spec for spec in plan.nodes if spec.name == CONTROLLER)
    given = {**spec.parameters, field: spec.parameters[field][:-1]}
    with pytest.raises(ParameterError, match=field) as caught:
        ZoneControllerNode(context=graph.context, parameters=given, services=False)
    assert "\n" not in str(caught.value)
