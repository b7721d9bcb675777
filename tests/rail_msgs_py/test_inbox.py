"""The inbox of a tick: what it gives depends on what came, never on the order of arrival."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_msgs_py.inbox import TickInbox

PORTS = ("c", "a", "b")
Taken = list[tuple[int, dict[str, tuple[int, str]]]]


def deliver(arrivals: list[tuple[int, str]], inbox: TickInbox[tuple[int, str]]) -> Taken:
    """Put (stamp, port) items in this order; take whatever becomes complete."""
    taken: Taken = []
    for stamp_ns, port in arrivals:
        inbox.put(stamp_ns, port, (stamp_ns, port))
        while inbox.complete:
            taken.append(inbox.take())
    return taken


@given(st.lists(st.tuples(st.integers(0, 3), st.sampled_from("abc"), st.booleans())))
def test_putting_tells_what_is_complete(steps: list[tuple[int, str, bool]]) -> None:
    inbox = TickInbox[int]("abc")
    for tick, port, drop in steps:
        if drop:
            inbox.drop([port])
        assert inbox.put(tick, port, 0) == inbox.complete
        if inbox.complete:
            inbox.take()


def test_every_order_of_one_tick_gives_the_same() -> None:
    for order in itertools.permutations(PORTS):
        taken = deliver([(100, port) for port in order], TickInbox(PORTS))
        assert taken == [(100, {port: (100, port) for port in sorted(PORTS)})]
        assert list(taken[0][1]) == sorted(PORTS)


@given(st.permutations([(stamp, port) for stamp in (10, 20, 30) for port in PORTS]))
def test_ticks_come_out_in_their_order_if_each_port_keeps_its_own(
    shuffled: list[tuple[int, str]],
) -> None:
    # Each port sends its ticks in order; how the ports interleave is arbitrary.
    streams = {port: iter((10, 20, 30)) for port in PORTS}
    arrivals = [(next(streams[port]), port) for _, port in shuffled]
    taken = deliver(arrivals, TickInbox(PORTS))
    assert taken == [(t, {port: (t, port) for port in sorted(PORTS)}) for t in (10, 20, 30)]


def test_the_last_of_two_items_of_a_port_counts() -> None:
    inbox: TickInbox[int] = TickInbox(["a", "b"])
    inbox.put(0, "a", 1)
    inbox.put(0, "a", 2)
    assert not inbox.complete
    inbox.put(0, "b", 3)
    assert inbox.take() == (0, {"a": 2, "b": 3})


def test_an_early_item_waits_for_its_tick() -> None:
    inbox: TickInbox[str] = TickInbox(["a", "b"])
    inbox.put(0, "a", "a0")
    inbox.put(1, "a", "a1")
    assert (inbox.stamp_ns, inbox.complete, inbox.missing) == (0, False, ("b",))
    inbox.put(0, "b", "b0")
    assert inbox.take() == (0, {"a": "a0", "b": "b0"})
    assert (inbox.stamp_ns, inbox.complete, inbox.missing) == (1, False, ("b",))


def test_a_late_item_is_not_mistaken_for_one_of_a_later_tick() -> None:
    inbox: TickInbox[str] = TickInbox(["a", "b"])
    inbox.put(5, "a", "a5")
    inbox.drop(["b"])
    assert inbox.complete
    assert inbox.take() == (5, {"a": "a5"})
    inbox.put(5, "b", "b5")
    assert inbox.stamp_ns is None
    assert not inbox.complete


def test_a_dropped_port_is_awaited_again_once_it_is_heard() -> None:
    inbox: TickInbox[str] = TickInbox(["a", "b"])
    inbox.drop(["b"])
    inbox.put(0, "a", "a0")
    assert inbox.take() == (0, {"a": "a0"})
    inbox.put(0, "b", "late, but alive")
    inbox.put(1, "a", "a1")
    assert not inbox.complete
    assert inbox.missing == ("b",)
    inbox.put(1, "b", "b1")
    assert inbox.take() == (1, {"a": "a1", "b": "b1"})


def test_what_a_port_sent_before_it_was_dropped_is_kept() -> None:
    inbox: TickInbox[str] = TickInbox(["a", "b"])
    inbox.put(0, "b", "b0")
    inbox.drop(["b"])
    assert not inbox.complete
    inbox.put(0, "a", "a0")
    assert inbox.take() == (0, {"a": "a0", "b": "b0"})


def test_a_tick_can_be_taken_before_it_is_complete() -> None:
    inbox: TickInbox[str] = TickInbox(PORTS)
    inbox.put(0, "c", "c0")
    assert inbox.take() == (0, {"c": "c0"})


def test_a_tick_whose_missing_ports_have_gone_on_waits_for_nothing_more() -> None:
    inbox: TickInbox[str] = TickInbox(PORTS)
    inbox.put(0, "a", "a0")
    inbox.put(1, "b", "b1")
    assert not inbox.complete  # c may still bring its own
    inbox.put(1, "c", "c1")
    assert inbox.take() == (0, {"a": "a0"})
    assert (inbox.complete, inbox.missing) == (False, ("a",))


def test_a_closed_tick_takes_nothing_but_signs_of_life() -> None:
    inbox: TickInbox[str] = TickInbox(["a", "b"])
    inbox.put(0, "a", "a0")
    inbox.put(2, "a", "a2")
    inbox.drop(["b"])
    inbox.close(1)
    inbox.put(1, "b", "b1")
    assert (inbox.stamp_ns, inbox.missing) == (2, ("b",))


def test_with_every_port_dropped_nothing_is_awaited() -> None:
    inbox: TickInbox[str] = TickInbox(PORTS)
    assert inbox.awaits_anything
    inbox.drop(PORTS)
    assert not inbox.awaits_anything
    assert not inbox.complete
    assert inbox.missing == ()


def test_an_empty_inbox_has_nothing_to_take() -> None:
    inbox: TickInbox[str] = TickInbox(PORTS)
    assert inbox.missing == tuple(sorted(PORTS))
    with pytest.raises(LookupError):
        inbox.take()


def test_after_a_reset_time_may_begin_again() -> None:
    inbox: TickInbox[str] = TickInbox(["a", "b"])
    deliver_all = [(100, "a"), (100, "b"), (200, "a")]
    for stamp_ns, port in deliver_all[:2]:
        inbox.put(stamp_ns, port, port)
    inbox.take()
    inbox.put(*deliver_all[2], "a")
    inbox.drop(["b"])
    inbox.reset()
    assert inbox.stamp_ns is None
    assert inbox.missing == ("a", "b")
    for port in ("b", "a"):
        inbox.put(0, port, port)
    assert inbox.take() == (0, {"a": "a", "b": "b"})
