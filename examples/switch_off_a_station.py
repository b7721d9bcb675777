"""Switch a wayside station off, and on again, by the standard lifecycle service.

Run:  rail run demo --rate 1 --processes site          (in another terminal)
      python examples/switch_off_a_station.py [STATION]
See:  what is said on /diagnostics while the station is off, and once it is back. The same by hand:
      ros2 lifecycle set /wayside/wrs4 deactivate
"""

from __future__ import annotations

import sys

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.node import Node

OFF_S = 3.0


def change(node: Node, station: str, transition: int) -> bool:
    """Ask for a transition; return whether it was made."""
    client = node.create_client(ChangeState, f"/wayside/{station}/change_state")
    if not client.wait_for_service(timeout_sec=60.0):
        return False
    answer = client.call_async(ChangeState.Request(transition=Transition(id=transition)))
    rclpy.spin_until_future_complete(node, answer, timeout_sec=10.0)
    return bool(answer.done() and answer.result().success)


def main() -> int:
    """Switch off, listen for a while, switch on."""
    station = sys.argv[1] if len(sys.argv) > 1 else "wrs4"
    rclpy.init()
    node = rclpy.create_node("switch_off_a_station")

    def show(message: DiagnosticArray) -> None:
        for status in message.status:
            if status.level != DiagnosticStatus.OK or station in status.name:
                print(f"{message.header.stamp.sec:5d} s  {status.name}: {status.message}")

    node.create_subscription(DiagnosticArray, "/diagnostics", show, 100)
    if not change(node, station, Transition.TRANSITION_DEACTIVATE):
        print(f"{station} cannot be switched off: is the corridor running?")
        return 1
    print(f"{station} is off")
    until = node.get_clock().now().nanoseconds + int(OFF_S * 1e9)
    while node.get_clock().now().nanoseconds < until:
        rclpy.spin_once(node, timeout_sec=0.1)
    print(f"{station} is on: {change(node, station, Transition.TRANSITION_ACTIVATE)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
