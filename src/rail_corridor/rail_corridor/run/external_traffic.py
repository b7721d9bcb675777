"""Tells the recorder what nodes publish that somebody else runs.

They have no pipe to the recorder, so it hears them as any ROS node would. The world waits for
this node, and this node for theirs: nothing is published before it is heard.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile

from rail_corridor.equipment.registry import kind_of
from rail_msgs_py.message_definition import message_class, message_definition
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.tap import Sink
from rail_msgs_py.topics.tick import FAILED, NO_SENDER, READY
from rail_msgs_py.topics.topic import Topic

NAME: Final = "bystander"
FULL_NAME: Final = f"/{NAME}"
#: Topics of rclpy itself; those of our own nodes are not recorded either.
_OF_ROS: Final = ("/rosout", "/parameter_events")
_POLL_S: Final = 0.1
#: A node whose topics have been the same in so many polls has no more.
_SETTLED_POLLS: Final = 5


class ExternalTrafficRecorder(CorridorNode):
    """Hears the nodes of others.

    Parameters
    ----------
    external_nodes : iterable of str
        Full names of their nodes.
    open_sink : callable of kind of topic and name
        Opens what takes the messages of a topic; None for one that is not recorded.
    shared : iterable of Topic
        Topics on which both they and our nodes publish: all of it is told by this node.
    """

    def __init__(
        self,
        external_nodes: Iterable[str],
        open_sink: Callable[[Topic, str], Sink | None],
        shared: Iterable[Topic],
        *,
        context: Any,
    ) -> None:
        super().__init__(NAME, "/", context=context, services=False)
        self._open_sink = open_sink
        self._known_topics: set[str] = set(_OF_ROS)
        self._polls = dict.fromkeys(external_nodes, 0)
        self._present: set[str] = set()
        for topic in shared:
            self._hear(topic, topic.name())
        self.listen(READY, lambda message: self._present.add(message.data))
        self.listen(FAILED, self._on_failed)
        self._poll_timer = self.every(_POLL_S, self._poll)
        self.announce_when_connected(lambda: not self._polls)

    @property
    def connected(self) -> bool:
        """Whether it hears all of them."""
        return not self._connections

    def _on_failed(self, message: Any) -> None:
        """Wait no longer for a node that is not coming."""
        self._polls.pop(message.name, None)

    def _poll(self) -> None:
        """Look for topics of the nodes that have said that they are ready."""
        for external_node in [name for name in self._polls if name in self._present]:
            namespace, _, name = external_node.rpartition("/")
            try:
                published = self.get_publisher_names_and_types_by_node(name, namespace or "/")
            except NodeNameNonExistentError:  # heard before the graph shows it
                continue
            new = [
                (topic, types[0]) for topic, types in published if topic not in self._known_topics
            ]
            for topic, kind in new:
                self._hear_named(topic, kind)
            self._polls[external_node] = 0 if new else self._polls[external_node] + 1
            if self._polls[external_node] >= _SETTLED_POLLS:
                del self._polls[external_node]
        if not self._polls:
            self._poll_timer.cancel()

    def _hear_named(self, name: str, kind: str) -> None:
        self._known_topics.add(name)
        if name.endswith("/transition_event"):
            return
        known = kind_of(name)
        try:
            message_definition(kind)
            known_topic = known or Topic(
                name, message_class(kind), self._offer(name), None, "", "", ""
            )
        except LookupError as error:
            self.report(DiagnosticStatus.WARN, name, f"not recorded: {error}")
            return
        self._hear(known_topic, name)

    def _offer(self, name: str) -> QoSProfile:
        """Profile that the first publisher of a topic offers."""
        offered: QoSProfile = self.get_publishers_info_by_topic(name)[0].qos_profile
        return offered

    def _hear(self, topic: Topic, name: str) -> None:
        sink = self._open_sink(topic, name)
        self._known_topics.add(name)
        if sink is None:
            return
        everything = QoSProfile(
            history=HistoryPolicy.KEEP_ALL,
            reliability=topic.qos.reliability,
            durability=topic.qos.durability,
        )
        self.create_subscription(topic.type, name, self.guarded(sink), everything, raw=True)
        if topic.qos.durability == DurabilityPolicy.VOLATILE:  # what was said before is lost
            self.await_connection(lambda: self.count_publishers(name) > 0, name, NO_SENDER)
