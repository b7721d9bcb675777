"""The other half of a corridor: missed only once it has been there."""

from __future__ import annotations

from rail_corridor.run.other_half import OtherHalf


class Eyes:
    """A node that sees what the test says; a second passes between two looks."""

    def __init__(self) -> None:
        self.names: list[tuple[str, str]] = []
        self._now_s = 0.0

    def steady_s(self) -> float:
        self._now_s += 1.0
        return self._now_s

    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]:
        return self.names


def test_it_is_gone_once_it_has_been_there_and_none_of_its_nodes_is_left() -> None:
    half, eyes = OtherHalf({"/train_a/vrs", "/train_b/vrs"}), Eyes()
    ours = ("world", "/")
    for names in ([], [ours], [ours, ("vrs", "/train_a"), ("vrs", "/train_b")]):
        eyes.names = names
        assert not half.look(eyes)
    eyes.names = [ours, ("vrs", "/train_b")]
    assert not half.look(eyes)
    eyes.names = [ours, ("vrs", "/train_c")]
    assert half.look(eyes)
    assert half.gone
    assert not half.look(eyes)  # it is told once


def test_it_is_gone_once_all_its_nodes_have_failed_though_the_graph_still_has_them() -> None:
    half, eyes = OtherHalf({"/train_a/vrs", "/train_b/vrs"}), Eyes()
    eyes.names = [("vrs", "/train_a"), ("vrs", "/train_b")]
    assert not half.look(eyes)
    assert not half.look(eyes, ["/train_b/vrs", "/wayside/wrs1"])
    assert half.look(eyes, ["/train_b/vrs", "/wayside/wrs1", "/train_a/vrs"])


def test_one_that_never_came_is_not_gone() -> None:
    half, eyes = OtherHalf({"/train_a/vrs"}), Eyes()
    assert not half.look(eyes, ["/train_a/vrs"])
    assert not half.gone


def test_one_without_which_nothing_begins_is_gone_when_it_does_not_come() -> None:
    half, eyes = OtherHalf({"/world"}, patience_s=2.0), Eyes()
    assert [half.look(eyes) for _ in range(4)] == [False, False, False, True]
    assert half.gone and not half.seen
