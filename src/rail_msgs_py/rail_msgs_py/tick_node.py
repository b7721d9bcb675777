"""What every kind of node of a corridor is made of: its parameters, its inputs, its tick.

A node says its parameters by a frozen dataclass, opens its ports in `setup`, and answers a tick in
`on_tick`:

    class Repeater(EquipmentNode[RepeaterParameters], name="repeater", namespace="/wayside/r1"):
        def setup(self) -> None:
            self._received = self.inputs.port(INPUT, table_row(INPUT), site=self.place)
            self.inputs.clock()
            self._send = self.table_out(OUTPUT, (self.place,), awaited=True, site=self.place)

        def start_over(self) -> None:
            self._filter = Filter(self._p.gain)

        def on_tick(self, stamp_ns: int, items: Mapping[str, Any]) -> None:
            self._send(stamp_ns, self._filter.update(items.get(self._received)))

A node that is renamed, or moved into another namespace, by remapping rules takes the topics below
its own name along.

Media add what they share in `rail_world.medium_node`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Generic, TypeVar, get_args

from lifecycle_msgs.msg import State

from .equipment import Equipment
from .node import CorridorMixin, CorridorNode, Services
from .off_times import OffTimeParameters, OffTimes, off_times_of
from .parameters import ParameterError, declare
from .standalone import run_node
from .tick_inputs import TickInputs

if TYPE_CHECKING:
    from .topics.topic import Topic

#: Namespaces that are of no train and no site.
_COMMON = ("", "/", "/world", "/wayside")

Parameters = TypeVar("Parameters")


class _Kind(CorridorMixin, Generic[Parameters]):
    """Constructor, hand-over of parameters, and entry point of a kind of node.

    A kind gives ``name`` and ``namespace`` as arguments of its class statement; they hold unless
    the constructor is given others.

    Parameters
    ----------
    name, namespace : str, optional
    context : rclpy Context, optional
    parameters : mapping, optional
        Values that override the defaults, as from a parameter file.
    services : bool or 'switches'
        As of `rail_msgs_py.node.node_arguments`.

    Raises
    ------
    ParameterError
        If a parameter is out of bounds, or `setup` or `start_over` cannot work with it.
    """

    parameter_type: ClassVar[type[Any]]
    default_name: ClassVar[str]
    default_namespace: ClassVar[str]
    _p: Parameters

    def __init_subclass__(cls, *, name: str = "", namespace: str = "", **others: Any) -> None:
        super().__init_subclass__(**others)
        if not name:  # a base of other kinds
            return
        cls.default_name, cls.default_namespace = name, namespace
        (cls.parameter_type,) = get_args(cls.__orig_bases__[0])

    def __init__(
        self,
        name: str | None = None,
        *,
        namespace: str | None = None,
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: Services = True,
    ) -> None:
        super().__init__(
            self.default_name if name is None else name,
            self.default_namespace if namespace is None else namespace,
            context=context,
            parameters=parameters,
            services=services,
        )
        self._p = declare(self, self.parameter_type)
        if not self.place and self.default_namespace not in _COMMON:
            raise ParameterError(f"{self.get_name()}: __ns: '/': names neither a train nor a site")
        try:
            self._build()
        except ValueError as error:
            reason = str(error).splitlines()[0]
            raise ParameterError(f"{self.get_name()}: {reason}") from error
        self.announce_when_connected()

    @classmethod
    def main(cls) -> None:
        """Run a node of this kind on its own."""
        run_node(cls)

    @cached_property
    def place(self) -> str:
        """Train or site that the node belongs to: the last level of its namespace."""
        return str(self.get_namespace()).rpartition("/")[2]

    @cached_property
    def listed_name(self) -> str:
        """Full name under which the table of topics has this node: that of its kind at its place.

        It is the actual one unless remapping rules say otherwise.
        """
        if self.default_namespace in _COMMON:
            return f"{self.default_namespace.rstrip('/')}/{self.default_name}"
        return f"{self.default_namespace.rpartition('/')[0]}/{self.place}/{self.default_name}"

    def name_of(self, topic: Topic, **parts: object) -> str:
        """Name of a topic; one below the listed name of the node is below its actual one."""
        listed = topic.name(**parts)
        if not listed.startswith(f"{self.listed_name}/"):
            return listed
        return f"{self.get_fully_qualified_name()}{listed[len(self.listed_name) :]}"

    @cached_property
    def inputs(self) -> TickInputs:
        """What `on_tick` waits for; overdue for ``timeout_s`` if that is a parameter."""
        return TickInputs(self, self.on_tick, getattr(self._p, "timeout_s", None))

    def _build(self) -> None:
        self.setup()

    def setup(self) -> None:
        """Open the ports, and make what lasts as long as the node."""
        raise NotImplementedError

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Answer a tick of which every port has been heard or has failed.

        Parameters
        ----------
        stamp_ns : int
            Simulated time of the tick.
        items : dict
            What each port has received, by the name that it was given when opened.
        """
        raise NotImplementedError


class TickNode(_Kind[Parameters], CorridorNode):
    """Node that cannot be switched off."""


class EquipmentNode(_Kind[Parameters], Equipment):
    """Managed node: equipment that can be switched off and on.

    Switched off it still answers every tick; `switched_on` tells whether it is. Besides by hand it
    is switched by the times of its `OffTimeParameters`: what it is in a step follows from the stamp
    of that step alone, so that it is the same wherever the node runs.
    """

    _off_times = OffTimes()

    def _build(self) -> None:
        self._off_times = off_times_of(declare(self, OffTimeParameters))
        #: Newest stamp that it has been switched for.
        self._followed_ns = -1
        #: Whether it is on but for its off times.
        self._kept_on = True
        self._switches_itself = False
        self.setup()
        self.start_over()

    def start_over(self) -> None:
        """Forget everything that was before: called when it is built, and when it is switched on.

        What a node learns from what it receives is made here, and nowhere else.
        """

    def on_activate(self, state: Any) -> Any:
        """Lifecycle transition."""
        self.start_over()
        self._kept_on = True
        return super().on_activate(state)

    def on_deactivate(self, state: Any) -> Any:
        """Lifecycle transition."""
        self._kept_on = self._switches_itself
        return super().on_deactivate(state)

    def take_off_times(self, times: OffTimes) -> None:
        """Be switched off at these times from now on, instead of at those of its parameters."""
        self._off_times = times

    def begin_step(self, stamp_ns: int) -> None:
        """Be switched on or off as the off times say of a stamp."""
        if not self._off_times:
            return
        if stamp_ns > self._followed_ns:
            before_ns, self._followed_ns = self._followed_ns, stamp_ns
            self._follow_off_times(before_ns, stamp_ns)
        self.switched_on = self._kept_on and self._off_times.at(stamp_ns) is None

    def _follow_off_times(self, before_ns: int, stamp_ns: int) -> None:
        """Make the transitions that are due after one stamp and not after another."""
        now = self._off_times.at(stamp_ns)
        ended = now is None and self._off_times.has_ended(before_ns, stamp_ns)
        if now is None and not ended:
            return
        self.at_tick(stamp_ns)
        self._switches_itself = True
        if now is not None and self._is_active:
            self._off_words = str(now)
            self.trigger_deactivate()
            self._off_words = "switched off"
        elif ended and self._is_active:  # too short for a tick to fall into
            self.start_over()
        elif ended:
            self.trigger_activate()
        self._switches_itself = False

    @property
    def _is_active(self) -> bool:
        """Whether the state of its life cycle is that of equipment that is switched on."""
        machine: Any = self._state_machine
        return bool(machine.current_state[0] == State.PRIMARY_STATE_ACTIVE)
