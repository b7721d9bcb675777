"""The medium of the train radio as a node: takes what antennas send, delivers what they receive.

Topics in: ``/world/state``, every base station's ``downlink``, every train's ``uplink``. Topics
out: every train's ``downlink``, every base station's ``uplink``, ``~/links``, ``~/done``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.decoders import waveform
from rail_msgs_py.parameters import parameter
from rail_msgs_py.topics.train_radio import (
    CBTC_BASE_RX,
    CBTC_BASE_TX,
    CBTC_LINKS,
    CBTC_TRAIN_RX,
    CBTC_TRAIN_TX,
)
from rail_msgs_py.waveform import RepeatedBlock, Waveform, silence
from rail_signals.train_radio.slots import used_slots
from rail_world.medium_node import MediumNode, MediumParameters

from .description import CbtcDescription
from .medium import Burst, CbtcMedium, Links


@dataclass(frozen=True)
class CbtcMediumParameters(MediumParameters):
    """Parameters of the medium."""

    burst_samples: int = parameter(1, "samples of a slot", low=1, high=1_000_000)


class CbtcMediumNode(MediumNode[CbtcMediumParameters], name="cbtc_medium", namespace="/world"):
    """The medium of the train radio as a node."""

    def setup(self) -> None:
        """Open the ports of all base stations and trains."""
        self._radio = radio = self.part("train_radio", CbtcDescription)
        self._tick_ns = self._world.tick_ns
        self._medium = CbtcMedium(radio, self._world.seed, self._world.tick_s)
        bases = [base.name for base in radio.base_stations]
        self._base_ports = [self.inputs.port(CBTC_BASE_TX, waveform, base=base) for base in bases]
        self._train_ports = [
            self.inputs.port(CBTC_TRAIN_TX, waveform, train=train) for train in radio.trains
        ]
        self._state = self.state_port(self.inputs, len(radio.trains))
        self._base_out = [self.stream_out(CBTC_BASE_RX, base=base) for base in bases]
        self._train_out = {
            (index, channel): self.stream_out(CBTC_TRAIN_RX, train=train, channel=channel)
            for index, train in enumerate(radio.trains)
            for channel in radio.downlink_hz
        }
        self._windows = {
            (train, channel): (self._span(0), self._span(1 + train))
            for train, channel in self._train_out
        }
        self._links = self.table_out(CBTC_LINKS, radio.trains)
        self._silence_down = self._silences(radio.downlink_hz)
        self._silence_up = self._silences(radio.uplink_hz)

    def _silences(self, carriers_hz: Mapping[int, float]) -> dict[int, RepeatedBlock]:
        return {
            channel: RepeatedBlock(silence(0, self._radio.sample_rate_hz, carrier_hz, channel))
            for channel, carrier_hz in carriers_hz.items()
        }

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Deliver both ways what arrives of the bursts of a tick."""
        links = self._medium.links(stamp_ns // self._tick_ns, stamp_ns * 1e-9, items[self._state])
        bases = {
            index: items[port].samples
            for index, port in enumerate(self._base_ports)
            if port in items and not items[port].silent
        }
        trains = {
            index: (items[port].channel, items[port].samples)
            for index, port in enumerate(self._train_ports)
            if port in items and not items[port].silent
        }
        self._deliver_down(stamp_ns, links, bases)
        self._deliver_up(stamp_ns, links, trains)
        self._publish_links(stamp_ns, links)

    def _span(self, slot: int) -> tuple[int, int]:
        return slot * self._p.burst_samples, (slot + 1) * self._p.burst_samples

    def _deliver_down(
        self, stamp_ns: int, links: Links, blocks: Mapping[int, NDArray[np.complex128]]
    ) -> None:
        length = self._p.burst_samples
        sent = {}
        for base, block in blocks.items():
            spans = map(self._span, used_slots(block, length))
            antennas = self._radio.base_antennas
            sent[base] = [_burst(first, block[:, first:end], antennas) for first, end in spans]
        received = self._medium.downlink(links, sent, self._windows)
        for key, publish in self._train_out.items():
            channel = key[1]
            if key not in received:
                publish(self._silence_down[channel].at(stamp_ns))
                continue
            samples = np.concatenate([burst.samples for burst in received[key]], axis=1)
            carrier_hz = self._radio.downlink_hz[channel]
            publish(self._block(stamp_ns, carrier_hz, channel, samples))

    def _deliver_up(
        self,
        stamp_ns: int,
        links: Links,
        blocks: Mapping[int, tuple[int, NDArray[np.complex128]]],
    ) -> None:
        antennas = self._radio.train_antennas
        sent = {
            train: (channel, [_burst(self._span(1 + train)[0], samples, antennas)])
            for train, (channel, samples) in blocks.items()
        }
        windows = {}
        for index, base in enumerate(self._radio.base_stations):
            near = [
                train
                for train, (channel, _) in sent.items()
                if channel == base.channel and links.in_coverage[index, train]
            ]
            if near:
                windows[index] = [self._span(1 + train) for train in near]
        received = self._medium.uplink(links, sent, windows)
        slots = 1 + len(self._radio.trains)
        for index, publish in enumerate(self._base_out):
            channel = self._radio.base_stations[index].channel
            if index not in received:
                publish(self._silence_up[channel].at(stamp_ns))
                continue
            antennas = received[index][0].samples.shape[0]
            samples = np.zeros((antennas, slots * self._p.burst_samples), dtype=np.complex128)
            for burst in received[index]:
                samples[:, burst.start : burst.stop] = burst.samples
            publish(self._block(stamp_ns, self._radio.uplink_hz[channel], channel, samples))

    def _block(self, stamp_ns: int, carrier_hz: float, channel: int, samples: Any) -> Waveform:
        rate_hz = self._radio.sample_rate_hz
        return Waveform(stamp_ns, rate_hz, carrier_hz, channel, samples)

    def _publish_links(self, stamp_ns: int, links: Links) -> None:
        down, up = self._medium.snr(links), self._medium.snr(links, uplink=True)
        best = np.argmax(down, axis=0)
        trains = np.arange(down.shape[1])
        table = np.stack([best.astype(np.float64), down[best, trains], up[best, trains]], axis=1)
        self._links(stamp_ns, np.ascontiguousarray(table))


def _burst(start: int, samples: NDArray[np.complex128], antennas: int) -> Burst:
    """A burst from all antennas, of which a sender may leave one unused."""
    if samples.shape[0] < antennas:
        unused = np.zeros((antennas - samples.shape[0], samples.shape[1]))
        samples = np.concatenate([samples, unused])
    return Burst(start, samples)


if __name__ == "__main__":
    CbtcMediumNode.main()
