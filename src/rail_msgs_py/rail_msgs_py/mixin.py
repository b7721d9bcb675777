"""What a mixin of nodes stands on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rclpy.node import Node

#: To the type checker a mixin has what rclpy's nodes have; at run time it stands before them.
RosNode: Any = Node if TYPE_CHECKING else object
