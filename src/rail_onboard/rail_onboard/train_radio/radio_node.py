"""Train radio: frames to bursts for the base station, and bursts to frames.

Topics in: ``/clock``, ``/<train>/atp/telegrams``, ``channel_<n>/downlink`` for every channel.
Topics out: ``uplink``, ``telegrams``, ``link``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import samples, stamped
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.quantities import GIVE_UP, TICK
from rail_msgs_py.stamps import NANOSECONDS
from rail_msgs_py.tick_inputs import TickInputs
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.train_radio import (
    CBTC_TRAIN_RX,
    CBTC_TRAIN_TX,
    RADIO_LINK,
    RADIO_TELEGRAMS,
    TRAIN_TELEGRAMS,
)
from rail_msgs_py.train_radio import quantities
from rail_msgs_py.train_radio.parameters import TrainRadioParameters, slots_of
from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams
from rail_msgs_py.waveform import Waveform, silence
from rail_signals.train_radio.burst import RadioBurstReceiver
from rail_signals.train_radio.slots import frame_of

from .base_selector import BaseSelector


@dataclass(frozen=True)
class CbtcRadioParameters(TrainRadioParameters):
    """Parameters of a train radio."""

    slot: int = parameter(1, "slot of the train", low=1, high=1000)
    downlink_channels: tuple[int, ...] = quantities.DOWNLINK_CHANNELS.parameter()
    uplink_carriers_hz: tuple[float, ...] = quantities.UPLINK_CARRIERS.parameter()
    power_dbm: float = quantities.TRAIN_POWER.parameter()
    tick_s: float = TICK.parameter()
    timeout_s: float = GIVE_UP.parameter()


class CbtcRadioNode(EquipmentNode[CbtcRadioParameters], name="cbtc_radio", namespace="/train_1"):
    """A train radio as a managed node; switched off it neither sends nor hears.

    What it sends in a tick does not depend on what it receives in that tick: two steps, each with
    inputs of its own.
    """

    def setup(self) -> None:
        """Open the ports to air and train protection."""
        p, train = self._p, self.place
        if len(p.downlink_channels) != len(p.uplink_carriers_hz):
            raise ParameterError(
                f"uplink_carriers_hz: {p.uplink_carriers_hz}: one for each of"
                f" {len(p.downlink_channels)} channels"
            )
        self._slots = slots_of(p)
        self._receiver = RadioBurstReceiver(self._slots.burst)
        self._amplitude = 10.0 ** (p.power_dbm / 20.0) * p.samples_per_symbol**0.5
        self._carriers_hz = dict(zip(p.downlink_channels, p.uplink_carriers_hz, strict=True))
        self._telegrams = self.inputs.port(
            TRAIN_TELEGRAMS,
            stamped(Telegrams.from_cdr),
            delay_ns=round(p.tick_s * NANOSECONDS),
            train=train,
        )
        self.inputs.clock()
        downlink = TickInputs(self, self._receive)
        self._ports = {
            channel: downlink.port(CBTC_TRAIN_RX, samples, train=train, channel=channel)
            for channel in sorted(p.downlink_channels)
        }
        self._send = self.stream_out(CBTC_TRAIN_TX, train=train)
        self._report_frames = self.stream_out(RADIO_TELEGRAMS, train=train)
        self._link = self.table_out(RADIO_LINK, (train,), train=train)
        self._values = np.zeros((1, len(RADIO_LINK.columns)))

    def start_over(self) -> None:
        """Have no base station."""
        self._selector = BaseSelector()

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Send the frame of train protection on the uplink in force."""
        channel = self._selector.channel
        ordered = items.get(self._telegrams)
        rate_hz = self._slots.burst.sample_rate_hz
        if not (self.switched_on and channel and ordered and ordered.frames):
            number = channel or self._p.downlink_channels[0]
            block = silence(stamp_ns, rate_hz, self._carriers_hz[number], number)
        else:
            burst = self._slots.bursts([ordered.frames[0][1]])[0] * self._amplitude
            block = Waveform(stamp_ns, rate_hz, self._carriers_hz[channel], channel, burst)
        self._send(block)

    def _receive(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Report the frames of the train, and choose the base station by the beacons."""
        received = {
            channel: items[port] for channel, port in self._ports.items() if items[port] is not None
        }
        frames: list[tuple[int, bytes]] = []
        beacons: dict[int, float] = {}
        if self.switched_on and received:
            # Of each channel the beacon and the train's own slot, by the antennas of the scheme.
            antennas = self._slots.burst.scheme.receive
            cut = np.stack([self._slots.cut(block[:antennas]) for block in received.values()])
            bursts = self._receiver.receive(cut, doppler_hz=self._p.doppler_hz)
            for row, number in enumerate(received):
                if bursts.detected[row, 0]:
                    beacons[number] = float(np.mean(bursts.snr[row, 0]))
                if bursts.detected[row, 1]:
                    frames.append((self._p.slot, frame_of(bursts.bits[row, 1])))
        channel = self._selector.update(beacons)
        self._report_frames(telegrams(stamp_ns, frames))
        self._values[0] = channel or 0, beacons.get(channel or 0, 0.0), len(frames)
        self._link(stamp_ns, self._values)
        self.report(
            DiagnosticStatus.OK if beacons else DiagnosticStatus.WARN,
            "radio",
            "hears a base station" if beacons else "hears no base station",
            stamp_ns=stamp_ns,
        )


if __name__ == "__main__":
    CbtcRadioNode.main()
