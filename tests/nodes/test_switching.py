"""Equipment switched by its lifecycle service: also by who asks for what cannot be."""

from __future__ import annotations

from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from rail_wayside.ranging.wrs_node import WrsNode

SERVICE = "/wayside/wrs1/change_state"
OFF, ON = Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE


def ask(graph: Any, transition: int, label: str = "") -> bool:
    request = ChangeState.Request(transition=Transition(id=transition, label=label))
    return bool(graph.call(ChangeState, SERVICE, request).success)


def test_a_transition_that_cannot_be_is_refused_and_harms_nobody(graph: Any) -> None:
    node = graph.add(WrsNode(context=graph.context, services="switches"))
    assert not ask(graph, ON)
    assert not ask(graph, 250)
    assert not ask(graph, 0, "no such label")
    assert node.switched_on
    assert ask(graph, OFF)
    assert not ask(graph, OFF)
    assert not node.switched_on
    assert ask(graph, ON)
    assert node.switched_on


def test_nodes_with_switches_have_no_other_services(graph: Any) -> None:
    # Names that no corridor has, should one be near.
    graph.add(WrsNode("with", context=graph.context, services="switches"))
    graph.add(WrsNode("without", context=graph.context, services=False))
    graph.wait(lambda: graph.bystander.count_services("/wayside/with/change_state"))
    names = {name for name, _ in graph.bystander.get_service_names_and_types()}
    assert "/wayside/with/set_parameters" not in names
    assert "/wayside/without/change_state" not in names
