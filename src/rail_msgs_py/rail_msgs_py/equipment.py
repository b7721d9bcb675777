"""Equipment that can be switched off: a managed node of ROS."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.lifecycle import LifecycleNode

from .node import CorridorMixin, Services, node_arguments


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
        self._off_words = "switched off"
        self.init_corridor()

    def switch_on(self) -> None:
        """Configure and activate."""
        self.trigger_configure()
        self.trigger_activate()

    def destroy_node(self) -> None:
        """Destroy the node with its state machine.

        rclpy 7.1 leaves that to the collector. It holds the node: a process that ends before would
        not take leave, and others would take it for alive until its lease is over, 20 s later.
        """
        super().destroy_node()
        self._state_machine = None

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
        self.report(DiagnosticStatus.WARN, "equipment", self._off_words)
        return super().on_deactivate(state)
