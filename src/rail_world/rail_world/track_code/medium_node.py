"""The rails as a node: takes what track circuits feed in, delivers what arrives at trains and ends.

Topics in: ``/world/state``, every circuit's ``feed_end``. Topics out: every circuit's
``relay_end``, every train's ``rx``, ``~/done``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.topics.track_code import CIRCUIT_RX, CIRCUIT_TX, CODE_RX
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.waveform import BlockReader, Waveform
from rail_world.medium_node import MediumNode, MediumParameters

from .description import RailDescription
from .medium import RailMedium, TrainsOnRails


@dataclass(frozen=True)
class RailMediumParameters(MediumParameters):
    """Parameters of the rails."""


class RailMediumNode(MediumNode[RailMediumParameters], name="rail_medium", namespace="/world"):
    """The rails as a node."""

    def setup(self) -> None:
        """Open the ports of all circuits and trains."""
        self._rails = rails = self.part("track_code", RailDescription)
        world = self._world
        self._tick_ns = world.tick_ns
        self._medium = RailMedium(rails, world.seed, world.tick_s)
        self._lengths_m = np.array([train.vehicle.length_m for train in world.trains])
        self._ports = [
            self.inputs.port(CIRCUIT_TX, BlockReader().decoder(), circuit=circuit.name)
            for circuit in rails.circuits
        ]
        self._state = self.state_port(self.inputs, len(world.trains))
        self._circuit_out = [self.stream_out(CIRCUIT_RX, circuit=c.name) for c in rails.circuits]
        self._train_out = [self.stream_out(CODE_RX, train=train.name) for train in world.trains]

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Deliver to trains and relay ends what arrives of the codes fed in."""
        state = items[self._state]
        front_m = state[:, STATE.index["chainage_m"]].copy()
        trains = TrainsOnRails(
            track=state[:, STATE.index["track_index"]].astype(np.intp),
            front_m=front_m,
            rear_m=front_m - self._lengths_m,
            on_line=state[:, STATE.index["on_line"]] > 0.0,
        )
        blocks = {
            index: items[port].row.real
            for index, port in enumerate(self._ports)
            if port in items and not items[port].silent
        }
        # A block is what happens during the tick that ends at its stamp.
        tick, time_s = stamp_ns // self._tick_ns, stamp_ns * 1e-9
        arrived = self._medium.propagate(tick, time_s, trains, blocks)
        for publish, samples in zip(self._train_out, arrived.trains, strict=True):
            publish(self._block(stamp_ns, samples))
        for publish, samples in zip(self._circuit_out, arrived.circuits, strict=True):
            publish(self._block(stamp_ns, samples))

    def _block(self, stamp_ns: int, samples: NDArray[np.float64]) -> Waveform:
        return Waveform(
            stamp_ns, self._rails.sample_rate_hz, 0.0, 0, samples[None].astype(np.complex128)
        )


if __name__ == "__main__":
    RailMediumNode.main()
