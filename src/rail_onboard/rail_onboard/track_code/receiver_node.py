"""Receiver of track codes on a train: from the antenna ahead of the first axle to the message.

Topics in: ``rx``. Topics out: ``message``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import block
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_RX
from rail_msgs_py.track_code import quantities
from rail_msgs_py.waveform import Waveform
from rail_signals.track_code.profile import load_profile, profile_names
from rail_signals.track_code.receiver import TrackCodeReceiver
from rail_signals.track_code.word import as_number

from .carrier_selector import CarrierSelector

_FIELDS = ("speed", "gradient", "block_length", "network")


@dataclass(frozen=True)
class TrackCodeReceiverParameters:
    """Parameters of a receiver of track codes."""

    profile: str = quantities.PROFILE.parameter()
    carriers_hz: tuple[float, ...] = quantities.CARRIERS.parameter()
    sample_rate_hz: float = quantities.SAMPLE_RATE.parameter()
    least_level_db: float = parameter(
        -60.0, "level below which a carrier is not there", unit="dB", low=-200.0, high=100.0
    )


class TrackCodeReceiverNode(
    EquipmentNode[TrackCodeReceiverParameters], name="track_code", namespace="/train_1"
):
    """Receiver of track codes as a managed node."""

    def setup(self) -> None:
        """Open the ports of the train."""
        name, train = self._p.profile, self.place
        if name not in profile_names():
            raise ParameterError(f"profile: {name}: is not one of {', '.join(profile_names())}")
        self._profile = load_profile(name)
        self._publish = self.table_out(CODE_RECEIVED, (train,), train=train)
        self._values = np.zeros((1, len(CODE_RECEIVED.columns)))
        self.blocks_in(CODE_RX, block, self._on_block, train=train)

    def start_over(self) -> None:
        """Have received nothing on any carrier."""
        p = self._p
        self._receivers = {
            carrier_hz: TrackCodeReceiver(self._profile, carrier_hz, p.sample_rate_hz)
            for carrier_hz in p.carriers_hz
        }
        self._selector = CarrierSelector(p.carriers_hz, p.sample_rate_hz, p.least_level_db)

    def _on_block(self, stamp_ns: int, received: Waveform | None) -> None:
        self.at_tick(stamp_ns)
        values = self._values[0]
        values[:] = 0.0
        if self.switched_on and received is not None:
            samples = np.ascontiguousarray(received.row.real)
            carrier_hz = self._selector.update(samples)
            decisions = {
                each_hz: receiver.feed(samples) for each_hz, receiver in self._receivers.items()
            }
            values[-1] = self._selector.level_db
            if carrier_hz is not None:
                values[0] = carrier_hz
                self._show(decisions[carrier_hz], values)
        self._publish(stamp_ns, self._values)
        hears = bool(values[0])
        self.report(
            DiagnosticStatus.OK if hears else DiagnosticStatus.WARN,
            "pick-up",
            "hears a carrier" if hears else "hears no carrier",
            stamp_ns=stamp_ns,
        )

    def _show(self, decisions: list[Any], values: np.ndarray[Any, Any]) -> None:
        """The last decision of the tick, if it is valid."""
        if not decisions or not decisions[-1].valid:
            return
        last = decisions[-1]
        values[1] = 1.0
        values[2] = as_number(last.bits)
        values[3:7] = [last.fields[field] for field in _FIELDS]


if __name__ == "__main__":
    TrackCodeReceiverNode.main()
