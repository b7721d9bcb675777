"""The medium of the wheel sensors as a node.

Topics in: ``/world/state``. Topics out: every detection point's ``coils``, ``~/done``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from axle_counter.topics import COILS
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.waveform import Waveform
from rail_world.medium_node import MediumNode, MediumParameters

from .description import WheelSensorDescription
from .medium import Motion, WheelSensorMedium


@dataclass(frozen=True)
class WheelSensorMediumParameters(MediumParameters):
    """Parameters of the medium of the wheel sensors."""


class WheelSensorMediumNode(
    MediumNode[WheelSensorMediumParameters], name="wheel_sensor_medium", namespace="/world"
):
    """The medium of the wheel sensors as a node."""

    def setup(self) -> None:
        """Open the ports of all detection points."""
        world = self._world
        self._described = described = self.part("axle_counter", WheelSensorDescription)
        self._tick_ns = world.tick_ns
        self._medium = WheelSensorMedium(
            described, world.trains, world.network(), world.seed, world.tick_s
        )
        self._state = self.state_port(self.inputs, len(world.trains))
        self._send = [self.stream_out(COILS, point=place.point) for place in described.places]

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Deliver what the coils showed during the tick."""
        columns = [STATE.index[name] for name in ("path_m", "speed_mps", "on_line")]
        rows = items[self._state][:, columns].tolist()
        motions = [Motion(path_m, speed_mps, on_line > 0.0) for path_m, speed_mps, on_line in rows]
        blocks = self._medium.blocks(stamp_ns // self._tick_ns, motions)
        rate_hz = self._described.sample_rate_hz
        for send, amplitudes_v in zip(self._send, blocks, strict=True):
            block = Waveform(stamp_ns, rate_hz, 0.0, 0, amplitudes_v.astype(np.complex128))
            send(block.to_cdr())


if __name__ == "__main__":
    WheelSensorMediumNode.main()
