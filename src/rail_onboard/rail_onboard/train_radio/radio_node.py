"""Train radio: frames to bursts for the base station, and bursts to frames.

Topics in: ``/clock``, ``/<train>/atp/telegrams``, ``channel_<n>/downlink`` for every channel.
Topics out: ``uplink``, ``telegrams``, ``link``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray

from rail_msgs_py.failures import TickWatch
from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import Equipment
from rail_msgs_py.parameters import ParameterError, declare, parameter
from rail_msgs_py.stamps import NANOSECONDS, clock_from_cdr
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.topics.train_radio import (
    CBTC_TRAIN_RX,
    CBTC_TRAIN_TX,
    RADIO_LINK,
    RADIO_TELEGRAMS,
    TRAIN_TELEGRAMS,
)
from rail_msgs_py.train_radio.parameters import TrainRadioParameters, slots_of
from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams
from rail_msgs_py.waveform import Waveform, silence, silent_stamp_ns
from rail_signals.train_radio.burst import RadioBurstReceiver
from rail_signals.train_radio.slots import frame_of

from .base_selector import BaseSelector

_CLOCK_PORT, _TELEGRAMS_PORT = "clock", "telegrams"


@dataclass(frozen=True)
class CbtcRadioParameters(TrainRadioParameters):
    """Parameters of a train radio."""

    slot: int = parameter(1, "slot of the train", low=1, high=1000)
    downlink_channels: tuple[int, ...] = parameter((1, 2), "channels it hears", low=1)
    uplink_carriers_hz: tuple[float, ...] = parameter(
        (2.45e9, 2.455e9), "carrier of the uplink paired with each", unit="Hz", low=0.0
    )
    power_dbm: float = parameter(
        20.0, "transmit power of all antennas together", unit="dBm", low=-100.0, high=60.0
    )
    tick_s: float = parameter(0.25, "time of a tick", unit="s", low=0.01, high=1.0)
    timeout_s: float = parameter(
        2.0, "wall time after which the telegrams are given up", unit="s", low=0.05, high=3600.0
    )


class CbtcRadioNode(Equipment):
    """A train radio as a managed node; switched off it neither sends nor hears."""

    def __init__(
        self,
        name: str = "cbtc_radio",
        *,
        namespace: str = "/train_1",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(name, namespace, context=context, parameters=parameters, services=services)
        self._p = p = declare(self, CbtcRadioParameters)
        if len(p.downlink_channels) != len(p.uplink_carriers_hz):
            raise ParameterError(
                f"{name}: uplink_carriers_hz: {p.uplink_carriers_hz}: one for each of"
                f" {len(p.downlink_channels)} channels"
            )
        self._slots = slots_of(p)
        self._receiver = RadioBurstReceiver(self._slots.burst)
        self._amplitude = 10.0 ** (p.power_dbm / 20.0) * p.samples_per_symbol**0.5
        self._carriers_hz = dict(zip(p.downlink_channels, p.uplink_carriers_hz, strict=True))
        self._selector = BaseSelector()
        self._tick_ns = round(p.tick_s * NANOSECONDS)
        train = namespace.strip("/")
        self._orders: TickInbox[Telegrams | None] = TickInbox([_CLOCK_PORT, _TELEGRAMS_PORT])
        self._orders.put(0, _TELEGRAMS_PORT, None)
        owners = {_TELEGRAMS_PORT: f"/{train}/atp"}
        self._watch = TickWatch(self, self._orders, owners, p.timeout_s, self._advance)
        self._inbox: TickInbox[NDArray[np.complex128] | None] = TickInbox(
            str(channel) for channel in p.downlink_channels
        )
        for channel in p.downlink_channels:
            self.stream_in(
                CBTC_TRAIN_RX,
                lambda raw, channel=channel: self._on_block(channel, raw),
                train=train,
                channel=channel,
            )
        self._send = self.stream_out(CBTC_TRAIN_TX, train=train)
        self._tell = self.stream_out(RADIO_TELEGRAMS, train=train)
        self._link = self.publisher(RADIO_LINK, train=train).publish
        self._table = TableWriter((train,), RADIO_LINK.columns)
        self._figures = np.zeros((1, len(RADIO_LINK.columns)))
        self.stream_in(TRAIN_TELEGRAMS, self._on_telegrams, train=train)
        self.stream_in(CLOCK, self._on_clock)
        self.announce_when_connected()

    # Up -----------------------------------------------------------------------------------

    def _on_clock(self, raw: bytes) -> None:
        self._orders.put(clock_from_cdr(raw), _CLOCK_PORT, None)
        self._watch.begin()
        self._advance()

    def _on_telegrams(self, raw: bytes) -> None:
        heard = Telegrams.from_cdr(raw)
        self._orders.put(heard.stamp_ns + self._tick_ns, _TELEGRAMS_PORT, heard)
        self._advance()

    def _advance(self) -> None:
        while self._orders.complete:
            self._watch.end()
            self._transmit(*self._orders.take())

    def _transmit(self, stamp_ns: int, items: dict[str, Telegrams | None]) -> None:
        channel = self._selector.channel
        ordered = items.get(_TELEGRAMS_PORT)
        rate_hz = self._slots.burst.sample_rate_hz
        if not (self.switched_on and channel and ordered and ordered.frames):
            number = channel or self._p.downlink_channels[0]
            block = silence(stamp_ns, rate_hz, self._carriers_hz[number], number)
        else:
            burst = self._slots.bursts([ordered.frames[0][1]])[0] * self._amplitude
            block = Waveform(stamp_ns, rate_hz, self._carriers_hz[channel], channel, burst)
        self._send(block.to_cdr())

    # Down ---------------------------------------------------------------------------------

    def _on_block(self, channel: int, raw: bytes) -> None:
        stamp_ns = silent_stamp_ns(raw)
        if stamp_ns is not None:
            self._inbox.put(stamp_ns, str(channel), None)
        else:
            block = Waveform.from_cdr(raw)
            self._inbox.put(block.stamp_ns, str(channel), block.samples)
        while self._inbox.complete:
            self._receive(*self._inbox.take())

    def _receive(self, stamp_ns: int, items: Mapping[str, NDArray[np.complex128] | None]) -> None:
        heard = {int(port): block for port, block in items.items() if block is not None}
        frames: list[tuple[int, bytes]] = []
        beacons: dict[int, float] = {}
        if self.switched_on and heard:
            # Of each channel the beacon and the train's own slot, by the antennas of the scheme.
            antennas = self._slots.burst.scheme.receive
            blocks = [heard[channel][:antennas] for channel in sorted(heard)]
            cut = np.stack([self._slots.cut(block) for block in blocks])
            found = self._receiver.receive(cut, doppler_hz=self._p.doppler_hz)
            for row, channel in enumerate(sorted(heard)):
                if found.detected[row, 0]:
                    beacons[channel] = float(np.mean(found.snr[row, 0]))
                if found.detected[row, 1]:
                    frames.append((self._p.slot, frame_of(found.bits[row, 1])))
        channel = self._selector.update(beacons)
        self._tell(telegrams(stamp_ns, frames))
        self._figures[0] = channel or 0, beacons.get(channel or 0, 0.0), len(frames)
        self._link(self._table.write(stamp_ns, self._figures))
        self.report(
            DiagnosticStatus.OK if beacons else DiagnosticStatus.WARN,
            "radio",
            "hears a base station" if beacons else "hears no base station",
            stamp_ns=stamp_ns,
        )


def main() -> None:
    """Run a train radio on its own."""
    run_node(CbtcRadioNode)


if __name__ == "__main__":
    main()
