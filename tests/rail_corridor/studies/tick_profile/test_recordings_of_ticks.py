"""Calls and messages that are recorded, and made again."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header

from rail_corridor.studies.tick_profile.attribution import Attribution
from rail_corridor.studies.tick_profile.flame_graph import write_flame_graph
from rail_corridor.studies.tick_profile.recorded_calls import CallRecorder, replay_s
from rail_corridor.studies.tick_profile.recorded_messages import MessageRecorder
from rail_corridor.studies.tick_profile.sampler import Sampler, Stack
from rail_corridor.studies.tick_profile.transport_floor import hand_over_s
from rail_msgs_py.delivery import LocalDelivery, LocalReader

SEEN: list[Any] = []
MODULES = {__file__: "rail_signals.of_this_test"}
CALLER = (
    "def call(function, *arguments, **keywords):\n    return function(*arguments, **keywords)\n"
)


class Meter:
    """Arithmetic with a state."""

    def __init__(self, lock: bool = False) -> None:
        self.sum = 0.0
        self.lock = threading.Lock() if lock else None  # cannot be copied

    def add(self, value: float, *more: float, scale: float = 1.0) -> None:
        self._add((value + sum(more)) * scale)

    def _add(self, value: float) -> None:
        self.sum += value
        SEEN.append(self.sum)

    @property
    def mean(self) -> float:
        return self.sum / 2.0

    @staticmethod
    def fail(values: list[float]) -> float:
        return values[0]


def recorded(*steps: tuple[Any, ...], **which: Any) -> CallRecorder:
    """Return what is recorded of calls out of another file."""
    names: dict[str, Any] = {}
    exec(compile(CALLER, "elsewhere.py", "exec"), names)
    recorder = CallRecorder(MODULES, **which)
    call = names["call"]
    recorder.start()
    try:
        for function, *arguments in steps:
            call(function, *arguments)
    finally:
        recorder.stop()
    return recorder


@pytest.fixture(autouse=True)
def forget() -> None:
    SEEN.clear()


def test_calls_into_arithmetic_are_made_again_inner_ones_as_part_of_them() -> None:
    meter = Meter()
    calls = recorded((meter.add, 1.0, 2.0), (meter.add, 3.0)).calls
    assert [call.function.__name__ for call in calls] == ["add", "add"]
    assert SEEN == [3.0, 6.0]
    assert replay_s(calls) > 0.0
    assert SEEN[2:] == [3.0, 6.0]
    replay_s(calls)
    assert SEEN[4:] == [3.0, 6.0]
    assert meter.sum == 6.0


def test_calls_with_what_cannot_be_copied_are_not_made_again() -> None:
    assert recorded((Meter(lock=True).add, 1.0)).calls == []
    assert SEEN == [1.0]


def test_calls_outside_a_function_are_not_recorded() -> None:
    meter = Meter()
    assert len(recorded((meter.add, 1.0), within=recorded.__code__).calls) == 1
    assert recorded((meter.add, 1.0), within=Meter.add.__code__).calls != []
    assert recorded((meter.add, 1.0), within=Meter.fail.__code__).calls == []
    assert recorded((meter.add, 1.0), besides=["rail_signals"]).calls == []
    assert len(recorded((meter.add, 1.0), besides=["rail_wayside"]).calls) == 1


def test_what_arguments_become_later_does_not_count() -> None:
    values = [1.0]
    recorder = recorded((Meter.fail, values))
    values.clear()
    ((values_then,),) = [call.positional for call in recorder.calls]
    assert values_then == [1.0]


def test_a_call_that_fails_does_not_end_a_replay() -> None:
    meter = Meter()
    with pytest.raises(IndexError):
        recorded((Meter.fail, []))
    calls = recorded((meter.add, 1.0)).calls
    broken = calls[0]._replace(positional=[])
    replay_s([broken, *calls])
    assert SEEN == [1.0, 1.0]


class Stamp:
    """A view that counts how often it is serialised."""

    stamp_ns = 0
    serialised = 0

    def to_cdr(self) -> bytes:
        self.serialised += 1
        return b"stamp"


class Ends:
    """A node with one publisher and one subscription, as far as a recorder looks at them."""

    def __init__(self, name: str, count: int, durability: Any = DurabilityPolicy.VOLATILE) -> None:
        qos = QoSProfile(depth=1, durability=durability)
        publisher = SimpleNamespace(
            topic_name=name,
            msg_type=Header,
            qos_profile=qos,
            get_subscription_count=lambda: count,
        )
        subscription = SimpleNamespace(topic_name=name, callback=SEEN.append)
        self.publishers = [publisher]
        self.subscriptions = [subscription] * count


def fail(error: Exception) -> None:
    raise error


def test_messages_are_recorded_for_a_while_and_handed_over_as_they_were() -> None:
    delivery = LocalDelivery()
    got: list[Any] = []
    delivery.read("/a", LocalReader("x", fail, got.append, got.append), lambda: None)
    delivery.read("/a", LocalReader("y", fail, got.append), lambda: None)
    recorder = MessageRecorder(delivery, [Ends("/a", 0)])

    def send(message: Any) -> None:
        delivery.put(delivery.line("/a"), message, None)
        delivery.run()

    view = Stamp()
    send(b"before")
    recorder.start()
    send(view)
    send(b"bytes")
    recorder.stop()
    send(b"after")
    (tick,) = recorder.ticks
    assert tick == ([("/a", view), ("/a", b"bytes")], [])
    assert recorder.readers == {"/a": [True, False]}
    assert recorder.handed_over == 4
    assert got == [b"before", b"before", view, b"stamp", b"bytes", b"bytes", b"after", b"after"]
    before = view.serialised
    assert hand_over_s(tick.local, recorder.readers) > 0.0
    assert view.serialised == before + 1
    assert len(got) == 8


def test_what_the_middleware_carries_is_recorded_tick_by_tick() -> None:
    delivery = LocalDelivery()
    kept = Ends("/kept", 0, DurabilityPolicy.TRANSIENT_LOCAL)
    shared = Ends("/shared", 2)
    recorder = MessageRecorder(delivery, [kept, shared, Ends("/unheard", 0)])
    assert {name: one.readers for name, one in recorder.carried.items()} == {
        "/kept": 0,
        "/shared": 2,
    }
    for name in ("/clock", "/kept", "/unheard"):
        delivery.line(name)
    recorder = MessageRecorder(delivery, [kept, shared])
    recorder.start()
    for message in (b"1", b"2"):
        delivery.put(delivery.line("/clock"), message, message)
        delivery.put(delivery.line("/kept"), Stamp(), None)
        delivery.put(delivery.line("/unheard"), message, message)
        delivery.run()
        shared.subscriptions[0].callback(message)
    recorder.stop()
    shared.subscriptions[0].callback(b"after")
    carried = [[("/kept", b"stamp"), ("/shared", message)] for message in (b"1", b"2")]
    assert recorder.ticks == [([], one) for one in carried]
    assert SEEN == [b"1", b"2", b"after"]


def test_a_sampler_finds_what_the_time_goes_into() -> None:
    sampler = Sampler()

    def busy() -> None:
        until_s = time.perf_counter() + 0.1
        while time.perf_counter() < until_s:
            pass

    sampler.stop()  # does no harm
    sampler.start()
    busy()
    sampler.stop()
    busy()
    of_busy = sum(s for stack, s in sampler.cpu_s() if stack.functions[-1] is busy.__code__)
    assert 0.01 < of_busy < 0.11
    assert sampler.samples > 10


def test_what_is_handed_over_is_done_for_its_reader() -> None:
    sampler, delivery = Sampler(), LocalDelivery()

    def busy(until_s: float) -> None:
        while time.perf_counter() < until_s:
            pass

    delivery.read("/a", LocalReader(sampler, fail, busy, busy), lambda: None)
    delivery.put(delivery.line("/a"), time.perf_counter() + 0.05, None)  # type: ignore[arg-type]
    sampler.start()
    delivery.run()
    sampler.stop()
    readers = {stack.reader for stack, _ in sampler.cpu_s() if busy.__code__ in stack.functions}
    assert readers == {Sampler.__module__}


def test_a_function_that_just_begins_has_done_nothing_yet() -> None:
    sampler = Sampler()

    def inner() -> int:
        return 1

    def outer() -> None:
        until_s = time.perf_counter() + 0.1
        while time.perf_counter() < until_s:
            (1 << 200_000) // 3  # an operation after which the interpreter looks for no signal
            inner()

    sampler.start()
    outer()
    sampler.stop()
    time_of = {stack.functions[-1]: seconds for stack, seconds in sampler.cpu_s()}
    assert time_of.get(inner.__code__, 0.0) < 0.1 * time_of[outer.__code__]


@pytest.mark.parametrize("suffix", ["html", "json"])
def test_a_flame_graph_begins_with_the_kind_of_node(tmp_path: Path, suffix: str) -> None:
    stack = (recorded.__code__,)
    path = tmp_path / f"a.{suffix}"
    stacks = [
        (Stack((*stack, Meter.add.__code__)), 0.25),
        (Stack((*stack, Meter.fail.__code__)), 0.5),
    ]
    write_flame_graph(stacks, lambda _: Attribution("world", "arithmetic", 1), "title", path)
    text = path.read_text()
    assert "world" in text and "add" in text and "title" in text
    if suffix == "json":
        names = [frame["name"] for frame in json.loads(text)["shared"]["frames"]]
        assert names[:2] == ["tick", "world"]
