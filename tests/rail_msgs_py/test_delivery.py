"""Delivery within a process: who gets what, in which order, and what it costs to serialise."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rail_msgs_py.delivery import (
    Listener,
    LocalDelivery,
    LocalReader,
    ViewDecoder,
    serialised,
    view_reader,
)


class Counted:
    """A view that counts how often it is serialised."""

    def __init__(self, stamp_ns: int = 0) -> None:
        self.stamp_ns = stamp_ns
        self.serialisations = 0

    def to_cdr(self) -> bytes:
        self.serialisations += 1
        return b"view"


class Tasks:
    """An executor that runs nothing until it is asked to."""

    def __init__(self) -> None:
        self.waiting: list[Callable[[], None]] = []

    def create_task(self, task: Callable[[], None]) -> None:
        self.waiting.append(task)


@pytest.fixture
def delivery() -> LocalDelivery:
    return LocalDelivery()


def reader(
    node: object,
    take_raw: Callable[[bytes], None],
    take_view: Callable[[Any], None] | None = None,
    fail: Callable[[Exception], None] | None = None,
) -> LocalReader:
    """Reader that lets nothing go wrong unseen."""

    def failed(error: Exception) -> None:
        raise AssertionError from error

    return LocalReader(node, fail or failed, take_raw, take_view)


def never() -> None:
    raise AssertionError("nobody outside sends to it")


def test_readers_get_a_message_in_the_order_they_came(delivery: LocalDelivery) -> None:
    got: list[tuple[str, bytes]] = []
    for name in ("b", "a", "c"):
        delivery.read("/t", reader(name, lambda raw, n=name: got.append((n, raw))), never)
    line = delivery.line("/t")
    delivery.put(line, b"1", b"1")
    delivery.put(line, b"2", b"2")
    assert not got  # the sender's callback returns first
    delivery.run()
    assert got == [(name, raw) for raw in (b"1", b"2") for name in ("b", "a", "c")]


def test_a_view_travels_as_it_is_and_is_serialised_once_for_all(delivery: LocalDelivery) -> None:
    views: list[Any] = []
    raws: list[bytes] = []
    for each in (
        reader("x", raws.append, views.append),
        reader("y", raws.append),
        reader("z", raws.append),
    ):
        delivery.read("/t", each, never)
    view = Counted()
    delivery.put(delivery.line("/t"), view, None)
    delivery.run()
    assert views == [view]
    assert raws == [b"view", b"view"]
    assert view.serialisations == 1
    delivery.put(delivery.line("/t"), view, b"told before")
    delivery.run()
    assert view.serialisations == 1
    assert raws[2:] == [b"told before"] * 2


def test_what_a_reader_sends_comes_after_what_waits(delivery: LocalDelivery) -> None:
    order: list[bytes] = []

    def first(raw: bytes) -> None:
        order.append(raw)
        delivery.put(delivery.line("/answer"), b"answer", b"answer")
        delivery.run()  # as a callback would that is called by the executor: no recursion
        order.append(b"returned")

    delivery.read("/t", reader("x", first), never)
    delivery.read("/t", reader("y", order.append), never)
    delivery.read("/answer", reader("x", order.append), never)
    delivery.put(delivery.line("/t"), b"asked", b"asked")
    delivery.run()
    assert order == [b"asked", b"returned", b"asked", b"answer"]


def test_what_comes_from_outside_does_not_wait_a_turn_for_each_message_before_it(
    delivery: LocalDelivery, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rail_msgs_py.delivery._TURN_S", 0.0)
    got: list[bytes] = []
    delivery.line("/t").writers.append("sender")
    delivery.read("/t", reader("x", got.append), never)
    executor = Tasks()
    delivery.settle(executor)
    line = delivery.line("/t")
    for _ in range(100):
        delivery.put(line, b"block", b"block")
    delivery.run()
    of_a_turn = len(got)
    assert 0 < of_a_turn < 100
    for _ in range(5):  # the executor serves the outside, each time with a callback of a node
        delivery.run()
    assert len(got) == of_a_turn
    assert len(executor.waiting) == 1
    while executor.waiting:
        executor.waiting.pop()()
    assert len(got) == 100


def test_only_what_nobody_here_sends_is_subscribed_to(delivery: LocalDelivery) -> None:
    subscribed: list[str] = []
    for name in ("/here", "/outside"):
        one = reader("x", lambda _: None)
        delivery.read(name, one, lambda n=name: subscribed.append(n))
    delivery.line("/here").writers.append("sender")
    delivery.settle(Tasks())
    assert subscribed == ["/outside"]


def test_who_comes_after_the_others_is_subscribed_at_once(delivery: LocalDelivery) -> None:
    subscribed: list[str] = []
    delivery.line("/here").writers.append("sender")
    delivery.settle(Tasks())
    for name in ("/here", "/outside"):
        one = reader("x", lambda _: None)
        delivery.read(name, one, lambda n=name: subscribed.append(n))
    assert subscribed == ["/outside"]


def test_once_the_last_sender_here_is_taken_out_its_readers_hear_the_outside(
    delivery: LocalDelivery,
) -> None:
    subscribed: list[str] = []
    line = delivery.line("/t")
    line.writers += ["first", "second"]
    for name in ("reader", "gone"):
        one = reader(name, lambda _: None)
        delivery.read("/t", one, lambda n=name: subscribed.append(n))
    executor = Tasks()
    delivery.settle(executor)
    for node in ("gone", "second", "first", "first"):
        assert not subscribed
        delivery.remove(node)
    # Not in the midst of what the executor is about.
    assert not subscribed
    for task in executor.waiting:
        task()
    assert subscribed == ["reader"]


def test_a_node_that_is_taken_out_gets_nothing_any_longer(delivery: LocalDelivery) -> None:
    got: list[str] = []
    for name in ("dead", "alive"):
        delivery.read("/t", reader(name, lambda _, n=name: got.append(n)), never)
    delivery.put(delivery.line("/t"), b"under way", b"under way")
    delivery.remove("dead")
    delivery.put(delivery.line("/t"), b"later", b"later")
    delivery.run()
    assert got == ["alive", "alive"]


def test_endless_work_is_done_in_turns(delivery: LocalDelivery) -> None:
    tasks = Tasks()
    delivery.line("/t").writers.append("sender")
    delivery.settle(tasks)
    seen = 0

    def again(raw: bytes) -> None:
        nonlocal seen
        seen += 1
        delivery.put(delivery.line("/t"), raw, raw)

    delivery.read("/t", reader("x", again), never)
    delivery.put(delivery.line("/t"), b"", b"")
    delivery.run()
    assert len(tasks.waiting) == 1  # the executor has its turn, and comes back
    before = seen
    tasks.waiting.pop()()
    assert seen > before


def test_a_reader_that_raises_does_not_stop_the_others(delivery: LocalDelivery) -> None:
    got: list[bytes] = []
    failed: list[Exception] = []

    def broken(raw: bytes) -> None:
        raise RuntimeError(raw)

    delivery.read("/t", reader("x", broken, fail=failed.append), never)
    delivery.read("/t", reader("y", got.append), never)
    delivery.put(delivery.line("/t"), b"1", b"1")
    delivery.run()
    assert [str(error) for error in failed] == ["b'1'"]
    assert got == [b"1"]


def test_a_process_hears_a_topic_of_many_once_for_all_its_nodes(delivery: LocalDelivery) -> None:
    heard: list[tuple[str, str]] = []
    ears: list[tuple[str, Callable[[Any], None]]] = []
    for name in ("first", "second", "third"):
        delivery.listen(
            "/failed",
            Listener(
                name,
                lambda hear, n=name: ears.append((n, hear)),
                lambda message, n=name: heard.append((n, message)),
            ),
        )
    assert [name for name, _ in ears] == ["first"]
    ears[0][1]("one")
    assert heard == [(name, "one") for name in ("first", "second", "third")]
    # One that does not have the subscription leaves, then the one that has it.
    delivery.remove("second")
    assert len(ears) == 1
    delivery.remove("first")
    assert [name for name, _ in ears] == ["first", "third"]
    heard.clear()
    ears[1][1]("two")
    assert heard == [("third", "two")]


def test_decoders_say_whether_they_take_views() -> None:
    of_view = view_reader(ViewDecoder(lambda raw: (1, raw), lambda view: (view.stamp_ns, view)))
    assert of_view is not None
    view = Counted(7)
    assert of_view(view) == (7, view)
    assert view_reader(lambda raw: (0, raw)) is None
    assert serialised(view) == b"view"
    assert serialised(b"raw") == b"raw"
