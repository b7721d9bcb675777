"""The backbone as a node: two legs in a tick, and ends that stay silent."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message
from std_msgs.msg import Float64MultiArray, Header

from rail_corridor.equipment.ranging.nodes import CONTROLLER
from rail_corridor.equipment.train_radio.placement import bases_of
from rail_corridor.loading.loader import load_scenario
from rail_corridor.loading.schema import parse_scenario
from rail_corridor.plan.plan import make_plan
from rail_msgs_py.stamps import clock_to_cdr, to_ns
from rail_msgs_py.table import Table
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.train_radio import (
    BACKBONE,
    BACKBONE_DOWN,
    BACKBONE_UP,
    DOWN_TELEGRAMS,
    STRIKES,
    UP_TELEGRAMS,
)
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_world.train_radio.backbone import Backbone
from rail_world.train_radio.backbone_node import BackboneNode
from rail_world.train_radio.frame_threats import Threat
from rail_world.train_radio.threat_description import ThreatsDescription
from rail_world.world_file import read_world_file

TICK_NS = 250_000_000
BASES = tuple(base.name for base in bases_of(load_scenario("hostile_network")))
FIRST, SECOND = (bytes([n]) * 64 for n in (1, 2))


def parameters(directory: Path, threats: list[str], name: str = "hostile_network") -> Any:
    """Parameters of the backbone with certain threats from 1 s on."""
    scenario = load_scenario(name)
    fault = {"kind": "threat", "threats": threats, "rate": 1.0, "from_s": 1.0}
    data = {**scenario.model_dump(mode="json", exclude_unset=True), "faults": [fault]}
    plan = make_plan(parse_scenario(data), directory)
    (spec,) = (spec for spec in plan.nodes if spec.name == BACKBONE)
    return spec.parameters


class Network:
    """The backbone; the test is base stations and zone controller."""

    def __init__(self, graph: Any, directory: Path, threats: list[str], **more: Any) -> None:
        self.graph = graph
        given = {**parameters(directory, threats), **more}
        self._clock = graph.sender(CLOCK)
        self._heard = {b: graph.sender(UP_TELEGRAMS, base=b) for b in BASES}
        self._ordered = {b: graph.sender(DOWN_TELEGRAMS, base=b) for b in BASES}
        self.up = {b: graph.mailbox(BACKBONE_UP, base=b) for b in BASES}
        self.down = {b: graph.mailbox(BACKBONE_DOWN, base=b) for b in BASES}
        self.strikes = graph.mailbox(STRIKES, raw=True)
        self.done = graph.mailbox(DONE, raw=True, node=BACKBONE)
        graph.add(BackboneNode(context=graph.context, parameters=given))
        graph.connect(BACKBONE)

    def begin(self, tick: int) -> None:
        self._clock(clock_to_cdr(tick * TICK_NS))

    def hear(self, tick: int, missing: tuple[str, ...] = ()) -> None:
        """Every base station tells what it has heard: the first a train, the others nothing."""
        for base, send in self._heard.items():
            frames = ((1, FIRST),) if base == BASES[0] else ()
            if base not in missing:
                send(Telegrams(tick * TICK_NS, frames).to_msg())

    def order(self, tick: int) -> None:
        """The controller sends to one train through the first base station."""
        for base, send in self._ordered.items():
            frames = ((1, SECOND),) if base == BASES[0] else ()
            send(Telegrams(tick * TICK_NS, frames).to_msg())

    def carried(self, boxes: dict[str, list[Any]], count: int) -> list[tuple[int, bytes]]:
        """Frames of the last of so many messages to everybody; all are of one tick."""
        self.graph.wait(lambda: all(len(box) >= count for box in boxes.values()))
        batches = {base: Telegrams.from_msg(box[count - 1]) for base, box in boxes.items()}
        assert len({batch.stamp_ns for batch in batches.values()}) == 1
        assert all(not batches[base].frames for base in BASES[1:])
        return list(batches[BASES[0]].frames)

    def over(self, ticks: int) -> dict[str, float]:
        """What the table of strikes says when so many ticks are done."""
        self.graph.wait(lambda: len(self.done) >= ticks and len(self.strikes) >= ticks)
        stamp_ns = to_ns(deserialize_message(self.done[-1], Header).stamp)
        table = Table.from_msg(deserialize_message(self.strikes[-1], Float64MultiArray))
        assert table.stamp_ns == stamp_ns
        return table.row("backbone")


def test_frames_pass_and_from_the_time_of_the_fault_on_they_are_struck(
    graph: Any, tmp_path: Path
) -> None:
    network = Network(graph, tmp_path, ["deletion"])
    for tick in range(6):
        network.begin(tick)
        network.hear(tick)
        through = tick < 4
        assert network.carried(network.up, tick + 1) == ([(1, FIRST)] if through else [])
        network.order(tick)
        assert network.carried(network.down, tick + 1) == ([(1, SECOND)] if through else [])
        counts = network.over(tick + 1)
        assert counts["frames"] == 2 * (tick + 1)
        assert counts["deletion"] == max(0, 2 * (tick - 3))
        assert sum(counts.values()) == counts["frames"] + counts["deletion"]
    assert graph.failed == []


def test_the_way_down_waits_for_the_way_up_whatever_comes_first(graph: Any, tmp_path: Path) -> None:
    network = Network(graph, tmp_path, ["masquerade"])
    for tick in range(12):
        network.order(tick)
        network.hear(tick)
        network.begin(tick)
        network.over(tick + 1)
    up = [Telegrams.from_msg(message).in_slot(1) for message in network.up[BASES[0]]]
    down = [Telegrams.from_msg(message).in_slot(1) for message in network.down[BASES[0]]]
    assert all(FIRST in frames for frames in up) and all(SECOND in frames for frames in down)
    # What is thrown back up was sent down in the tick before.
    assert SECOND not in up[4] and any(SECOND in frames for frames in up[5:])
    assert any(FIRST in frames for frames in down[4:])


def test_silent_ends_are_named_and_the_tick_goes_on(graph: Any, tmp_path: Path) -> None:
    waits = {"timeout_s": 0.05, "controller_timeout_s": 0.3}
    network = Network(graph, tmp_path, ["delay"], **waits)
    network.begin(0)
    network.hear(0, missing=(BASES[2],))
    assert network.carried(network.up, 1) == [(1, FIRST)]
    assert [status.name for status in graph.failed] == [f"/wayside/{BASES[2]}/cbtc"]
    # The controller says nothing: base stations get their telegrams all the same.
    assert network.carried(network.down, 1) == []
    assert network.over(1)["frames"] == 1
    assert [status.name for status in graph.failed[1:]] == [CONTROLLER]
    # Neither is waited for in the next tick.
    network.begin(1)
    network.hear(1, missing=(BASES[2],))
    assert network.over(2)["frames"] == 2
    # Both are again when they are heard.
    network.begin(2)
    network.order(2)
    network.hear(2)
    assert network.over(3)["frames"] == 4
    assert len(graph.failed) == 2


def test_what_it_does_depends_on_the_seed_alone(graph: Any, tmp_path: Path) -> None:
    network = Network(graph, tmp_path, [threat.value for threat in Threat])
    for tick in range(20):
        network.begin(tick)
        network.hear(tick)
        network.order(tick)
        network.over(tick + 1)
    heard = [Telegrams.from_msg(message) for message in network.up[BASES[0]]]
    described = read_world_file(str(tmp_path / "world.json"))
    bits = np.random.Philox(np.random.SeedSequence([described.seed, 8]))
    same = Backbone(
        BASES, described.part("threats", ThreatsDescription).periods, np.random.Generator(bits)
    )
    for tick, batch in enumerate(heard):
        up = same.up(tick * TICK_NS, {BASES[0]: [(1, FIRST)]})
        assert list(batch.frames) == up[BASES[0]]
        same.down(tick * TICK_NS, {BASES[0]: [(1, SECOND)]})
