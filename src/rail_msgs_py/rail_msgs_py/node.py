"""What every node of the corridor shares: streams, readiness, failures, health."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Literal

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy

from rail_msgs_py.topics.tick import CLOCK, NO_READER, NO_SENDER
from rail_msgs_py.topics.topic import Topic

from .delivery import Decoder, Listener, LocalDelivery, LocalReader, Send, view_reader
from .health import HealthMixin
from .parameters import overrides
from .publisher import CorridorPublisher
from .readiness import ReadinessMixin
from .table import TableWriter

#: Node that reads the run for its report.
REPORT_NAME = "report"
#: Aspect of a node's health: what its callbacks have raised.
SOFTWARE = "software"
#: Wall time between two looks for senders in other processes.
_LOOK_OUTSIDE_S = 1.0
#: Which services a node offers beside its topics: all, none, or the lifecycle's alone.
Services = bool | Literal["switches"]


def node_arguments(
    context: Any, parameters: Mapping[str, Any] | None, services: Services
) -> dict[str, Any]:
    """Constructor arguments common to all nodes.

    Parameters
    ----------
    context : rclpy Context, or None for the default one
    parameters : mapping, or None
        Values that override the defaults, as from a parameter file.
    services : bool or 'switches'
        Whether to offer the parameter services; they quadruple the time to create a node.
        ``switches``: none but those that switch equipment off and on.
    """
    return {
        "context": context,
        "parameter_overrides": overrides(dict(parameters or {})),
        "start_parameter_services": services is True,
        "enable_rosout": services is True,
    }


class CorridorMixin(ReadinessMixin, HealthMixin):
    """Streams, readiness, failures and health on top of an rclpy node."""

    def init_corridor(self) -> None:
        """Create what every node has; call once after the node's own constructor."""
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.init_readiness()
        self.init_health()

    @property
    def _delivery(self) -> LocalDelivery | None:
        """Delivery to the other nodes of the process, if it has one."""
        return getattr(self.context, "delivery", None)

    def _delivery_of(self, topic: Topic) -> LocalDelivery | None:
        """Delivery that a topic is read from: none if other processes may send on it too."""
        return None if topic.shared else self._delivery

    def name_of(self, topic: Topic, **parts: object) -> str:
        """Name of a topic as this node asks for it, before its remapping rules."""
        return topic.name(**parts)

    def publisher(self, topic: Topic, **parts: object) -> CorridorPublisher:
        """Publisher of a topic of the table."""
        made: list[CorridorPublisher] = []

        def on_matched(_: object) -> None:
            for each in made:
                each.look_outside()

        publisher = self.create_publisher(
            topic.type,
            self.name_of(topic, **parts),
            topic.qos,
            event_callbacks=PublisherEventCallbacks(matched=on_matched),
        )
        if publisher.topic_name in getattr(self.context, "report_reads", ()):
            self._await_report(publisher)
        tap = getattr(self.context, "tap", None)
        made.append(CorridorPublisher(self, topic, publisher, tap, self._delivery))
        return made[0]

    def _await_report(self, publisher: Any) -> None:
        """Wait until what is published is heard by the report, as by all readers known here."""
        name, offered = publisher.topic_name, publisher.qos_profile.durability

        def heard() -> bool:
            # Who asks for what was said before it came is never connected to who keeps nothing.
            compatible = [
                reader.node_name
                for reader in self.get_subscriptions_info_by_topic(name)
                if reader.qos_profile.durability in (offered, DurabilityPolicy.VOLATILE)
            ]
            count = publisher.get_subscription_count()
            return REPORT_NAME in compatible and bool(count >= len(compatible))

        self.await_connection(heard, name, NO_READER)

    def stream_out(self, topic: Topic, **parts: object) -> Send:
        """Function that sends messages to a reader that the tick waits for.

        It takes a view, such as `Waveform`, or a serialised message.
        """
        publisher = self.publisher(topic, **parts)
        name = publisher.topic_name
        self.await_connection(lambda: publisher.get_subscription_count() > 0, name, NO_READER)
        return publisher.send

    def table_out(
        self, topic: Topic, rows: Iterable[str], *, awaited: bool = False, **parts: object
    ) -> Callable[[int, NDArray[np.float64]], None]:
        """Function that publishes the values of a table.

        Parameters
        ----------
        topic : Topic
            Knows the columns.
        rows : iterable of str
            Names of the rows.
        awaited : bool
            Whether the tick waits for its reader, as with `stream_out`.
        **parts
            Of the name of the topic.

        Returns
        -------
        callable of stamp [ns] and values [row, column]
            The values must be C-contiguous.
        """
        publish = (
            self.stream_out(topic, **parts) if awaited else self.publisher(topic, **parts).send
        )
        write = TableWriter(tuple(rows), topic.columns).write

        def send(stamp_ns: int, values: NDArray[np.float64]) -> None:
            publish(write(stamp_ns, values))

        return send

    def stream_in(self, topic: Topic, callback: Callable[[bytes], None], **parts: object) -> None:
        """Subscribe to serialised messages of a topic of the table."""
        self._read_stream(topic, callback, None, parts)

    def begin_step(self, stamp_ns: int) -> None:
        """Be what the node is at a stamp: called before whatever it does of its own at a tick."""

    def blocks_in(
        self,
        topic: Topic,
        decode: Decoder[Any],
        callback: Callable[[int, Any], None],
        **parts: object,
    ) -> None:
        """Act on each message of a topic as it comes; the callback takes stamp [ns] and item."""
        begin = self.begin_step

        def step(stamp_ns: int, item: Any) -> None:
            begin(stamp_ns)
            callback(stamp_ns, item)

        self.items_in(topic, decode, step, **parts)

    def items_in(
        self,
        topic: Topic,
        decode: Decoder[Any],
        callback: Callable[[int, Any], None],
        **parts: object,
    ) -> None:
        """Subscribe to a topic of the table, to collect what comes: stamp [ns] and item.

        What a node of the same process sends is not serialised on the way.
        """
        if topic is CLOCK:
            callback = self._keeping_time(callback)

        def take_raw(raw: bytes) -> None:
            callback(*decode(raw))

        of_view = view_reader(decode)
        take_view = None
        if of_view is not None:
            read = of_view

            def take_view(view: Any) -> None:
                callback(*read(view))

        self._read_stream(topic, take_raw, take_view, parts)

    def _read_stream(
        self,
        topic: Topic,
        take_raw: Callable[[bytes], None],
        take_view: Callable[[Any], None] | None,
        parts: Mapping[str, object],
    ) -> None:
        asked, delivery = self.name_of(topic, **parts), self._delivery_of(topic)
        name = self.resolve_topic_name(asked)

        def subscribe(take: Callable[[bytes], None] = take_raw) -> None:
            self.create_subscription(topic.type, asked, self.guarded(take), topic.qos, raw=True)

        if delivery is None:
            subscribe()
            self.await_connection(lambda: self.count_publishers(name) > 0, name, NO_SENDER)
            return
        reader = LocalReader(self, self._failed_callback, take_raw, take_view)
        take_outside = delivery.line(name).from_outside(take_raw)
        line = delivery.read(name, reader, lambda: subscribe(take_outside))
        self.await_connection(
            lambda: bool(line.writers) or self.count_publishers(name) > 0, name, NO_SENDER
        )

    def here_in(
        self,
        topic: Topic,
        callback: Callable[[bytes], None],
        sender: Callable[[bytes], str],
        **parts: object,
    ) -> None:
        """Subscribe to a topic that, as far as is known, only nodes of this process send on.

        Once there are others, within a second, theirs is heard as well.

        Parameters
        ----------
        topic, callback, **parts
            As of `stream_in`.
        sender : callable
            Full name of the node that sent a message, not heard from outside if it is here.
        """
        delivery = self._delivery
        if delivery is None:
            self.stream_in(topic, callback, **parts)
            return
        asked = self.name_of(topic, **parts)
        name = self.resolve_topic_name(asked)
        reader = LocalReader(self, self._failed_callback, callback)
        line = delivery.read(name, reader, lambda: None)
        outside: list[Any] = []

        def take(raw: bytes) -> None:
            if sender(raw) not in {node.get_fully_qualified_name() for node in line.writers}:
                callback(raw)

        def look() -> None:
            if not outside and self.count_publishers(name) > len(line.writers):
                receive = self.guarded(take)
                made = self.create_subscription(topic.type, asked, receive, topic.qos, raw=True)
                outside.append(made)

        self.look_every(_LOOK_OUTSIDE_S, look)

    def listen(self, topic: Topic, callback: Callable[[Any], None], **parts: object) -> None:
        """Subscribe to messages of a topic that nothing waits for."""
        name, delivery = self.name_of(topic, **parts), self._delivery

        def subscribe(receive: Callable[[Any], None]) -> None:
            self.create_subscription(topic.type, name, self.guarded(receive), topic.qos)

        if delivery is None:
            subscribe(callback)
        else:
            listener = Listener(self, subscribe, self._safely(callback))
            delivery.listen(self.resolve_topic_name(name), listener)

    def guarded(self, callback: Callable[..., None]) -> Callable[..., None]:
        """Callback for the executor; what it sends within the process is handed over after it.

        Exceptions are told on ``/diagnostics`` instead of stopping the process. The tick's timeout
        then treats the node as silent, as it would a broken device.
        """
        safe, delivery = self._safely(callback), self._delivery
        if delivery is None:
            return safe

        def run(*arguments: Any) -> None:
            safe(*arguments)
            delivery.run()

        return run

    def _safely(self, callback: Callable[..., None]) -> Callable[..., None]:
        """Callback whose exceptions are this node's."""

        def run(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except Exception as error:
                self._failed_callback(error)

        return run

    def _failed_callback(self, error: Exception) -> None:
        self.get_logger().error("".join(traceback.format_exception(error)))
        self.report(DiagnosticStatus.ERROR, SOFTWARE, f"{type(error).__name__}: {error}")

    def every(self, period_s: float, callback: Callable[[], None]) -> Any:
        """Timer on the steady wall clock."""
        return self.create_timer(period_s, self.guarded(callback), clock=self._steady)

    def look_every(self, period_s: float, check: Callable[[], None]) -> None:
        """As `every`, for as long as the node lives: by one timer of all nodes of the process."""
        delivery = self._delivery
        if delivery is None:
            self.every(period_s, check)
            return

        def subscribe(hear: Callable[[Any], None]) -> None:
            self.every(period_s, lambda: hear(None))

        listener = Listener(self, subscribe, self._safely(lambda _: check()))
        delivery.listen(f"every {period_s} s", listener)

    def steady_s(self) -> float:
        """Steady wall-clock time, that of `every`; without the objects of rclpy around it."""
        return time.monotonic()


class CorridorNode(CorridorMixin, Node):  # type: ignore[misc]
    """Node of the corridor."""

    def __init__(
        self,
        name: str,
        namespace: str,
        *,
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: Services = True,
    ) -> None:
        super().__init__(name, namespace=namespace, **node_arguments(context, parameters, services))
        self.init_corridor()
