"""What every medium is as a node: it reads its part of the world file, and ends its ticks."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

from rail_msgs_py.decoders import table
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.quantities import GIVE_UP
from rail_msgs_py.tick_inputs import Step, TickInputs
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.tick import DONE
from rail_msgs_py.topics.world import STATE

from .world_file import Part, WorldFile, read_world_file


@dataclass(frozen=True)
class MediumParameters:
    """Parameters of every medium."""

    world_file: str = parameter("", "JSON file with tracks, trains and media")
    timeout_s: float = GIVE_UP.parameter()


Parameters = TypeVar("Parameters", bound=MediumParameters)


class MediumNode(EquipmentNode[Parameters]):
    """Node of a medium: `on_tick` takes what is sent and delivers what arrives.

    The tick of the medium is done when `on_tick` has returned. Switched off it is dead air, where
    nothing of what is sent arrives: a leg of a tick is opened by `leg`, and takes none of it.
    """

    #: Port of the true state of all trains, which is nothing that is sent.
    _truth_port = ""

    def _build(self) -> None:
        self._world = read_world_file(self._p.world_file)
        self._kinds: dict[str, type[Any]] = {}
        self._done = self.stream_out(DONE, node=self.get_fully_qualified_name())
        super()._build()

    @cached_property
    def inputs(self) -> TickInputs:
        """What `on_tick` waits for."""
        return self.leg(self._on_tick, self._p.timeout_s)

    def leg(self, step: Step, timeout_s: float, **how: Any) -> TickInputs:
        """Inputs of one leg of a tick; ``how`` as of `TickInputs`."""

        def carry(stamp_ns: int, items: dict[str, Any]) -> None:
            if not self.switched_on:
                items = {port: items[port] for port in items if port == self._truth_port}
            step(stamp_ns, items)

        return TickInputs(self, carry, timeout_s, **how)

    def _on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        self.on_tick(stamp_ns, items)
        self._done(header_to_cdr(stamp_ns))

    def part(self, name: str, kind: type[Part]) -> Part:
        """Part of the world file under a name.

        Raises
        ------
        ParameterError
            If the world has no such part.
        """
        try:
            part = self._world.part(name, kind)
        except LookupError as error:
            raise ParameterError(f"world_file: {self._p.world_file}: {error}") from None
        self._kinds[name] = kind
        return part

    def take_faults(self, world: WorldFile) -> None:
        """Go on in a world in which other faults come, all else being as it was.

        A medium that looks at the faults of its ``description`` in every tick can do so.

        Raises
        ------
        LookupError
            If this one cannot, and its part is another one now.
        """
        medium = getattr(self, "_medium", None)
        for name, kind in self._kinds.items():
            if world.parts[name] == self._world.parts[name]:
                continue
            if type(getattr(medium, "description", None)) is not kind:
                raise LookupError(
                    f"{self.get_fully_qualified_name()} reads its faults at the start"
                )
            medium.description = world.part(name, kind)  # type: ignore[union-attr]
        self._world = world

    def state_port(self, inputs: TickInputs, trains: int) -> str:
        """Port of the true state of all trains, an array [train, column]; it begins the tick."""
        self._truth_port = inputs.trigger(STATE, table(STATE, trains))
        return self._truth_port
