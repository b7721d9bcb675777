"""The radio medium as a node: takes what every antenna sends, delivers what every one hears.

Within one tick it is passed twice: stations to trains, then trains to stations.
Topics in: ``/world/state``, every ``tx``. Topics out: every ``rx``, ``~/links``, ``~/done``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from rail_msgs_py.failures import FailureWatch
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.parameters import declare, parameter
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter, figures_from_cdr
from rail_msgs_py.topics.ranging import LINKS, VRS_RX, VRS_TX, WRS_RX, WRS_TX
from rail_msgs_py.topics.tick import DONE
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.waveform import BlockReader, RepeatedBlock, Waveform, silence
from rail_world.media import read_part

from .description import RadioDescription
from .medium import Paths, RadioMedium, Reception, TrainAntennas

WATCH_PERIOD_S = 0.1
_STATE_PORT = "state"


@dataclass(frozen=True)
class RadioMediumParameters:
    """Parameters of the radio medium."""

    world_file: str = parameter("", "JSON file with tracks, trains and media")
    timeout_s: float = parameter(
        2.0, "wall time after which a block is given up", unit="s", low=0.05, high=3600.0
    )


class RadioMediumNode(CorridorNode):
    """The radio medium as a node."""

    def __init__(
        self,
        *,
        namespace: str = "/world",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(
            "radio_medium", namespace, context=context, parameters=parameters, services=services
        )
        self._p = declare(self, RadioMediumParameters)
        described, part = read_part(self._p.world_file, "ranging", RadioDescription)
        radio = part
        self._tick_ns = described.tick_ns
        self._radio = radio
        self._medium = RadioMedium(radio, described.seed)
        self._trains = radio.trains
        self._downlink_of = {s.uplink_channel: s.downlink_channel for s in radio.stations}
        channels = sorted({antenna.downlink_channel for antenna in radio.stations})
        owners = {_STATE_PORT: "/world"}
        self._station_ports: list[str] = []
        self._station_out: list[Callable[[bytes], None]] = []
        for antenna in radio.stations:
            parts = {"site": antenna.site, "zone": antenna.zone}
            port = WRS_TX.name(**parts)
            owners[port] = f"/wayside/{antenna.site}"
            self._station_ports.append(port)
            self._station_out.append(self.stream_out(WRS_RX, **parts))
            self.stream_in(WRS_TX, lambda raw, port=port: self._put(self._down, port, raw), **parts)
        self._train_ports: list[str] = []
        self._train_out: dict[tuple[int, int], Callable[[bytes], None]] = {}
        for index, train in enumerate(radio.trains):
            port = VRS_TX.name(train=train)
            owners[port] = f"/{train}/vrs"
            self._train_ports.append(port)
            self.stream_in(
                VRS_TX, lambda raw, port=port: self._put(self._up, port, raw), train=train
            )
            for channel in channels:
                self._train_out[index, channel] = self.stream_out(
                    VRS_RX, train=train, channel=channel
                )
        self._down: TickInbox[Any] = TickInbox([_STATE_PORT, *self._station_ports])
        self._up: TickInbox[Any] = TickInbox([_STATE_PORT, *self._train_ports])
        self._watch = FailureWatch(self, owners, self._drop)
        self.stream_in(STATE, self._on_state)
        self._links_table = TableWriter(radio.trains, LINKS.columns)
        self._links = self.publisher(LINKS).publish
        self._done = self.stream_out(DONE, node=self.get_fully_qualified_name())
        self._silence = {
            channel: RepeatedBlock(silence(0, radio.sample_rate_hz, carrier_hz, channel))
            for channel, carrier_hz in radio.carriers_hz.items()
        }
        self._readers = {port: BlockReader() for port in owners if port != _STATE_PORT}
        self._paths: Paths | None = None
        self._heard: dict[tuple[int, int], Reception] = {}
        self._stage_begun_s = float("inf")
        self.every(WATCH_PERIOD_S, self._check)
        self.announce_when_connected()

    def _put(self, inbox: TickInbox[Any], port: str, raw: bytes) -> None:
        stamp_ns, block = self._readers[port].read(raw)
        inbox.put(stamp_ns, port, block)
        self._advance()

    def _on_state(self, raw: bytes) -> None:
        stamp_ns, state = figures_from_cdr(raw, len(self._trains), len(STATE.columns))
        self._down.put(stamp_ns, _STATE_PORT, state)
        self._stage_begun_s = self.steady_s()
        self._advance()

    def _advance(self) -> None:
        if self._paths is None and self._down.complete:
            self._deliver_downlink(*self._down.take())
        if self._paths is not None and self._up.complete:
            self._deliver_uplink(*self._up.take())

    def _deliver_downlink(self, stamp_ns: int, items: dict[str, Any]) -> None:
        state = items.get(_STATE_PORT)
        if state is None:
            return
        self._paths = self._medium.paths(antennas_of(state))
        blocks = {
            index: items[port].row
            for index, port in enumerate(self._station_ports)
            if port in items and not items[port].silent
        }
        tick, time_s = stamp_ns // self._tick_ns, stamp_ns * 1e-9
        self._heard = self._medium.downlink(tick, time_s, self._paths, blocks)
        self._stage_begun_s = self.steady_s()
        for port, publish in self._train_out.items():
            publish(self._block(stamp_ns, port[1], self._heard.get(port)))
        # Ends the tick by itself where no train is left to answer.
        self._up.put(stamp_ns, _STATE_PORT, None)

    def _deliver_uplink(self, stamp_ns: int, items: dict[str, Any]) -> None:
        assert self._paths is not None
        blocks = {
            index: (items[port].channel, items[port].row)
            for index, port in enumerate(self._train_ports)
            if port in items and not items[port].silent
        }
        tick, time_s = stamp_ns // self._tick_ns, stamp_ns * 1e-9
        heard = self._medium.uplink(tick, time_s, self._paths, blocks)
        links = self._links_of(blocks, heard)
        self._paths = None
        self._stage_begun_s = float("inf")
        for index, publish in enumerate(self._station_out):
            channel = self._radio.stations[index].uplink_channel
            publish(self._block(stamp_ns, channel, heard.get((index, channel))))
        self._links(self._links_table.write(stamp_ns, links))
        self._done(header_to_cdr(stamp_ns))

    def _links_of(
        self,
        blocks: dict[int, tuple[int, Any]],
        heard: dict[tuple[int, int], Reception],
    ) -> Any:
        """True carrier-to-noise ratios of the link each train is ranged on."""
        links = np.zeros((len(self._trains), len(LINKS.columns)))
        for train, (uplink, _) in blocks.items():
            downlink = self._downlink_of.get(uplink, 0)
            links[train, 2:] = downlink, uplink
            down = self._heard.get((train, downlink))
            if down is None:
                continue
            links[train, 0] = down.snr
            up = heard.get((down.source[0], uplink))
            if up is not None and up.source[1] == train:
                links[train, 1] = up.snr
        return links

    def _block(self, stamp_ns: int, channel: int, reception: Reception | None) -> bytes:
        if reception is None:
            return self._silence[channel].at(stamp_ns)
        rate_hz, carrier_hz = self._radio.sample_rate_hz, self._radio.carriers_hz[channel]
        samples = reception.samples[None, :]
        return Waveform(stamp_ns, rate_hz, carrier_hz, channel, samples).to_cdr()

    def _check(self) -> None:
        waited_s = self.steady_s() - self._stage_begun_s
        if waited_s > self._p.timeout_s:
            waiting = self._down if self._paths is None else self._up
            self._watch.give_up(waiting.missing, self._p.timeout_s, waiting.latest_ns)

    def _drop(self, ports: tuple[str, ...]) -> None:
        for inbox in (self._down, self._up):
            inbox.drop(port for port in ports if port != _STATE_PORT)
        self._advance()


def antennas_of(state: Any) -> TrainAntennas:
    """Train antennas from the table of the truth [train, column]; trains off the line are far."""
    heading = state[:, 4]
    direction = np.stack((np.cos(heading), np.sin(heading), np.zeros_like(heading)), axis=1)
    position = state[:, 1:4].copy()
    position[state[:, 9] == 0.0] = 1e9
    return TrainAntennas(position, direction * state[:, 5:6], heading)


def main() -> None:
    """Run the radio medium on its own."""
    run_node(RadioMediumNode)


if __name__ == "__main__":
    main()
