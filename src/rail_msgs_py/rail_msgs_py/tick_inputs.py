"""The input ports of one step of a node: collected until a tick is complete, then handed over."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, Literal

from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.topics.topic import Topic

from .decoders import bare_stamp
from .delivery import Decoder
from .failures import TickWatch
from .inbox import TickInbox

#: What a node does with the items of a complete tick: stamp [ns], items by port.
Step = Callable[[int, dict[str, Any]], None]

_FIRST_LEG = "first leg"


class TickInputs:
    """Input ports of a step that runs once per tick, when every port has its item.

    A node of a synchronous data-flow graph: the step fires when each port holds one token of the
    tick, whatever the order of arrival. A port whose owner fails is left out until it sends again.

    Parameters
    ----------
    node : CorridorNode
    step : callable of stamp [ns] and items
        The items are in the order of the names of the ports; failed ports have none.
    timeout_s : float, optional
        Wall time after which owners of overdue ports are named on ``/failed``; without it the
        step waits indefinitely.
    then : TickInputs, optional
        Second leg of the same tick. Its step runs after this one in every tick, and before this
        one in the next.
    timed_from : 'leg' or 'tick'
        Of a second leg: from when its ``timeout_s`` counts.
    """

    def __init__(
        self,
        node: Any,
        step: Step,
        timeout_s: float | None = None,
        *,
        then: TickInputs | None = None,
        timed_from: Literal["leg", "tick"] = "leg",
    ) -> None:
        self._node, self._step = node, step
        self._inbox: TickInbox[Any] = TickInbox()
        self._owners: dict[str, str] = {}
        self._triggers: set[str] = set()
        self._delayed: list[str] = []
        self._joined = False
        self._watch = (
            None
            if timeout_s is None
            else TickWatch(node, self._inbox, self._owners, timeout_s, self._advance)
        )
        self._timed_from = timed_from
        self._under_way = False
        self._second = then
        self._first: TickInputs | None = None
        if then is not None:
            then._first = self
            then._inbox.open(_FIRST_LEG)

    def clock(self) -> None:
        """Wait for the clock of a tick; see `trigger`."""
        self.trigger(CLOCK, bare_stamp)

    def trigger(self, topic: Topic, decode: Decoder[Any], **parts: Hashable) -> str:
        """Port that begins a tick: it is waited for indefinitely, and the others from then on.

        Parameters
        ----------
        topic, decode
            As of `port`.
        **parts
            Of the name of the topic.

        Returns
        -------
        str
            Name of the port.
        """
        port = topic.name(**parts)
        self._inbox.open(port)
        self._triggers.add(port)
        put, advance, begin = self._inbox.put, self._advance, self._begin_tick

        def receive(stamp_ns: int, item: Any) -> None:
            if not self._joined:
                self._join(stamp_ns)
            complete = put(stamp_ns, port, item)
            begin()
            if complete:
                advance()

        self._node.items_in(topic, decode, receive, **parts)
        return port

    def port(
        self,
        topic: Topic,
        decode: Decoder[Any],
        *,
        owner: str = "",
        delay_ns: int = 0,
        **parts: Hashable,
    ) -> str:
        """Port that a topic feeds.

        Parameters
        ----------
        topic : Topic
        decode : callable
            Stamp [ns] and item of a serialised message; see `rail_msgs_py.decoders`.
        owner : str
            Full name of the node that sends it, if it is not that of ``topic.owner``; of no
            account without ``timeout_s``.
        delay_ns : int
            Added to its stamps. What is sent in one tick and needed in the next comes a tick
            late; in the first tick that the node takes part in, the item may be None.
        **parts
            Of the name of the topic.

        Returns
        -------
        str
            Name of the port, by which the step finds its item.
        """
        port = topic.name(**parts)
        self._open(port, owner or topic.owner(**parts), delay_ns)
        put, advance = self._inbox.put, self._advance

        # Run for every message: whatever can be looked up before is.
        def receive(stamp_ns: int, item: Any) -> None:
            if put(stamp_ns + delay_ns, port, item):
                advance()

        self._node.items_in(topic, decode, receive, **parts)
        return port

    def internal_port(
        self, port: str, owner: str, *, delay_ns: int = 0
    ) -> Callable[[int, Any], None]:
        """Port that the node feeds itself, after work on a message of ``owner``.

        Returns
        -------
        callable of stamp [ns] and item
        """
        self._open(port, owner, delay_ns)

        def put(stamp_ns: int, item: Any) -> None:
            if self._inbox.put(stamp_ns + delay_ns, port, item):
                self._advance()

        return put

    def _open(self, port: str, owner: str, delay_ns: int) -> None:
        self._inbox.open(port)
        if self._watch is not None:
            self._owners[port] = owner
        if delay_ns:
            self._delayed.append(port)
            self._inbox.put(0, port, None)

    def _join(self, stamp_ns: int) -> None:
        """Begin with a tick; who joins in the midst of a run waits for nothing of before."""
        self._joined = True
        for port in self._delayed:
            self._inbox.put(stamp_ns, port, None)

    def _begin_tick(self) -> None:
        if self._watch is not None:
            self._watch.begin()
        second = self._second
        if second is not None and second._timed_from == "tick" and second._watch is not None:
            second._watch.begin()

    def _begin_leg(self, stamp_ns: int) -> None:
        """Of a second leg: the first one has ended."""
        self._under_way = True
        self._inbox.put(stamp_ns, _FIRST_LEG, None)
        if self._watch is not None and self._timed_from == "leg":
            self._watch.begin()
        self._advance()

    def _advance(self) -> None:
        inbox, second = self._inbox, self._second
        while inbox.complete and not (second is not None and second._under_way):
            # Before the step: one that raises must not hold up the ticks after it.
            self._under_way = False
            if self._watch is not None:
                self._watch.end()
            stamp_ns, items = inbox.take()
            if not self._triggers <= items.keys():
                continue  # one that began before this node was there: what it has of it is a rest
            if self._first is None:
                self._node.at_tick(stamp_ns)
            self._node.begin_step(stamp_ns)
            self._step(stamp_ns, items)
            if second is not None:
                second._begin_leg(stamp_ns)
            if self._first is not None:
                self._first._advance()
