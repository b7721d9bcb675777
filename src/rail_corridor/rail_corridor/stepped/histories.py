"""Keeps what is sent in a stepped corridor, topic by topic."""

from __future__ import annotations

from collections.abc import Callable, Container
from typing import Any

from rail_corridor.equipment.registry import kind_of
from rail_corridor.errors import InputError, did_you_mean
from rail_corridor.report.intake import names_read
from rail_msgs_py.delivery import LocalReader
from rail_msgs_py.message_definition import message_class
from rail_msgs_py.topics.qos import STREAM
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.waveform import Waveform

from .corridor import SteppedCorridor
from .topics import RowView, TableView, TopicHistory

#: Wall time for a message of another process to arrive [s]: one that is kept for late listeners,
#: and one that comes in every tick; the machine may be busy with other tests.
_ARRIVAL_S, _REGULAR_S = 0.5, 3.0
#: Ticks in which a node that was started anew in another process is given that time to be heard.
_RETURN_TICKS = 10


class Histories:
    """Histories of the topics of a corridor.

    Of all topics but waveforms everything is kept from the beginning on; of a waveform, which is
    large, from the moment when it is first asked for.

    Parameters
    ----------
    corridor : SteppedCorridor
        Not yet started, so that nothing is missed.
    """

    def __init__(self, corridor: SteppedCorridor) -> None:
        self._corridor = corridor
        self._node = corridor.observer
        self._histories: dict[str, TopicHistory] = {}
        #: Topics that somebody has looked at, in that order; for who wants to know, to clear.
        self.looked_at: dict[str, None] = {}
        #: Of those that come from other processes: how many there were, and whether more came.
        self._outside: dict[str, tuple[int, bool]] = {}
        self._returning: dict[str, int] = {}
        for name, line in corridor.delivery.lines.items():
            kind = kind_of(name)
            known = line.kind is not None or (kind is not None and kind.view is not Waveform)
            if line.writers and known:
                self._keep(name)
        # What the report reads of other processes is heard from the first tick on.
        for name in sorted(names_read(corridor.plan) - self._histories.keys()):
            self._keep(name)
            self._outside[name] = (0, False)
        self._keep_no_waveforms()

    def __getitem__(self, name: str) -> TopicHistory:
        """History of a topic; InputError if nobody sends on it."""
        if name not in self._histories:
            self._keep(name)
        history = self._histories[name]
        if not self._corridor.delivery.line(name).writers and name not in self._outside:
            # What is kept for those who come late is on its way.
            self._corridor.spin(lambda: history.count > 0, _ARRIVAL_S)
            topic = kind_of(name)
            self._outside[name] = (history.count, topic is not None and topic.qos is STREAM)
        return history

    def _keep_no_waveforms(self) -> None:
        """Let go of what is large, until somebody asks for it."""
        for name, line in self._corridor.delivery.lines.items():
            kind = kind_of(name)
            if kind is not None and kind.view is Waveform:
                line.gathers = False
                line.early.clear()

    def after_tick(self, gone: Container[str] = ()) -> None:
        """Keep what has begun to be sent; wait for what other processes send in every tick.

        Parameters
        ----------
        gone : container of str
            Nodes of which nothing comes.
        """
        for name, line in list(self._corridor.delivery.lines.items()):
            if line.gathers and line.early:
                self._keep(name)
        heard = set()
        for name, (count, regular) in self._outside.items():
            history, owner = self._histories[name], self._owner(name)
            patience_s = _ARRIVAL_S if owner in self._returning else _REGULAR_S * regular
            if patience_s and owner not in gone:
                self._corridor.spin(lambda: history.count > count, patience_s)  # noqa: B023
            if history.count > count:
                heard.add(owner)
            self._outside[name] = (history.count, history.count > count)
        for owner, left in list(self._returning.items()):
            self._returning[owner] = left - 1
            if owner in heard or not left:
                del self._returning[owner]

    def expect(self, node: str) -> None:
        """Wait for a node that was started anew in another process: it may not be heard at once."""
        self._returning[node] = _RETURN_TICKS
        for name, (count, _) in self._outside.items():
            if self._owner(name) == node:
                self._outside[name] = (count, False)

    def malformed(self, node: str) -> str:
        """Why nobody can read what a node has sent last; empty if everybody can."""
        for name, history in self._histories.items():
            topic = kind_of(name)
            if topic is None or self._owner(name) != node or not history.sent:
                continue
            try:
                view = history.latest
            except (ValueError, RuntimeError) as error:  # rclpy raises the second
                return f"{name}: {error}"
            columns = view.columns if isinstance(view, RowView | TableView) else topic.columns
            if topic.columns and columns != topic.columns:
                wanted = ", ".join(topic.columns)
                return f"{name}: has columns {', '.join(columns)}, not {wanted}"
        return ""

    @staticmethod
    def _owner(name: str) -> str:
        topic = kind_of(name)
        return "" if topic is None else name.rsplit("/", topic.below_owner)[0]

    @property
    def kept(self) -> dict[str, TopicHistory]:
        """Everything that has been kept, by topic."""
        return dict(self._histories)

    @property
    def names(self) -> list[str]:
        """Names of the topics that nodes of this process send on."""
        return [name for name, line in self._corridor.delivery.lines.items() if line.writers]

    def kind(self, name: str) -> Any:
        """Message class of a topic; InputError if nobody sends on it."""
        line, topic = self._corridor.delivery.lines.get(name), kind_of(name)
        if line is not None and topic is not None and (line.writers or line.readers):
            return topic.type
        if line is not None and line.kind is not None:
            return line.kind
        return self._kind_outside(name)

    def _tick(self) -> int:
        """Number of the tick at hand."""
        return self._corridor.ticks - 1

    def _keep(self, name: str) -> None:
        topic, kind = kind_of(name), self.kind(name)
        history = TopicHistory(name, topic, kind, self._tick, self.looked_at)
        reader = LocalReader(self._node, self._fail, history.take, history.take)
        line = self._corridor.delivery.line(name)

        def subscribe() -> None:
            qos = 1000 if topic is None else topic.qos
            outside = line.from_outside(self._recorded(topic, name, history.take))
            take = self._node.guarded(outside)
            self._node.create_subscription(kind, name, take, qos, raw=True)

        for message in line.early:
            history.take(message)
        line.gathers = False
        self._corridor.delivery.read(name, reader, subscribe)
        self._histories[name] = history

    def _recorded(
        self, topic: Topic | None, name: str, take: Callable[[Any], None]
    ) -> Callable[[Any], None]:
        """Reader of what another process sends that hands it to the tap too."""
        tap = getattr(self._corridor.context, "tap", None)
        sink = None if topic is None or tap is None else tap(topic, name)
        if sink is None:
            return take

        def take_and_record(raw: bytes) -> None:
            sink(raw)
            take(raw)

        return take_and_record

    def _kind_outside(self, name: str) -> Any:
        """Message class of a topic that others publish."""
        for found, types in self._node.get_topic_names_and_types():
            if found == name:
                return message_class(types[0])
        reason = f"nobody sends on it{did_you_mean(name, self.names)}"
        raise InputError(reason, field="topic", value=name)

    @staticmethod
    def _fail(error: Exception) -> None:
        raise error
