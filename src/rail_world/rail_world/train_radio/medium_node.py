"""The medium of the train radio as a node: takes what every antenna sends, delivers what it hears.

Topics in: ``/world/state``, every base station's ``downlink``, every train's ``uplink``. Topics
out: every train's ``downlink``, every base station's ``uplink``, ``~/links``, ``~/done``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.parameters import declare, parameter
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter, figures_from_cdr
from rail_msgs_py.topics.tick import DONE
from rail_msgs_py.topics.train_radio import (
    CBTC_BASE_RX,
    CBTC_BASE_TX,
    CBTC_LINKS,
    CBTC_TRAIN_RX,
    CBTC_TRAIN_TX,
)
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.waveform import RepeatedBlock, Waveform, silence
from rail_world.media import read_part

from .description import CbtcDescription
from .medium import Burst, CbtcMedium, Links

_STATE_PORT = "state"


@dataclass(frozen=True)
class CbtcMediumParameters:
    """Parameters of the medium."""

    world_file: str = parameter("", "JSON file with tracks, trains and media")
    burst_samples: int = parameter(1, "samples of a slot", low=1, high=1_000_000)
    timeout_s: float = parameter(
        2.0, "wall time after which a block is given up", unit="s", low=0.05, high=3600.0
    )


class CbtcMediumNode(CorridorNode):
    """The medium of the train radio as a node."""

    def __init__(
        self,
        *,
        namespace: str = "/world",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(
            "cbtc_medium", namespace, context=context, parameters=parameters, services=services
        )
        self._p = declare(self, CbtcMediumParameters)
        described, part = read_part(self._p.world_file, "train_radio", CbtcDescription)
        self._radio = radio = part
        self._tick_ns = described.tick_ns
        self._medium = CbtcMedium(radio, described.seed, described.tick_s)
        owners: dict[str, str] = {}
        self._base_ports = [CBTC_BASE_TX.name(base=b.name) for b in radio.base_stations]
        self._train_ports = [CBTC_TRAIN_TX.name(train=name) for name in radio.trains]
        self._base_out: list[Callable[[bytes], None]] = []
        for base, port in zip(radio.base_stations, self._base_ports, strict=True):
            owners[port] = CBTC_BASE_TX.owner(base=base.name)
            self._base_out.append(self.stream_out(CBTC_BASE_RX, base=base.name))
            self.stream_in(
                CBTC_BASE_TX, lambda raw, port=port: self._put(port, raw), base=base.name
            )
        self._train_out: dict[tuple[int, int], Callable[[bytes], None]] = {}
        for index, (train, port) in enumerate(zip(radio.trains, self._train_ports, strict=True)):
            owners[port] = CBTC_TRAIN_TX.owner(train=train)
            self.stream_in(CBTC_TRAIN_TX, lambda raw, port=port: self._put(port, raw), train=train)
            for channel in radio.downlink_hz:
                self._train_out[index, channel] = self.stream_out(
                    CBTC_TRAIN_RX, train=train, channel=channel
                )
        self._inbox: TickInbox[Any] = TickInbox([_STATE_PORT, *owners])
        self._watch = TickWatch(self, self._inbox, owners, self._p.timeout_s, self._advance)
        self.stream_in(STATE, self._on_state)
        self._links = self.publisher(CBTC_LINKS).publish
        self._links_table = TableWriter(radio.trains, CBTC_LINKS.columns)
        self._done = self.stream_out(DONE, node=self.get_fully_qualified_name())
        rate_hz = radio.sample_rate_hz
        self._silence_down = {
            channel: RepeatedBlock(silence(0, rate_hz, carrier_hz, channel))
            for channel, carrier_hz in radio.downlink_hz.items()
        }
        self._silence_up = {
            channel: RepeatedBlock(silence(0, rate_hz, carrier_hz, channel))
            for channel, carrier_hz in radio.uplink_hz.items()
        }
        self.announce_when_connected()

    def _on_state(self, raw: bytes) -> None:
        trains = len(self._radio.trains)
        stamp_ns, state = figures_from_cdr(raw, trains, len(STATE.columns))
        self._inbox.put(stamp_ns, _STATE_PORT, state)
        self._watch.begin()
        self._advance()

    def _put(self, port: str, raw: bytes) -> None:
        block = Waveform.from_cdr(raw)
        self._inbox.put(block.stamp_ns, port, block)
        self._advance()

    def _advance(self) -> None:
        while self._inbox.complete:
            self._deliver(*self._inbox.take())

    def _deliver(self, stamp_ns: int, items: dict[str, Any]) -> None:
        self._watch.end()
        state = items.get(_STATE_PORT)
        if state is None:
            return
        links = self._medium.links(stamp_ns // self._tick_ns, stamp_ns * 1e-9, state)
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
        self._done(header_to_cdr(stamp_ns))

    def _span(self, slot: int) -> tuple[int, int]:
        return slot * self._p.burst_samples, (slot + 1) * self._p.burst_samples

    def _deliver_down(
        self, stamp_ns: int, links: Links, blocks: Mapping[int, NDArray[np.complex128]]
    ) -> None:
        length = self._p.burst_samples
        sent = {}
        for base, block in blocks.items():
            slots = range(block.shape[1] // length)
            parts = [(first, block[:, first:end]) for first, end in map(self._span, slots)]
            antennas = self._radio.base_antennas
            sent[base] = [_burst(first, part, antennas) for first, part in parts if part.any()]
        windows = {
            (train, channel): (self._span(0), self._span(1 + train))
            for train, channel in self._train_out
        }
        heard = self._medium.downlink(links, sent, windows)
        for key, publish in self._train_out.items():
            channel = key[1]
            if key not in heard:
                publish(self._silence_down[channel].at(stamp_ns))
                continue
            samples = np.concatenate([burst.samples for burst in heard[key]], axis=1)
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
                if channel == base.channel and links.in_reach[index, train]
            ]
            if near:
                windows[index] = [self._span(1 + train) for train in near]
        heard = self._medium.uplink(links, sent, windows)
        slots = 1 + len(self._radio.trains)
        for index, publish in enumerate(self._base_out):
            channel = self._radio.base_stations[index].channel
            if index not in heard:
                publish(self._silence_up[channel].at(stamp_ns))
                continue
            antennas = heard[index][0].samples.shape[0]
            samples = np.zeros((antennas, slots * self._p.burst_samples), dtype=np.complex128)
            for burst in heard[index]:
                samples[:, burst.start : burst.stop] = burst.samples
            publish(self._block(stamp_ns, self._radio.uplink_hz[channel], channel, samples))

    def _block(self, stamp_ns: int, carrier_hz: float, channel: int, samples: Any) -> bytes:
        rate_hz = self._radio.sample_rate_hz
        return Waveform(stamp_ns, rate_hz, carrier_hz, channel, samples).to_cdr()

    def _publish_links(self, stamp_ns: int, links: Links) -> None:
        down, up = self._medium.snr(links), self._medium.snr(links, uplink=True)
        best = np.argmax(down, axis=0)
        trains = np.arange(down.shape[1])
        table = np.stack([best.astype(np.float64), down[best, trains], up[best, trains]], axis=1)
        self._links(self._links_table.write(stamp_ns, np.ascontiguousarray(table)))


def _burst(start: int, samples: NDArray[np.complex128], antennas: int) -> Burst:
    """A burst from all antennas, of which a sender may leave one unused."""
    if samples.shape[0] < antennas:
        unused = np.zeros((antennas - samples.shape[0], samples.shape[1]))
        samples = np.concatenate([samples, unused])
    return Burst(start, samples)


def main() -> None:
    """Run the medium on its own."""
    run_node(CbtcMediumNode)


if __name__ == "__main__":
    main()
