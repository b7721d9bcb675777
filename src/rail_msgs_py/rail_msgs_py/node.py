"""What every node of the corridor shares: streams, readiness, failures, health."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from numpy.typing import NDArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.lifecycle import LifecycleNode
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from rail_msgs_py.topics.tick import CLOCK, DIAGNOSTICS, NO_READER, NO_SENDER, READY, WAITING
from rail_msgs_py.topics.topic import Topic

from .delivery import Decoder, LocalDelivery, LocalReader, Send, view_reader
from .parameters import overrides
from .publisher import CorridorPublisher
from .stamps import NANOSECONDS, clock_to_cdr
from .table import TableWriter

READY_POLL_S = 0.05
#: Wall time without a new connection after which a node says what it waits for.
STALLED_S = 1.0
#: Node that reads the run for its report.
REPORT_NAME = "report"
# Of a serialised DiagnosticArray: what stands before the name of its frame.
_STAMP_BYTES = 12
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


class Connection(NamedTuple):
    """What a node needs before the first tick.

    Parameters
    ----------
    made : callable
        Whether it is there.
    topic : str
        Name of the topic; empty if it is something else.
    lacks : str
        What is missing as long as it is not there.
    """

    made: Callable[[], bool]
    topic: str = ""
    lacks: str = ""


# To the type checker the mixin has what rclpy's nodes have; at run time it stands before them.
_RosNode: Any = Node if TYPE_CHECKING else object


class CorridorMixin(_RosNode):  # type: ignore[misc]
    """Streams, readiness, failures and health on top of an rclpy node."""

    def init_corridor(self) -> None:
        """Create what every node has; call once after the node's own constructor."""
        self._connections: list[Connection] = []
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._publish_health = self.publisher(DIAGNOSTICS).send
        self._health: dict[str, DiagnosticStatus] = {}
        self._health_cdr: bytes | None = None
        self._now_ns = 0
        self._second = -1
        self._ready_publisher: Any = None
        self._waiting_publisher: Any = None
        self._lacked: tuple[tuple[str, str], ...] = ()
        self._ready_timer: Any = None

    @property
    def _delivery(self) -> LocalDelivery | None:
        """Delivery to the other nodes of the process, if it has one."""
        return getattr(self.context, "delivery", None)

    def name_of(self, topic: Topic, **parts: object) -> str:
        """Name of a topic as this node asks for it, before its remapping rules."""
        return topic.name(**parts)

    def publisher(self, topic: Topic, **parts: object) -> CorridorPublisher:
        """Publisher of a topic of the table."""
        publisher = self.create_publisher(topic.type, self.name_of(topic, **parts), topic.qos)
        if publisher.topic_name in getattr(self.context, "report_reads", ()):
            self._await_report(publisher)
        tap = getattr(self.context, "tap", None)
        return CorridorPublisher(topic, publisher, tap, self._delivery)

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

    def blocks_in(
        self,
        topic: Topic,
        decode: Decoder[Any],
        callback: Callable[[int, Any], None],
        **parts: object,
    ) -> None:
        """Subscribe to a topic of the table; the callback takes stamp [ns] and item.

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
        asked, delivery = self.name_of(topic, **parts), self._delivery
        name = self.resolve_topic_name(asked)

        def subscribe() -> None:
            self.create_subscription(topic.type, asked, self.guarded(take_raw), topic.qos, raw=True)

        if delivery is None:
            subscribe()
            self.await_connection(lambda: self.count_publishers(name) > 0, name, NO_SENDER)
            return
        reader = LocalReader(self, self._failed_callback, take_raw, take_view)
        line = delivery.read(name, reader, subscribe)
        self.await_connection(
            lambda: line.writers > 0 or self.count_publishers(name) > 0, name, NO_SENDER
        )

    def listen(self, topic: Topic, callback: Callable[[Any], None], **parts: object) -> None:
        """Subscribe to messages of a topic that nothing waits for."""
        name, delivery = self.name_of(topic, **parts), self._delivery

        def subscribe(receive: Callable[[Any], None]) -> None:
            self.create_subscription(topic.type, name, self.guarded(receive), topic.qos)

        if delivery is None:
            subscribe(callback)
        else:
            safely = self._safely(callback)
            delivery.listen(self.resolve_topic_name(name), self, subscribe, safely)

    def guarded(self, callback: Callable[..., None]) -> Callable[..., None]:
        """Callback for the executor; what it sends within the process is handed over after it.

        Exceptions are told on ``/diagnostics`` instead of stopping the process. The tick's timeout
        then treats the node as silent, as it would a broken device.
        """
        delivery = self._delivery

        def run(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except Exception as error:
                self._failed_callback(error)
            if delivery is not None:
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
        self.report(DiagnosticStatus.ERROR, "software", f"{type(error).__name__}: {error}")

    def every(self, period_s: float, callback: Callable[[], None]) -> Any:
        """Timer on the steady wall clock."""
        return self.create_timer(period_s, self.guarded(callback), clock=self._steady)

    def steady_s(self) -> float:
        """Steady wall-clock time, that of `every`; without the objects of rclpy around it."""
        return time.monotonic()

    def await_connection(
        self, condition: Callable[[], bool], topic: str = "", lacks: str = ""
    ) -> None:
        """Add a condition to those that `announce_when_connected` waits for; see `Connection`."""
        self._connections.append(Connection(condition, topic, lacks))

    def lacking(self) -> list[Connection]:
        """Connections that are not there yet."""
        self._connections = [one for one in self._connections if not one.made()]
        return list(self._connections)

    def announce_when_connected(self, condition: Callable[[], bool] | None = None) -> None:
        """Publish the node's name on ``/ready`` once all its streams have a counterpart.

        What it waits for in vain is published on ``/waiting``: the world knows whether anybody
        is left who could be that counterpart.
        """
        if condition is not None:
            self.await_connection(condition)
        self._ready_publisher = self.publisher(READY)

        since_s = self.steady_s()

        def poll() -> None:
            nonlocal since_s
            while self._connections and self._connections[-1].made():
                self._connections.pop()
                since_s = self.steady_s()
            if not self._connections:
                self._ready_publisher.publish(String(data=self.get_fully_qualified_name()))
                self._ready_timer.cancel()
            elif self.steady_s() - since_s > STALLED_S:
                self._tell_what_is_lacking()
                since_s = self.steady_s()

        self._ready_timer = self.every(READY_POLL_S, poll)

    def _tell_what_is_lacking(self) -> None:
        """Publish on ``/waiting`` what has no counterpart, if that is something new."""
        lacking = tuple(sorted({(one.topic, one.lacks) for one in self.lacking()}))
        if not lacking or lacking == self._lacked:
            return
        if self._waiting_publisher is None:
            self._waiting_publisher = self.publisher(WAITING)
        self._lacked = lacking
        name = self.get_fully_qualified_name()
        self._waiting_publisher.publish(
            DiagnosticStatus(
                level=DiagnosticStatus.WARN,
                name=name,
                message=f"waits for {len(lacking)} connections",
                hardware_id=name,
                values=[KeyValue(key=topic, value=lacks) for topic, lacks in lacking],
            )
        )

    def report(
        self,
        level: bytes,
        what: str,
        message: str,
        values: Iterable[tuple[str, str]] = (),
        stamp_ns: int | None = None,
    ) -> None:
        """Publish the health of one aspect of the node, if it changed.

        Without a stamp it is of the tick at hand.
        """
        before = self._health.get(what)
        if before is not None and (before.level, before.message) == (level, message):
            return
        status = self._status(what, level, message, values)
        self._health[what] = status
        self._health_cdr = None
        now_ns = self._now_ns if stamp_ns is None else stamp_ns
        self._tell_health(now_ns, _without_stamp([status]))

    def at_tick(self, stamp_ns: int) -> None:
        """Take the simulated time; tell the health of the node in the first tick of each second."""
        self._now_ns = stamp_ns
        second = stamp_ns // NANOSECONDS
        if second == self._second:
            return
        self._second = second
        if self._health_cdr is None:
            alive = self._status("node", DiagnosticStatus.OK, "running")
            self._health_cdr = _without_stamp([*self._health.values()] or [alive])
        self._tell_health(stamp_ns, self._health_cdr)

    def _keeping_time(self, callback: Callable[[int, Any], None]) -> Callable[[int, Any], None]:
        """Callback of what begins a tick."""
        at_tick = self.at_tick

        def run(stamp_ns: int, item: Any) -> None:
            at_tick(stamp_ns)
            callback(stamp_ns, item)

        return run

    def _status(
        self, what: str, level: bytes, message: str, values: Iterable[tuple[str, str]] = ()
    ) -> DiagnosticStatus:
        name = self.get_fully_qualified_name()
        return DiagnosticStatus(
            level=level,
            name=f"{name}: {what}",
            message=message,
            hardware_id=name,
            values=[KeyValue(key=key, value=value) for key, value in values],
        )

    def _tell_health(self, stamp_ns: int, without_stamp: bytes) -> None:
        self._publish_health(clock_to_cdr(stamp_ns) + without_stamp)


def _without_stamp(statuses: list[DiagnosticStatus]) -> bytes:
    """Serialised ``DiagnosticArray`` without what `clock_to_cdr` writes before it."""
    return bytes(serialize_message(DiagnosticArray(status=statuses))[_STAMP_BYTES:])


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


class Equipment(CorridorMixin, LifecycleNode):  # type: ignore[misc]
    """Managed node: deactivating it by the standard service switches the equipment off.

    It starts active, as equipment does that is plugged in. Switched off it still answers
    every tick, with silence, so that the corridor need not find out by a timeout.
    """

    def __init__(
        self,
        name: str,
        namespace: str,
        *,
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: Services = True,
    ) -> None:
        super().__init__(
            name,
            namespace=namespace,
            enable_communication_interface=bool(services),
            **node_arguments(context, parameters, services),
        )
        self.switched_on = False
        self.init_corridor()

    def switch_on(self) -> None:
        """Configure and activate."""
        self.trigger_configure()
        self.trigger_activate()

    def _LifecycleNodeMixin__on_change_state(self, request: Any, response: Any) -> Any:
        """Answer the service; takes the place of rclpy's own function.

        In rclpy 7.1 a transition that the state does not know, as switching on what is on, raises
        out of the executor and ends the process.
        """
        try:
            return super()._LifecycleNodeMixin__on_change_state(request, response)
        except Exception as error:
            self.get_logger().warning(f"transition {request.transition.id} refused: {error}")
            response.success = False
            return response

    def on_activate(self, state: Any) -> Any:
        """Lifecycle transition."""
        self.switched_on = True
        self.report(DiagnosticStatus.OK, "equipment", "switched on")
        return super().on_activate(state)

    def on_deactivate(self, state: Any) -> Any:
        """Lifecycle transition."""
        self.switched_on = False
        self.report(DiagnosticStatus.WARN, "equipment", "switched off")
        return super().on_deactivate(state)
