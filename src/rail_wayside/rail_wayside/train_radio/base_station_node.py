"""Base station of the train radio: frames to bursts for the trains, and bursts to frames.

A train has one slot in a tick, and one frame a tick comes for it. If more come, the last one is
sent and the others are dropped: a slot has no room to catch up, so that a queue that had once
been filled would make every later frame late. (Ports of process data do the same: the newest
value replaces the one before.) An intruder on the network can so displace a frame, which the ends
count as lost, but not delay those after it.

Topics in: ``/clock``, ``/wayside/zone_controller/<base>/telegrams`` or, with ``backbone``,
``/world/backbone/<base>/downlink_telegrams``; ``uplink``. Topics out: ``downlink``, ``telegrams``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import samples, stamped
from rail_msgs_py.parameters import parameter
from rail_msgs_py.quantities import GIVE_UP, TICK
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.train_radio import (
    BACKBONE_DOWN,
    CBTC_BASE_RX,
    CBTC_BASE_TX,
    DOWN_TELEGRAMS,
    UP_TELEGRAMS,
)
from rail_msgs_py.train_radio import quantities
from rail_msgs_py.train_radio.parameters import TrainRadioParameters, slots_of
from rail_msgs_py.train_radio.safe_frame import FRAME_BYTES
from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams
from rail_msgs_py.waveform import RepeatedBlock, Waveform, silence
from rail_signals.arrays import ComplexArray
from rail_signals.train_radio.burst import RadioBurstReceiver
from rail_signals.train_radio.slots import BEACON_SLOT, frame_of, used_slots

BEACON = bytes(range(FRAME_BYTES))
"""What the beacon carries: trains look at how well it arrives, not at what it says."""


@dataclass(frozen=True)
class CbtcBaseStationParameters(TrainRadioParameters):
    """Parameters of a base station."""

    downlink_carrier_hz: float = quantities.DOWNLINK_CARRIER.parameter()
    downlink_channel: int = parameter(1, "its channel number", low=1)
    power_dbm: float = quantities.BASE_POWER.parameter()
    backbone: bool = parameter(
        False, "whether the backbone brings the telegrams, instead of the zone controller itself"
    )
    tick_s: float = TICK.parameter()
    timeout_s: float = GIVE_UP.parameter()


class CbtcBaseStationNode(
    EquipmentNode[CbtcBaseStationParameters], name="cbtc", namespace="/wayside/base1"
):
    """A base station as a managed node; switched off it neither sends nor hears."""

    def setup(self) -> None:
        """Make the beacon, and open the ports to air and network."""
        p, base = self._p, self.place
        self._slots = slots_of(p)
        self._receiver = RadioBurstReceiver(self._slots.burst)
        # Waves of mean power 1 mW need an energy per symbol of as many samples.
        self._amplitude = 10.0 ** (p.power_dbm / 20.0) * p.samples_per_symbol**0.5
        self._beacon = self._slots.bursts([BEACON])[0] * self._amplitude
        self._radio = (
            self._slots.burst.sample_rate_hz,
            p.downlink_carrier_hz,
            p.downlink_channel,
        )
        self._silence = RepeatedBlock(silence(0, *self._radio))
        self._send = self.stream_out(CBTC_BASE_TX, base=base)
        self._report_frames = self.stream_out(UP_TELEGRAMS, base=base)
        self._telegrams = self.inputs.port(
            BACKBONE_DOWN if p.backbone else DOWN_TELEGRAMS,
            stamped(Telegrams.from_cdr),
            delay_ns=round(p.tick_s * NANOSECONDS),
            base=base,
        )
        self.blocks_in(CBTC_BASE_RX, samples, self._on_block, base=base)
        self.inputs.clock()

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Send the beacon, and to every train its newest frame."""
        if not self.switched_on:
            self._send(self._silence.at(stamp_ns))
            return
        ordered = items.get(self._telegrams)
        frames = ordered.newest(self._p.trains) if ordered else {}
        block = self._slots.block(frames, self._amplitude)
        first, end = self._slots.span(BEACON_SLOT)
        block[:, first:end] = self._beacon
        self._send(Waveform(stamp_ns, *self._radio, block))

    def _on_block(self, stamp_ns: int, received: ComplexArray | None) -> None:
        if received is None:
            self._report_frames(telegrams(stamp_ns))
            return
        frames: list[tuple[int, bytes]] = []
        if self.switched_on:
            # Where a scheme sends by two antennas and receives by one, that is the first.
            heard = received[: self._slots.burst.scheme.receive]
            cut = self._slots.cut(heard)
            used = [slot for slot in used_slots(heard, self._slots.burst.samples) if slot]
            bursts = self._receiver.receive(cut[used], doppler_hz=self._p.doppler_hz)
            frames = [
                (slot, frame_of(bits))
                for slot, bits, detected in zip(used, bursts.bits, bursts.detected, strict=True)
                if detected
            ]
        self._report_frames(telegrams(stamp_ns, frames))
        self.report(DiagnosticStatus.OK, "radio", "hears trains", stamp_ns=stamp_ns)


if __name__ == "__main__":
    CbtcBaseStationNode.main()
