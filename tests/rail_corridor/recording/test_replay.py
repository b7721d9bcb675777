"""What is published again, in which order, and how: before anything is published."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from rail_corridor.equipment.registry import kind_of
from rail_corridor.errors import InputError
from rail_corridor.recording.mcap_file import RecordedChannel
from rail_corridor.recording.parts import Recording
from rail_corridor.recording.replay import ReplayOptions, offers_of, ordered, span_of
from rail_msgs_py.topics.qos_text import offered_profiles
from rail_msgs_py.topics.tick import READY

TICK_NS = 100_000_000


@pytest.fixture
def run(made_up: Callable[..., Any]) -> Any:
    """Return a run that is recorded."""
    made = made_up()
    made.write()
    return made


def published(
    run: Any, *wanted: str, start_s: float = 0.0, duration_s: float | None = None
) -> list[Any]:
    """Return what is published, in its order."""
    with Recording(run.path) as file:
        for _ in file.chunks(lambda _: False):
            pass
        offers = offers_of(file.channels, wanted)
        options = ReplayOptions(1.0, start_s, duration_s, wanted)
        begin_ns, end_ns = span_of(file, options)
    with Recording(run.path) as file:
        return list(ordered(file, offers, begin_ns, end_ns))


def test_everything_is_published_once_in_the_order_of_time(run: Any) -> None:
    out = published(run)
    times = [message.log_time_ns for message in out]
    assert times == sorted(times)
    assert sorted((m.channel.topic, m.data) for m in out) == sorted((s[1], s[2]) for s in run.said)
    for name in ("/clock", "/world/state"):
        assert [m.data for m in out if m.channel.topic == name] == [
            said.raw for said in run.said if said.name == name
        ]


def test_a_part_begins_with_what_was_latched_before(run: Any) -> None:
    out = published(run, start_s=3.55, duration_s=1.0)
    before = [m for m in out if m.log_time_ns < 3_550_000_000]
    after = out[len(before) :]
    # The failure of 3.0 s; no estimate, no clock of then, and health comes again by itself.
    assert {m.channel.topic for m in before} == {"/failed"}
    times = [m.log_time_ns for m in after]
    assert times == sorted(times)
    assert [m.log_time_ns for m in after if m.channel.topic == "/clock"] == [
        tick * TICK_NS for tick in range(36, 46)
    ]


def test_at_an_instant_what_is_latched_is_first(run: Any) -> None:
    out = [m.channel.topic for m in published(run, start_s=4.7, duration_s=0.05)]
    assert out[0] == "/failed"
    now = out[-7:]
    assert {*now} - {"/diagnostics"} == {
        "/clock",
        "/world/state",
        *(name for name in now if "train_a" in name),
    } | {"/world/radio_medium/links"}


def test_topics_that_are_asked_for_go_with_the_clock(run: Any) -> None:
    out = published(run, "/train_a/vrs/channel")
    assert {m.channel.topic for m in out} == {"/train_a/vrs/channel", "/clock"}
    assert len(out) == 120


def test_profiles_are_those_of_the_run(run: Any) -> None:
    with Recording(run.path) as file:
        for _ in file.chunks():
            pass
        offers = offers_of(file.channels, ())
    for name, offer in offers.items():
        kind = kind_of(name)
        assert kind
        assert offer.kind is kind.type
        assert offer.profile.depth == kind.qos.depth
        assert offer.profile.durability == kind.qos.durability
    assert {name for name, offer in offers.items() if offer.latched} == {
        *("/failed", "/world/finished")
    }


def channel(name: str = "/x", **more: Any) -> RecordedChannel:
    parts = {"type": "std_msgs/msg/String", "encoding": "cdr", "metadata": {}, **more}
    return RecordedChannel(name, **parts)


def test_somebody_elses_topic_has_the_profile_of_ros_unless_it_says_so() -> None:
    offer = offers_of([channel()], ())["/x"]
    assert (offer.profile.reliability, offer.profile.depth) == (ReliabilityPolicy.RELIABLE, 10)
    assert not offer.latched
    said = {"offered_qos_profiles": offered_profiles(READY.qos)}
    offer = offers_of([channel(metadata=said)], ())["/x"]
    assert offer.profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert offer.latched


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"encoding": "json"}, "/x: 'json': is not encoded as cdr"),
        ({"type": "no_such_msgs/msg/Type"}, "no message type"),
        ({"type": ""}, "no message type"),
        ({"metadata": {"offered_qos_profiles": "- history: ["}}, "no profile"),
        ({"metadata": {"offered_qos_profiles": "7"}}, "no profile"),
        ({"metadata": {"offered_qos_profiles": "- {history: keep_most}"}}, "no profile"),
        ({"metadata": {"offered_qos_profiles": "[]"}}, "no profile"),
    ],
)
def test_what_cannot_be_published_is_one_line(more: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told) as caught:
        offers_of([channel(**more)], ())
    assert "\n" not in str(caught.value)


def test_what_was_not_recorded_is_told(run: Any) -> None:
    with pytest.raises(InputError, match=r"--topics: '/clok': was not recorded, did you .* /clock"):
        published(run, "/clok")
    with pytest.raises(InputError, match=r"--start: 60\.0: the recording ends at 5\.9 s"):
        published(run, start_s=60.0)
