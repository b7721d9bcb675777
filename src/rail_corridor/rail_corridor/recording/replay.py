"""``rail replay FILE.mcap``: publishes a recording again, paced, with its clock."""

from __future__ import annotations

import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import rclpy
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from rail_corridor.equipment.registry import kind_of
from rail_corridor.errors import InputError, did_you_mean
from rail_corridor.middleware.discovery import discover_on
from rail_corridor.middleware.domain import sole_corridor
from rail_corridor.yaml_file import parse_yaml
from rail_msgs_py.message_definition import message_class
from rail_msgs_py.topics.qos import LATCHED
from rail_msgs_py.topics.qos_text import profile_from
from rail_msgs_py.topics.tick import CLOCK

from .mcap_file import RecordedChannel, RecordedMessage
from .parts import Recording

#: Wall time without a new subscriber after which those that are there have been found.
SETTLED_S: Final = 1.0
#: ... and for the first of them so long,
LONELY_S: Final = 3.0
#: ... but not longer than this for all.
DISCOVERY_S: Final = 6.0
#: Wall time for subscribers to take the last messages.
_ACKNOWLEDGE_S: Final = 5.0
_POLL_S: Final = 0.05
_PROGRESS: Final = "{task.completed:.1f} of {task.total:.0f} s"


@dataclass(frozen=True)
class ReplayOptions:
    """What of a recording, and how fast.

    Parameters
    ----------
    rate : float
        Simulated seconds per second.
    start_s : float
        Simulated time to begin at; what was latched before is published first.
    duration_s : float, optional
        Simulated time to publish, all of it if not given.
    topics : tuple of str
        Names, all if empty; the clock goes with any.
    """

    rate: float = 1.0
    start_s: float = 0.0
    duration_s: float | None = None
    topics: tuple[str, ...] = ()


@dataclass(frozen=True)
class Offer:
    """How one topic is published again.

    Parameters
    ----------
    kind : message class
    profile : QoSProfile
    latched : bool
        Whether it tells late joiners what they must know.
    """

    kind: Any
    profile: QoSProfile
    latched: bool


class _Stop:
    """Set by SIGINT and SIGTERM; remembers which."""

    def __init__(self) -> None:
        self._event = threading.Event()
        self.number = 0

    def __call__(self, number: int, _: Any) -> None:
        self.number = number
        self._event.set()

    def within(self, seconds: float) -> bool:
        """Wait; whether to stop."""
        return self._event.wait(max(seconds, 0.0))


def replay(path: Path, options: ReplayOptions, console: Console) -> int:
    """Publish a recording until its end, or until interrupted.

    The file is read through first: nothing is published of one that is damaged.

    Returns
    -------
    int
        Exit code: 0, or 128 + the number of the signal that ended it.

    Raises
    ------
    InputError
    """
    with Recording(path) as file:
        for _ in file.chunks(lambda _: False):
            pass
        try:
            offers = offers_of(file.channels, options.topics)
            start_ns, end_ns = span_of(file, options)
        except InputError as error:
            raise error.located("" if error.field.startswith("--") else str(path)) from None
        if file.cut_at is not None:
            console.print(
                f"{file.last_path} is cut short at byte {file.cut_at}, {file.last_ns * 1e-9:.1f} s",
                soft_wrap=True,
                highlight=False,
            )
    discover_on("this")
    with sole_corridor(), _until_stopped() as stop, Recording(path) as file:
        messages = ordered(file, offers, start_ns, end_ns)
        with _publishers(offers, stop) as publish:
            _publish_paced(messages, publish, options.rate, (start_ns, end_ns), stop, console)
    return 128 + stop.number if stop.number else 0


def offers_of(channels: Iterable[RecordedChannel], wanted: Iterable[str]) -> dict[str, Offer]:
    """How to publish each topic that is wanted, by name; the clock goes with any.

    Raises
    ------
    InputError
        For a topic that was not recorded, and for one that cannot be published here.
    """
    recorded = {channel.topic: channel for channel in channels}
    names = {*wanted}
    for name in sorted(names - recorded.keys()):
        reason = f"was not recorded{did_you_mean(name, recorded)}"
        raise InputError(reason, field="--topics", value=name)
    names = names | {CLOCK.name()} if names else {*recorded}
    return {name: _offer_of(recorded[name]) for name in sorted(names & recorded.keys())}


def _offer_of(channel: RecordedChannel) -> Offer:
    if channel.encoding != "cdr":
        raise InputError("is not encoded as cdr", field=channel.topic, value=channel.encoding)
    try:
        kind = message_class(channel.type)
    except LookupError as error:
        raise InputError(str(error), field=channel.topic, value=channel.type) from None
    text = channel.metadata.get("offered_qos_profiles", "")
    try:
        profile = profile_from(parse_yaml(text)[0]) if text else QoSProfile(depth=10)
    except (InputError, ValueError, LookupError, TypeError, AttributeError) as error:
        reason = f"no profile that can be offered: {error}"
        raise InputError(
            reason, field=f"{channel.topic}.offered_qos_profiles", value=text
        ) from None
    known = kind_of(channel.topic)
    latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    # The past of estimates is kept for a report that comes late, not for everybody.
    return Offer(kind, profile, latched and (known is None or known.qos is LATCHED))


def span_of(file: Recording, options: ReplayOptions) -> tuple[int, int]:
    """First and last instant [ns] to publish, of a file that has been read."""
    start_ns = max(round(options.start_s * 1e9), file.first_ns)
    if start_ns > file.last_ns:
        reason = f"the recording ends at {file.last_ns * 1e-9:g} s"
        raise InputError(reason, field="--start", value=options.start_s)
    if options.duration_s is None:
        return start_ns, file.last_ns
    return start_ns, min(start_ns + round(options.duration_s * 1e9), file.last_ns)


def ordered(
    file: Recording, offers: Mapping[str, Offer], start_ns: int, end_ns: int
) -> Iterator[RecordedMessage]:
    """Yield what is to be published, in the order of time; at each instant what is latched first.

    Of what was latched before the beginning, as much as the publisher would have kept comes first.
    Processes are recorded side by side: from chunk to chunk the order is that of the file.
    """
    before: dict[str, deque[RecordedMessage]] = {
        name: deque(maxlen=max(offer.profile.depth, 1)) for name, offer in offers.items()
    }
    waiting = True
    for chunk in file.chunks(lambda channel: channel.topic in offers):
        now = []
        for message in chunk:
            if message.log_time_ns >= start_ns:
                now.append(message)
            elif offers[message.channel.topic].latched:
                before[message.channel.topic].append(message)
        if waiting and now:
            waiting = False
            for kept in before.values():
                yield from kept
        now.sort(key=lambda m: (m.log_time_ns, not offers[m.channel.topic].latched))
        yield from (message for message in now if message.log_time_ns <= end_ns)


def _publish_paced(
    messages: Iterator[RecordedMessage],
    publish: Callable[[RecordedMessage], None],
    rate: float,
    span_ns: tuple[int, int],
    stop: _Stop,
    console: Console,
) -> None:
    """Publish each message when it is due."""
    start_ns, end_ns = span_ns
    columns = TextColumn("replaying"), BarColumn(bar_width=None), TextColumn(_PROGRESS)
    with Progress(*columns, console=console, transient=True) as progress:
        bar = progress.add_task("", total=(end_ns - start_ns) * 1e-9)
        begun_s = time.monotonic()
        now_ns = start_ns
        for message in messages:
            if message.log_time_ns > now_ns:
                now_ns = message.log_time_ns
                elapsed_s = (now_ns - start_ns) * 1e-9
                progress.update(bar, completed=elapsed_s)
                if stop.within(begun_s + elapsed_s / rate - time.monotonic()):
                    return
            publish(message)


@contextmanager
def _until_stopped() -> Iterator[_Stop]:
    stop = _Stop()
    numbers = (signal.SIGINT, signal.SIGTERM)
    previous = {number: signal.signal(number, stop) for number in numbers}
    try:
        yield stop
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


@contextmanager
def _publishers(
    offers: Mapping[str, Offer], stop: _Stop
) -> Iterator[Callable[[RecordedMessage], None]]:
    """Publishers of all topics, connected to whoever listens already."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Node("rail_replay", start_parameter_services=False, enable_rosout=False)
    try:
        created = {
            name: node.create_publisher(offer.kind, name, offer.profile)
            for name, offer in offers.items()
        }
        raw = {name: publisher.handle.publish_raw for name, publisher in created.items()}
        _wait_for_subscribers(created.values(), stop)
        yield lambda message: raw[message.channel.topic](message.data)
        if not stop.number:
            deadline_s = time.monotonic() + _ACKNOWLEDGE_S
            for publisher in created.values():
                left_s = max(deadline_s - time.monotonic(), 0.0)
                publisher.wait_for_all_acked(Duration(seconds=left_s))
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _wait_for_subscribers(publishers: Iterable[Any], stop: _Stop) -> None:
    """Wait until those that are there have been found."""
    publishers = list(publishers)
    subscribers, since_s = 0, time.monotonic()
    deadline_s = since_s + DISCOVERY_S
    while (now_s := time.monotonic()) < deadline_s:
        if now_s - since_s > (SETTLED_S if subscribers else LONELY_S):
            return
        count = sum(publisher.get_subscription_count() for publisher in publishers)
        if count != subscribers:
            subscribers, since_s = count, now_s
        if stop.within(_POLL_S):
            return
