"""What nodes say of themselves: changes at once, everything again in every simulated second."""

from __future__ import annotations

from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.node import CorridorNode
from rail_msgs_py.stamps import clock_to_cdr, to_ns
from rail_msgs_py.topics.tick import CLOCK, DONE, NO_READER, NO_SENDER, WAITING
from rail_wayside.ranging.wrs_node import WrsNode

SECOND_NS = 1_000_000_000
OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


def told(graph: Any, node: str) -> list[tuple[int, list[tuple[str, bytes, str]]]]:
    """Stamp and statuses of every message of a node."""
    return [
        (to_ns(array.header.stamp), [(s.name, s.level, s.message) for s in array.status])
        for array in graph.diagnostics
        if array.status[0].hardware_id == node
    ]


def test_all_statuses_are_repeated_in_the_first_tick_of_every_second(graph: Any) -> None:
    node = graph.add(CorridorNode("device", "/", context=graph.context, services=False))
    graph.wait(lambda: graph.bystander.count_publishers("/diagnostics"))
    node.at_tick(0)
    node.report(WARN, "cable", "bad", [("ohm", "7")], stamp_ns=300_000_000)
    node.report(WARN, "cable", "bad")
    node.at_tick(600_000_000)
    node.report(OK, "lamp", "lit")
    for stamp_ns in (900_000_000, SECOND_NS, SECOND_NS + 500_000_000, 2 * SECOND_NS):
        node.at_tick(stamp_ns)
    cable, lamp = ("/device: cable", WARN, "bad"), ("/device: lamp", OK, "lit")
    expected = [
        (0, [("/device: node", OK, "running")]),
        (300_000_000, [cable]),
        (600_000_000, [lamp]),
        (SECOND_NS, [cable, lamp]),
        (2 * SECOND_NS, [cable, lamp]),
    ]
    graph.wait(lambda: len(told(graph, "/device")) == len(expected))
    assert told(graph, "/device") == expected
    assert [value.key for value in graph.diagnostics[-1].status[0].values] == ["ohm"]


def test_switching_carries_the_time_of_the_tick_at_hand(graph: Any) -> None:
    clock = graph.sender(CLOCK)
    node = graph.add(WrsNode(context=graph.context, services="switches"))
    graph.wait(lambda: graph.bystander.count_subscribers("/clock"))
    graph.wait(lambda: graph.bystander.count_publishers("/diagnostics"))
    graph.wait(lambda: graph._publishers["/clock"].get_subscription_count())
    clock(clock_to_cdr(5 * SECOND_NS))
    graph.wait(lambda: told(graph, "/wayside/wrs1"))
    graph.switch("/wayside/wrs1", on=False)
    off = (5 * SECOND_NS, [("/wayside/wrs1: equipment", WARN, "switched off")])
    graph.wait(lambda: off in told(graph, "/wayside/wrs1"))
    assert not node.switched_on


def test_what_a_node_waits_for_in_vain_is_told_and_it_is_ready_once_it_is_there(
    graph: Any,
) -> None:
    waiting = graph.mailbox(WAITING)
    node = CorridorNode("device", "/", context=graph.context, services=False)
    node.stream_out(DONE, node="/device")
    node.stream_in(DONE, lambda raw: None, node="/other")
    node.announce_when_connected()
    graph.add(node)
    graph.wait(lambda: waiting)
    assert waiting[0].name == "/device"
    assert {pair.key: pair.value for pair in waiting[0].values} == {
        "/device/done": NO_READER,
        "/other/done": NO_SENDER,
    }
    graph.mailbox(DONE, node="/device")
    graph.sender(DONE, node="/other")
    graph.connect("/device")
    assert len(waiting) <= 2


def test_a_node_is_ready_only_once_the_report_hears_what_it_reads(graph: Any) -> None:
    waiting = graph.mailbox(WAITING)
    graph.context.report_reads = frozenset({"/device/done"})
    node = CorridorNode("device", "/", context=graph.context, services=False)
    node.publisher(DONE, node="/device")
    node.announce_when_connected()
    graph.mailbox(DONE, node="/device")  # of somebody else
    graph.add(node)
    graph.wait(lambda: waiting)
    assert [(pair.key, pair.value) for pair in waiting[0].values] == [("/device/done", NO_READER)]
    assert not graph.ready
    del graph.context.report_reads
    report = CorridorNode("report", "/", context=graph.context, services=False)
    report.listen(DONE, lambda message: None, node="/device")
    graph.add(report)
    graph.connect("/device")
