"""Vehicle station: hears every downlink channel, returns the tone on the pair in force.

Topics in: ``channel_<n>/rx`` for every downlink channel. Topics out: ``tx``, ``channel``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray

from rail_msgs_py.inbox import TickInbox
from rail_msgs_py.node import Equipment
from rail_msgs_py.parameters import ParameterError, declare, parameter
from rail_msgs_py.ranging.signal_parameters import SignalParameters, signal_of
from rail_msgs_py.standalone import run_node
from rail_msgs_py.table import TableWriter
from rail_msgs_py.topics.ranging import VRS_CHANNEL, VRS_RX, VRS_TX
from rail_msgs_py.waveform import Waveform, silence, silent_stamp_ns
from rail_signals.ranging.receiver import LineReceiver, ToneEstimate
from rail_signals.ranging.signal import modulate
from rail_signals.ranging.transponder import reply_lag_rad

from .channel_selector import ChannelSelector
from .downlink_check import DownlinkCheck


@dataclass(frozen=True)
class VrsParameters(SignalParameters):
    """Parameters of a vehicle station."""

    downlink_channels: tuple[int, ...] = parameter((1, 3), "channels it hears", low=1)
    uplink_channels: tuple[int, ...] = parameter((2, 4), "the channel paired with each", low=1)
    uplink_carriers_hz: tuple[float, ...] = parameter(
        (2.405e9, 2.415e9), "carrier of each uplink channel", unit="Hz", low=0.0
    )
    power_dbm: float = parameter(-10.0, "transmit power", unit="dBm", low=-100.0, high=60.0)
    transponder_delay_s: float = parameter(
        1e-6, "delay of this unit from reception to transmission", unit="s", low=0.0, high=1e-3
    )
    delay_trim_s: float = parameter(
        0.0, "added on the bench to bring it to that of the fleet", unit="s", low=-1e-3, high=1e-3
    )
    noise_dbm: float = parameter(
        -100.0, "receiver noise expected in the bandwidth", unit="dBm", low=-150.0, high=0.0
    )


class VrsNode(Equipment):
    """Vehicle station as a managed node."""

    def __init__(
        self,
        name: str = "vrs",
        *,
        namespace: str = "/train_1",
        context: Any = None,
        parameters: Mapping[str, Any] | None = None,
        services: bool = True,
    ) -> None:
        super().__init__(name, namespace, context=context, parameters=parameters, services=services)
        self._p = declare(self, VrsParameters)
        channels = self._p.downlink_channels
        if not len(channels) == len(self._p.uplink_channels) == len(self._p.uplink_carriers_hz):
            raise ParameterError(
                f"{self.get_name()}: uplink_channels: {self._p.uplink_channels}: every downlink "
                "channel needs one uplink channel and its carrier"
            )
        self._signal = signal_of(self._p)
        self._receiver = LineReceiver(self._signal)
        self._check = DownlinkCheck(10.0 ** (self._p.noise_dbm / 10.0), self._signal.samples)
        self._selector = ChannelSelector(dict(zip(channels, self._p.uplink_channels, strict=True)))
        self._carriers_hz = dict(
            zip(self._p.uplink_channels, self._p.uplink_carriers_hz, strict=True)
        )
        self._amplitude = 10.0 ** (self._p.power_dbm / 20.0)
        self._delay_s = self._p.transponder_delay_s + self._p.delay_trim_s
        train = namespace.strip("/")
        self._inbox: TickInbox[NDArray[np.complex128] | None] = TickInbox(
            str(channel) for channel in channels
        )
        for channel in channels:
            self.stream_in(
                VRS_RX,
                lambda raw, channel=channel: self._receive(channel, raw),
                train=train,
                channel=channel,
            )
        self._send = self.stream_out(VRS_TX, train=train)
        self._channel = self.publisher(VRS_CHANNEL, train=train).publish
        columns = ("downlink", "uplink", *(f"level_{channel}_dbm" for channel in channels))
        self._channel_table = TableWriter((train,), columns)
        self._figures = np.zeros((1, len(columns)))
        self.announce_when_connected()

    def _receive(self, channel: int, raw: bytes) -> None:
        stamp_ns = silent_stamp_ns(raw)
        if stamp_ns is not None:
            self._inbox.put(stamp_ns, str(channel), None)
        else:
            block = Waveform.from_cdr(raw)
            self._inbox.put(block.stamp_ns, str(channel), block.samples[0])
        if self._inbox.complete:
            stamp_ns, bursts = self._inbox.take()
            heard = {int(port): burst for port, burst in bursts.items() if burst is not None}
            self._answer(stamp_ns, dict(sorted(heard.items())))

    def _answer(self, stamp_ns: int, bursts: dict[int, NDArray[np.complex128]]) -> None:
        levels: dict[int, float] = {}
        rows = {channel: row for row, channel in enumerate(bursts)}
        estimates: ToneEstimate | None = None
        if self.switched_on and bursts:
            estimates = self._receiver.estimate(np.array(list(bursts.values())))
            amplitude = estimates.amplitude.tolist()
            levels = {
                channel: 20.0 * math.log10(amplitude[row])
                for channel, row in rows.items()
                if amplitude[row] > 0.0
            }
        downlink = self._selector.update(levels)
        disturbance = "cannot read the tone" if bursts else "hears no station"
        if estimates is not None and downlink in levels:
            row = rows[downlink]
            disturbance = self._check.disturbance(
                amplitude=float(estimates.amplitude[row]),
                snr=float(estimates.snr[row]),
                misfit=float(estimates.misfit[row]),
            )
        if estimates is None or disturbance:
            self._send(self._silence(stamp_ns))
        else:
            self._send(self._reply(stamp_ns, estimates, rows[downlink]))
        self._publish_channel(stamp_ns, levels)
        self._report(stamp_ns, disturbance)

    def _reply(self, stamp_ns: int, estimates: ToneEstimate, row: int) -> bytes:
        uplink = self._selector.uplink
        assert uplink is not None
        lag_rad = reply_lag_rad(estimates.phase_lag_rad[row], self._signal, self._delay_s)
        samples = modulate(self._signal, lag_rad) * self._amplitude
        radio = (self._signal.sample_rate_hz, self._carriers_hz[uplink], uplink)
        return Waveform(stamp_ns, *radio, samples[None, :]).to_cdr()

    def _silence(self, stamp_ns: int) -> bytes:
        uplink = self._selector.uplink or self._p.uplink_channels[0]
        radio = (self._signal.sample_rate_hz, self._carriers_hz[uplink], uplink)
        return silence(stamp_ns, *radio).to_cdr()

    def _publish_channel(self, stamp_ns: int, levels: Mapping[int, float]) -> None:
        self._figures[0, 0] = self._selector.downlink or 0
        self._figures[0, 1] = self._selector.uplink or 0
        for column, channel in enumerate(self._p.downlink_channels, start=2):
            self._figures[0, column] = levels.get(channel, -np.inf)
        self._channel(self._channel_table.write(stamp_ns, self._figures))

    def _report(self, stamp_ns: int, disturbance: str) -> None:
        if not disturbance or not self.switched_on:
            self.report(DiagnosticStatus.OK, "ranging", "answering", stamp_ns=stamp_ns)
            return
        on = f" on CH{self._selector.downlink}" if self._selector.downlink else ""
        message = disturbance if disturbance == "hears no station" else f"{disturbance}{on}"
        self.report(DiagnosticStatus.WARN, "ranging", message, stamp_ns=stamp_ns)


def main() -> None:
    """Run a vehicle station on its own."""
    run_node(VrsNode)


if __name__ == "__main__":
    main()
