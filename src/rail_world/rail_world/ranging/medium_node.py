"""The radio medium as a node: takes what every antenna sends, delivers what every one receives.

Within one tick it is passed twice: stations to trains, then trains to stations.
Topics in: ``/world/state``, every ``tx``. Topics out: every ``rx``, ``~/links``, ``~/done``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rail_msgs_py.topics.ranging import LINKS, VRS_RX, VRS_TX, WRS_RX, WRS_TX
from rail_msgs_py.waveform import BlockReader, RepeatedBlock, Waveform, WaveformView, silence
from rail_world.medium_node import MediumNode, MediumParameters

from .description import RadioDescription
from .medium import RadioMedium, Reception, TrainAntennas


@dataclass(frozen=True)
class RadioMediumParameters(MediumParameters):
    """Parameters of the radio medium."""


class RadioMediumNode(MediumNode[RadioMediumParameters], name="radio_medium", namespace="/world"):
    """The radio medium as a node."""

    def setup(self) -> None:
        """Open the ports of all antennas, of the stations for the first leg of a tick."""
        self._radio = radio = self.part("ranging", RadioDescription)
        self._tick_ns = self._world.tick_ns
        self._medium = RadioMedium(radio, self._world.seed)
        self._trains = radio.trains
        self._downlink_of = {s.uplink_channel: s.downlink_channel for s in radio.stations}
        channels = sorted({antenna.downlink_channel for antenna in radio.stations})
        downlink = self.leg(self._on_downlink, self._p.timeout_s, then=self.inputs)
        self._state = self.state_port(downlink, len(radio.trains))
        self._station_ports = [
            downlink.port(WRS_TX, BlockReader().decoder(), site=antenna.site, zone=antenna.zone)
            for antenna in radio.stations
        ]
        self._station_out = {
            (index, antenna.uplink_channel): self.stream_out(
                WRS_RX, site=antenna.site, zone=antenna.zone
            )
            for index, antenna in enumerate(radio.stations)
        }
        self._train_ports = [
            self.inputs.port(VRS_TX, BlockReader().decoder(), train=train) for train in radio.trains
        ]
        self._train_out = {
            (index, channel): self.stream_out(VRS_RX, train=train, channel=channel)
            for index, train in enumerate(radio.trains)
            for channel in channels
        }
        self._links = self.table_out(LINKS, radio.trains)
        self._silence = {
            channel: RepeatedBlock(silence(0, radio.sample_rate_hz, carrier_hz, channel))
            for channel, carrier_hz in radio.carriers_hz.items()
        }

    def _on_downlink(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Deliver to every train what the stations send."""
        self._paths = self._medium.paths(antennas_of(items[self._state]))
        blocks = {
            index: block.row
            for index, block in enumerate(map(items.get, self._station_ports))
            if block is not None and not block.silent
        }
        tick, time_s = stamp_ns // self._tick_ns, stamp_ns * 1e-9
        self._received = self._medium.downlink(tick, time_s, self._paths, blocks)
        silence = self._silence_at(stamp_ns)
        for port, publish in self._train_out.items():
            if port in self._received:
                publish(self._block(stamp_ns, port[1], self._received[port]))
            else:
                publish(silence[port[1]])

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Deliver to every station what the trains return; the second leg."""
        blocks = {
            index: (block.channel, block.row)
            for index, block in enumerate(map(items.get, self._train_ports))
            if block is not None and not block.silent
        }
        tick, time_s = stamp_ns // self._tick_ns, stamp_ns * 1e-9
        received = self._medium.uplink(tick, time_s, self._paths, blocks)
        silence = self._silence_at(stamp_ns)
        for port, publish in self._station_out.items():
            if port in received:
                publish(self._block(stamp_ns, port[1], received[port]))
            else:
                publish(silence[port[1]])
        self._links(stamp_ns, self._links_of(blocks, received))

    def _links_of(
        self,
        blocks: dict[int, tuple[int, Any]],
        received: dict[tuple[int, int], Reception],
    ) -> Any:
        """True carrier-to-noise ratios of the link each train is ranged on."""
        links = np.zeros((len(self._trains), len(LINKS.columns)))
        for train, (uplink, _) in blocks.items():
            downlink = self._downlink_of.get(uplink, 0)
            links[train, 2:] = downlink, uplink
            down = self._received.get((train, downlink))
            if down is None:
                continue
            links[train, 0] = down.snr
            up = received.get((down.source[0], uplink))
            if up is not None and up.source[1] == train:
                links[train, 1] = up.snr
        return links

    def _silence_at(self, stamp_ns: int) -> dict[int, WaveformView]:
        """Silent block of the tick on each channel."""
        return {channel: block.at(stamp_ns) for channel, block in self._silence.items()}

    def _block(self, stamp_ns: int, channel: int, reception: Reception) -> Waveform:
        rate_hz, carrier_hz = self._radio.sample_rate_hz, self._radio.carriers_hz[channel]
        samples = reception.samples[None, :].astype(np.complex128)
        return Waveform(stamp_ns, rate_hz, carrier_hz, channel, samples)


def antennas_of(state: Any) -> TrainAntennas:
    """Train antennas from the table of the truth [train, column]; trains off the line are far."""
    heading = state[:, 4]
    direction = np.stack((np.cos(heading), np.sin(heading), np.zeros_like(heading)), axis=1)
    position = state[:, 1:4].copy()
    position[state[:, 9] == 0.0] = 1e9
    return TrainAntennas(position, direction * state[:, 5:6], heading)


if __name__ == "__main__":
    RadioMediumNode.main()
