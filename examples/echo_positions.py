"""Listen to the trains of a running corridor: plain rclpy and standard messages, nothing of ours.

Run:  rail run demo --rate 1          (in another terminal)
      python examples/echo_positions.py [COUNT]
See:  a line per train and second: where the zone controller says it is, and how sure it is.
"""

from __future__ import annotations

import math
import sys

import rclpy
from nav_msgs.msg import Odometry

PREFIX, SUFFIX = "/wayside/zone_controller/", "/position"


def main() -> None:
    """Print positions until interrupted, or COUNT of them."""
    left = int(sys.argv[1]) if len(sys.argv) > 1 else 0
    rclpy.init()
    node = rclpy.create_node("echo_positions")
    seen: dict[str, int] = {}
    printed = 0

    def show(message: Odometry) -> None:
        nonlocal printed
        second = message.header.stamp.sec
        if seen.get(message.child_frame_id) == second:
            return
        seen[message.child_frame_id] = second
        sigma_m = math.sqrt(message.pose.covariance[0])
        where = f"{message.pose.pose.position.x:8.2f} m, sigma {sigma_m:.2f} m"
        where = where if math.isfinite(sigma_m) else "not known"
        print(f"{second:5d} s  {message.child_frame_id} on {message.header.frame_id}: {where}")
        printed += 1

    listening: dict[str, object] = {}

    def look_for_trains() -> None:
        for topic, _ in node.get_topic_names_and_types():
            if topic.startswith(PREFIX) and topic.endswith(SUFFIX) and topic not in listening:
                listening[topic] = node.create_subscription(Odometry, topic, show, 10)

    node.create_timer(0.2, look_for_trains)
    try:
        while not left or printed < left:
            rclpy.spin_once(node)
    except KeyboardInterrupt:
        pass


if __name__ == "__main__":
    main()
