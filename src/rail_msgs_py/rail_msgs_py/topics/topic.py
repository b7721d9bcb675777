"""One kind of topic of the corridor."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from rclpy.qos import QoSProfile

from .column import Column


@dataclass(frozen=True)
class Topic:
    """One kind of topic.

    Parameters
    ----------
    pattern : str
        Absolute name with ``{placeholders}`` in names of their own level.
    type : message class
    qos : QoSProfile
    view : class with ``from_msg``, or None
        How ``rail echo`` decodes it.
    sender, readers, text : str
        For the documentation.
    table : tuple of Column
        Of a table: its columns.
    below_owner : int
        Levels of its name below that of the node that sends it.
    awaited : bool
        Whether a node may wait for its reader before the first tick although it is not a stream: an
        estimate that other equipment acts on.
    shared : bool
        Whether nodes of several processes send on it. It is then read through the middleware, by
        all but those that know the senders to be in their own process.
    """

    pattern: str
    type: Any
    qos: QoSProfile
    view: Any
    sender: str
    readers: str
    text: str
    table: tuple[Column, ...] = ()
    below_owner: int = 1
    awaited: bool = False
    shared: bool = False

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns of the table; empty where the scenario says how many there are.

        >>> from rail_msgs_py.topics.track_code import OCCUPANCY
        >>> OCCUPANCY.columns
        ('occupied', 'level_db')
        """
        names = tuple(column.name for column in self.table)
        return () if any("{" in name for name in names) else names

    @cached_property
    def column_texts(self) -> tuple[str, ...]:
        """What each of `columns` means."""
        return tuple(column.text for column in self.table) if self.columns else ()

    @cached_property
    def index(self) -> dict[str, int]:
        """Place of each column of the table.

        >>> from rail_msgs_py.topics.track_code import OCCUPANCY
        >>> OCCUPANCY.index["level_db"]
        1
        """
        return {name: place for place, name in enumerate(self.columns)}

    def name(self, **parts: object) -> str:
        """Absolute name with the placeholders filled in.

        >>> from rail_msgs_py.topics.ranging import RANGE
        >>> RANGE.name(site="wrs1", zone="zone1")
        '/wayside/wrs1/zone1/range'
        """
        return self.pattern.format(**parts)

    def owner(self, **parts: object) -> str:
        """Full name of the node that sends it, where the topic is named below its node.

        >>> from rail_msgs_py.topics.track_code import OCCUPANCY
        >>> OCCUPANCY.owner(circuit="tc1")
        '/wayside/tc1/track_code'
        """
        return self.name(**parts).rsplit("/", self.below_owner)[0]

    @cached_property
    def _expression(self) -> re.Pattern[str]:
        groups = re.sub(r"\\\{(\w+)\\\}", r"(?P<\1>[^/]+)", re.escape(self.pattern))
        return re.compile(groups)

    def matches(self, name: str) -> bool:
        """Whether ``name`` is of this kind."""
        return self._expression.fullmatch(name) is not None

    def parts(self, name: str) -> dict[str, str]:
        """What stands in a name for each placeholder; empty if it is not of this kind.

        >>> from rail_msgs_py.topics.ranging import RANGE
        >>> RANGE.parts("/wayside/wrs1/zone1/range")
        {'site': 'wrs1', 'zone': 'zone1'}
        """
        found = self._expression.fullmatch(name)
        return {} if found is None else found.groupdict()
