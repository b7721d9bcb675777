"""The medium of the reference tones as a node.

Topics in: ``/world/state``, every reference station's ``tone``. Topics out: every train's
``doppler/rx``, ``~/done``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rail_msgs_py.topics.doppler import REFERENCE_RX, REFERENCE_TX
from rail_msgs_py.waveform import BlockReader, RepeatedBlock, Waveform, silence
from rail_world.medium_node import MediumNode, MediumParameters

from .description import ReferenceDescription
from .medium import ReferenceMedium

_CHANNEL = 1


@dataclass(frozen=True)
class ReferenceMediumParameters(MediumParameters):
    """Parameters of the medium."""


class ReferenceMediumNode(
    MediumNode[ReferenceMediumParameters], name="reference_medium", namespace="/world"
):
    """The medium of the reference tones as a node."""

    def setup(self) -> None:
        """Open the ports of all stations and trains."""
        plan = self.part("doppler", ReferenceDescription)
        self._tick_ns = self._world.tick_ns
        self._medium = ReferenceMedium(plan, self._world.network(), self._world.seed)
        self._ports = [
            self.inputs.port(REFERENCE_TX, BlockReader().decoder(), station=station.name)
            for station in plan.stations
        ]
        self._state = self.state_port(self.inputs, len(plan.trains))
        self._out = [self.stream_out(REFERENCE_RX, train=train) for train in plan.trains]
        self._radio = (plan.sample_rate_hz, plan.carrier_hz, _CHANNEL)
        self._silence = RepeatedBlock(silence(0, *self._radio))

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Deliver to every train the sum of the tones in its reach."""
        sent = {
            index: items[port].row
            for index, port in enumerate(self._ports)
            if port in items and not items[port].silent
        }
        received = self._medium.receive(
            stamp_ns // self._tick_ns, stamp_ns * 1e-9, items[self._state], sent
        )
        for train, publish in enumerate(self._out):
            if train in received:
                samples = received[train][None, :].astype(np.complex128)
                publish(Waveform(stamp_ns, *self._radio, samples))
            else:
                publish(self._silence.at(stamp_ns))


if __name__ == "__main__":
    ReferenceMediumNode.main()
