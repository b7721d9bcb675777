"""What befalls a stepped corridor: nodes are killed, restarted and switched, faults change."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from rail_corridor.equipment.off_times import off_times, with_off_times
from rail_corridor.errors import InputError
from rail_corridor.plan.plan import WORLD
from rail_corridor.plan.world_plan import world_file
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.off_times import OffTime, OffTimes
from rail_msgs_py.tick_node import EquipmentNode

from .corridor import StalledError, SteppedCorridor

#: Wall time for a node in a new process to be heard by all that listen to it [s].
_HEARD_S = 0.5


def _silence(node: Any) -> None:
    """Let a node hear and do nothing more.

    It stays with the executor: that of these wheels may fault when it forgets a node to which
    something is under way.
    """

    def hear_nothing(_: Any) -> None:
        pass

    for subscription in node.subscriptions:
        subscription.callback = hear_nothing
    for timer in node.timers:
        timer.cancel()


class Interference:
    """Interferes with a corridor while it stands.

    Parameters
    ----------
    corridor : SteppedCorridor
    """

    def __init__(self, corridor: SteppedCorridor) -> None:
        self._corridor = corridor

    def kill(self, name: str) -> None:
        """Take a node out, as if its process had been killed; with it what shares the process.

        Raises
        ------
        InputError
            If it is the world, or no node of the corridor.
        """
        corridor = self._corridor
        self._refuse_world(name)
        if corridor.sites is not None and name in corridor.sites:
            corridor.sites.kill(name)
            killed, reason = corridor.sites.beside(name), "process killed by SIGKILL"
        else:
            node = corridor.node(name)
            del corridor.nodes[name]
            _silence(node)
            corridor.delivery.remove(node)
            corridor.dead.append(node)
            killed, reason = [name], "killed"
        for each in killed:
            self.announce_gone(each, reason)

    def announce_gone(self, name: str, reason: str = "killed") -> None:
        """Let everybody know of a node that has been ended."""
        corridor = self._corridor
        self._refuse_world(name)
        corridor.gone.add(name)
        corridor.call(partial(corridor.observer.announce_failure, name, reason))

    def restart(self, name: str, make: Callable[[], Any] | None = None) -> None:
        """Start a node anew, whether or not it is alive: it knows nothing of what was before.

        Parameters
        ----------
        name : str
        make : callable, optional
            Makes it and has it spun, where it is none of the scenario's own.

        Raises
        ------
        InputError
            As of `kill`.
        StalledError
            If one in another process is not ready in time.
        """
        corridor = self._corridor
        self._refuse_world(name)
        if name not in corridor.gone:
            self.kill(name)
        if corridor.sites is not None and name in corridor.sites:
            self.start_elsewhere(corridor.sites.beside(name), partial(corridor.sites.start, name))
            return
        if make is not None:
            make()
        else:
            corridor.add_node(corridor.made(corridor.spec(name)), name)
        corridor.gone.discard(name)

    def start_elsewhere(self, names: Sequence[str], start: Callable[[], None]) -> None:
        """Start a process, and wait until its nodes are ready.

        One that lacks nothing but connections while others are dead counts as ready: its peers are
        among them.

        Parameters
        ----------
        names : sequence of str
            Full names of the nodes in the process.
        start : callable

        Raises
        ------
        StalledError
            If they are not ready in time.
        """
        corridor, back = self._corridor, {*names}
        said = corridor.ready_again(back, others_dead=bool(corridor.gone - back))
        start()
        if not corridor.spin(lambda: said >= back, corridor.timeout_s):
            lacking = ", ".join(sorted(back - said))
            raise StalledError(f"{lacking}: not ready within {corridor.timeout_s:g} s")
        # That it hears others it has said; when others hear it cannot be seen from here.
        corridor.spin(lambda: False, _HEARD_S)
        corridor.gone.difference_update(back)

    def can_be_switched(self, name: str) -> bool:
        """Whether a node is equipment that can be switched off and on."""
        corridor = self._corridor
        if not corridor.is_elsewhere(name):
            return hasattr(corridor.node(name), "switch_on")
        service = f"{name}/change_state"

        def offered() -> bool:
            found = corridor.observer.get_service_names_and_types()
            return any(each == service for each, _ in found)

        return corridor.spin(offered, _HEARD_S)

    def switch(self, name: str, *, on: bool) -> None:
        """Switch equipment on or off.

        Raises
        ------
        InputError
            If it cannot be switched.
        StalledError
            If one in another process does not answer.
        """
        corridor = self._corridor
        if corridor.is_elsewhere(name):
            self._switch_elsewhere(name, on=on)
            return
        node = corridor.node(name)
        if not hasattr(node, "switch_on"):
            raise InputError("is no equipment that can be switched", field="node", value=name)
        if on != node.switched_on:
            corridor.call(node.trigger_activate if on else node.trigger_deactivate)

    def _switch_elsewhere(self, name: str, *, on: bool) -> None:
        """Switch equipment of another process, by the service of its life cycle."""
        corridor = self._corridor
        client = corridor.observer.create_client(ChangeState, f"{name}/change_state")
        try:
            if not corridor.spin(client.service_is_ready, corridor.timeout_s):
                raise InputError("is no equipment that can be switched", field="node", value=name)
            request = ChangeState.Request()
            wanted = Transition.TRANSITION_ACTIVATE if on else Transition.TRANSITION_DEACTIVATE
            request.transition.id = wanted
            if not corridor.spin_until(client.call_async(request), corridor.timeout_s):
                raise StalledError(f"{name}: did not answer within {corridor.timeout_s:g} s")
        finally:
            corridor.observer.destroy_client(client)

    def change_faults(self, scenario: Scenario) -> None:
        """Go on with the faults of another scenario, which has the same of everything else.

        Raises
        ------
        LookupError
            If a medium reads its faults at the start alone, or is in another process.
        """
        corridor = self._corridor
        self._change_off_times(scenario)
        for spec in corridor.plan.nodes:
            if spec.side == "world" and spec.name not in corridor.nodes:
                reason = "is in a process of its own, and reads faults at the start"
                raise LookupError(f"{spec.name} {reason}")
        world = world_file(scenario)
        for node in corridor.nodes.values():
            if hasattr(node, "take_faults"):
                node.take_faults(world)
        corridor.scenario = scenario

    def _change_off_times(self, scenario: Scenario) -> None:
        """Let equipment be switched off at other times."""
        corridor = self._corridor
        before, after = off_times(corridor.scenario), off_times(scenario)
        for name in {*before, *after}:
            times = after.get(name, [])
            if times == before.get(name, []):
                continue
            node = corridor.nodes.get(name)
            if not isinstance(node, EquipmentNode):
                raise LookupError(f"{name} is not here, or no equipment that can be switched")
            node.take_off_times(OffTimes(OffTime(*each) for each in times))
        nodes = tuple(with_off_times(scenario, corridor.plan.nodes))
        corridor.plan = replace(corridor.plan, nodes=nodes)

    def _refuse_world(self, name: str) -> None:
        self._corridor.spec(name)
        if name == WORLD:
            raise InputError("nothing goes on without the world", field="node", value=name)
