"""When a tool knows all that there is: by who answers, who is known, and for how long."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from rail_corridor.cli import graph as graph_module
from rail_corridor.cli.graph import ANSWER_S, QUIET_S, SETTLED_S, START_S, Graph

OTHERS = {bytes([number]) * 12 for number in (1, 2)}
STEP_S = 0.01


class Situation:
    """A ROS domain as a node sees it, and the time on the wall."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.answered: set[bytes] = set()
        self.told: set[bytes] = set()
        self.nodes = 1
        self.published: set[str] = set()
        self.asked = 0

    def node(self) -> Any:
        infos = [SimpleNamespace(endpoint_gid=prefix + bytes(4)) for prefix in self.told]
        return SimpleNamespace(
            context=SimpleNamespace(get_domain_id=lambda: 7),
            get_node_names=lambda: ["node"] * self.nodes,
            get_topic_names_and_types=lambda: [(name, ["x"]) for name in self.published],
            count_publishers=lambda name: int(name in self.published),
            get_publishers_info_by_topic=lambda *_, **__: infos,
        )

    def settles_after_s(self) -> float:
        """Return how long it takes until all is known, if nothing changes any more."""
        graph = Graph(self.node())
        begun_s = self.now_s
        while not graph.is_settled():
            self.now_s += STEP_S
            assert self.now_s < begun_s + 60.0
        return self.now_s - begun_s


@pytest.fixture
def situation(monkeypatch: pytest.MonkeyPatch) -> Situation:
    """Return a domain on this host in which nothing is."""
    made = Situation()

    class Answers:
        def __init__(self, domain: int) -> None:
            assert domain == 7

        def ask(self) -> None:
            made.asked += 1

        def listen(self) -> set[bytes]:
            return made.answered

    monkeypatch.setattr(graph_module, "RollCall", Answers)
    monkeypatch.setattr(graph_module, "is_held", lambda: False)
    monkeypatch.setattr(graph_module, "time", SimpleNamespace(monotonic=lambda: made.now_s))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.delenv("ROS_STATIC_PEERS", raising=False)
    return made


def about(limit_s: float) -> Any:
    return pytest.approx(limit_s, abs=2.0 * STEP_S)


def test_where_nobody_answers_there_is_nothing(situation: Situation) -> None:
    assert situation.settles_after_s() == about(ANSWER_S)
    assert situation.asked > 1


def test_everybody_who_answers_is_known(situation: Situation) -> None:
    situation.answered = situation.told = OTHERS
    situation.nodes = 1 + len(OTHERS)
    assert situation.settles_after_s() == about(max(ANSWER_S, QUIET_S))
    assert situation.asked == 1


@pytest.mark.parametrize(("told", "nodes"), [(set(), 3), ({bytes([1]) * 12}, 3), (OTHERS, 2)])
def test_somebody_who_answers_is_not_known_yet(
    situation: Situation, told: set[bytes], nodes: int
) -> None:
    situation.answered, situation.told, situation.nodes = OTHERS, told, nodes
    assert situation.settles_after_s() == about(SETTLED_S)


def test_a_corridor_that_starts_is_waited_for(
    situation: Situation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(graph_module, "is_held", lambda: True)
    assert situation.settles_after_s() == about(START_S)
    situation.published = {"/clock"}
    assert situation.settles_after_s() == about(ANSWER_S)


@pytest.mark.parametrize(
    ("variable", "value"),
    [("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"), ("ROS_STATIC_PEERS", "10.0.0.2")],
)
def test_other_hosts_cannot_be_asked(
    situation: Situation, monkeypatch: pytest.MonkeyPatch, variable: str, value: str
) -> None:
    monkeypatch.setenv(variable, value)
    assert situation.settles_after_s() == about(SETTLED_S)
