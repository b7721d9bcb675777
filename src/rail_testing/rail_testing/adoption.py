"""Takes an ordinary rclpy node into the delivery of the process: it misses no message.

A node that only listens is waited for by nobody: at the speed of a simulation the middleware's
queues overflow. Adopted, its callbacks are called in the order in which messages were sent, each
before the next tick begins, and what it publishes reaches the corridor at once; its timers in
simulated time are due when the clock says so. The node itself is not changed and knows nothing of
it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.subscription import Subscription

from rail_corridor.equipment.registry import kind_of
from rail_msgs_py.delivery import Line, LocalDelivery, LocalReader, Sendable, serialised

#: What rclpy says by itself, in wall time: no message of the corridor.
_OF_ROS = ("/parameter_events", "/rosout")
#: What has been sent on a topic so far, by its name.
Past = Callable[[str], Sequence[Sendable]]


class Adoption:
    """One adopted node.

    Parameters
    ----------
    node : rclpy Node
        Made, or made but not initialised: then nothing that it does at its start is missed.
    delivery : LocalDelivery
        Of the corridor, before or after it has started.
    tap : callable, optional
        Of the corridor's context: is told of what the node publishes.
    past : callable, optional
        For subscriptions that want what was said before.
    """

    def __init__(
        self, node: Any, delivery: LocalDelivery, tap: Any = None, past: Past = lambda _: ()
    ) -> None:
        self.node = node
        self._delivery, self._tap, self._past = delivery, tap, past
        self._known: set[int] = set()
        #: What its callbacks have raised, in their order.
        self.errors: list[Exception] = []
        #: Messages that it has sent.
        self.sent = 0
        self._readers: dict[int, tuple[Line, LocalReader]] = {}
        self._destroy = node.destroy_subscription
        node.destroy_subscription = self._destroy_subscription
        node.create_publisher = self._then(node.create_publisher, self._take_publisher)
        node.create_subscription = self._then(node.create_subscription, self._take_subscription)
        node.create_timer = self._then(node.create_timer, self._take_timer)
        if hasattr(node, "_publishers"):
            self._look()

    def _look(self) -> None:
        """Take over what the node has made so far."""
        for publisher in self.node.publishers:
            self._take_publisher(publisher)
        for subscription in self.node.subscriptions:
            self._take_subscription(subscription)
        for timer in self.node.timers:
            self._take_timer(timer)

    @staticmethod
    def _then(create: Callable[..., Any], take: Callable[[Any], None]) -> Callable[..., Any]:
        """What creates an entity of the node, and has it taken over at once."""

        @wraps(create)
        def created(*arguments: Any, **options: Any) -> Any:
            entity = create(*arguments, **options)
            take(entity)
            return entity

        return created

    # What it hears -----------------------------------------------------------------------

    def _take_subscription(self, subscription: Any) -> None:
        profile = subscription.qos_profile
        name, kind, raw_wanted = subscription.topic_name, subscription.msg_type, subscription.raw
        line = self._delivery.line(name)
        kept = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        if kept and not line.writers:
            return  # what was said before is kept by the middleware of another process
        outside: Callable[..., None] = subscription.callback
        # As rclpy has found out: a second argument that has a default is none.
        with_info = subscription._callback_type is Subscription.CallbackType.WithMessageInfo

        def take(sent: Sendable) -> None:
            raw = serialised(sent)
            message = raw if raw_wanted else deserialize_message(raw, kind)
            outside(message, {}) if with_info else outside(message)
            if name == "/clock":
                self._call_timers()

        def forget(_: Any) -> None:
            """What the middleware still brings has been handed over already."""

        def hear_outside() -> None:
            subscription.callback = self._guarded(line.from_outside(outside))

        subscription.callback = forget
        reader = LocalReader(self.node, self.errors.append, take)
        if kept:
            self._hand_over_what_was_said(name, line, reader, profile)
        line.readers.append(reader)
        self._readers[id(subscription)] = line, reader
        line.subscriptions.append((self.node, hear_outside))
        self._delivery.when_settled(line.hear_outside)

    def _hand_over_what_was_said(
        self, name: str, line: Line, reader: LocalReader, profile: Any
    ) -> None:
        """As the middleware does for one that comes late: the newest messages that are kept."""
        said = self._past(name) or line.early
        senders = [each for node in line.writers for each in node.publishers]
        profiles = [each.qos_profile for each in senders if each.topic_name == name]
        depths = [_depth(each) for each in profiles if _keeps(each)]
        count = min(_depth(profile), max(depths, default=0), len(said))
        for message in said[len(said) - count :]:
            self._delivery.put(Line(readers=[reader]), message, serialised(message))

    def _destroy_subscription(self, subscription: Any) -> bool:
        """In the place of the node's own: what is destroyed hears no more."""
        line, reader = self._readers.pop(id(subscription), (None, None))
        if line is not None and reader in line.readers:
            line.readers = [each for each in line.readers if each is not reader]
        return bool(self._destroy(subscription))

    # What it says ------------------------------------------------------------------------

    def _take_publisher(self, publisher: Any) -> None:
        name = publisher.topic_name
        if name in _OF_ROS:
            return
        line, delivery, topic = self._delivery.line(name), self._delivery, kind_of(name)
        line.writers.append(self.node)
        line.kind = publisher.msg_type
        sink = None if self._tap is None or topic is None else self._tap(topic, name)
        publish_outside, keeps = publisher.publish, _keeps(publisher.qos_profile)

        def send_on(raw: bytes) -> None:
            if line.gathers:
                line.early.append(raw)
            if sink is not None:
                sink(raw)
            delivery.put(line, raw, raw)
            # What is kept for those who come later is kept by the middleware.
            if keeps or publisher.get_subscription_count() > 0:
                publish_outside(raw)

        def publish(message: Any) -> None:
            raw = message if isinstance(message, bytes) else bytes(serialize_message(message))
            self.sent += 1
            for each in (raw,) if line.intercept is None else line.intercept(raw):
                send_on(serialised(each))
            delivery.run()

        publisher.publish = publish

    # When it acts ------------------------------------------------------------------------

    def _take_timer(self, timer: Any) -> None:
        timer.callback = self._guarded(timer.callback)

    def _call_timers(self) -> None:
        """Call the timers that are due by the clock of the simulation, which has just been set."""
        for timer in list(self.node.timers):
            simulated = getattr(timer.clock, "ros_time_is_active", False)
            if simulated and not timer.is_canceled() and timer.is_ready():
                timer.handle.call_timer()
                timer.callback()

    def _guarded(self, callback: Callable[..., None]) -> Callable[..., None]:
        """Callback of the executor whose errors are the node's, and whose messages go on."""

        @wraps(callback)
        def run(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except Exception as error:
                self.errors.append(error)
            self._delivery.run()

        return run


def _keeps(profile: Any) -> bool:
    """Whether a publisher keeps messages for those who come later."""
    return bool(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def _depth(profile: Any) -> int:
    """How many messages are kept."""
    if profile.history == HistoryPolicy.KEEP_ALL:
        return 1 << 30
    return int(profile.depth) or 1
