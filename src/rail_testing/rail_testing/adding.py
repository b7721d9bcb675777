"""What a test puts beside its corridor, or in the place of nodes of its own."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rail_corridor.errors import InputError
from rail_corridor.plan.plan import Plan, make_plan
from rail_corridor.scenario.model import Scenario
from rail_corridor.stepped.corridor import SteppedCorridor

from .under_test import NodesUnderTest, UnderTest


class AddingMixin:
    """The part of `rail_testing.corridor.Corridor` that comes before the first tick."""

    _scenario: Scenario
    _plan: Plan | None
    _session: SteppedCorridor | None
    _under_test: NodesUnderTest

    def parameters_of(self, node: str) -> dict[str, Any]:
        """ROS parameters that the scenario gives a node, by its full name."""
        return dict(self.planned.node(node).parameters)

    def add(
        self,
        node: Any = None,
        *,
        replaces: str | None = None,
        attach: bool = True,
        command: Sequence[str] | None = None,
        name: str | None = None,
        within_s: float | None = None,
    ) -> UnderTest:
        """Put a node beside the corridor, or in the place of one of its own.

        Before the first tick. Of a kind derived from `rail_msgs_py.tick_node` the scenario's name
        and parameters are handed over.

        Parameters
        ----------
        node : rclpy Node, class, or callable that makes one; optional
            None if ``command`` starts it, or if it runs elsewhere already.
        replaces : str, optional
            Full name of a node of the scenario, whose work it does.
        attach : bool
            Whether no tick begins before its callbacks of the one before have run.
        command : sequence of str, optional
            Starts it in a process of its own, in any language, with the corridor's ROS domain.
        name : str, optional
            Full name of a node in a process of its own that replaces nothing: each tick waits for
            its answer on ``<name>/done``.
        within_s : float, optional
            Wall time that a tick waits for a node that replaces one; then the corridor goes on
            without it until it sends again. The time-out of the corridor if not given.

        Returns
        -------
        UnderTest
            Its ``node`` is the node itself, once the corridor has started.

        Raises
        ------
        InputError
            If the corridor has no such node, or has begun.
        """
        if self._session is not None:
            raise InputError("add nodes before the first tick", field="node", value=str(node))
        if replaces is not None:
            self.parameters_of(replaces)
        return self._under_test.add(
            node, replaces, attach=attach, command=command, name=name, within_s=within_s
        )

    @property
    def planned(self) -> Plan:
        """The nodes of the scenario, and what they are given."""
        if self._session is not None:
            return self._session.plan
        if self._plan is None:
            with tempfile.TemporaryDirectory() as directory:
                self._plan = make_plan(self._scenario, Path(directory))
        return self._plan
