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

from rail_msgs_py.decoders import samples
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.ranging import quantities
from rail_msgs_py.ranging.signal_parameters import SignalParameters, signal_of
from rail_msgs_py.table import TableWriter
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.ranging import VRS_CHANNEL, VRS_RX, VRS_TX
from rail_msgs_py.waveform import Waveform, silence
from rail_signals.ranging.receiver import FmToneReceiver, ToneEstimate
from rail_signals.ranging.signal import modulate
from rail_signals.ranging.transponder import reply_lag_rad

from .channel_selector import ChannelSelector
from .downlink_check import DownlinkCheck


@dataclass(frozen=True)
class VrsParameters(SignalParameters):
    """Parameters of a vehicle station."""

    downlink_channels: tuple[int, ...] = quantities.DOWNLINKS.parameter()
    uplink_channels: tuple[int, ...] = quantities.UPLINKS.parameter()
    uplink_carriers_hz: tuple[float, ...] = quantities.UPLINK_CARRIERS.parameter()
    power_dbm: float = quantities.VRS_POWER.parameter()
    transponder_delay_s: float = quantities.UNIT_DELAY.parameter()
    delay_trim_s: float = parameter(
        0.0,
        "added on the calibration rig to bring it to that of the fleet",
        unit="s",
        low=-1e-3,
        high=1e-3,
    )
    noise_dbm: float = quantities.RECEIVER_NOISE.parameter()


class VrsNode(EquipmentNode[VrsParameters], name="vrs", namespace="/train_1"):
    """Vehicle station as a managed node."""

    def setup(self) -> None:
        """Open the ports of all channels."""
        p, train = self._p, self.place
        channels = p.downlink_channels
        if not len(channels) == len(p.uplink_channels) == len(p.uplink_carriers_hz):
            raise ParameterError(
                f"uplink_channels: {p.uplink_channels}: every downlink channel needs one uplink "
                "channel and its carrier"
            )
        self._signal = signal_of(p)
        self._receiver = FmToneReceiver(self._signal)
        self._check = DownlinkCheck(10.0 ** (p.noise_dbm / 10.0), self._signal.samples)
        self._carriers_hz = dict(zip(p.uplink_channels, p.uplink_carriers_hz, strict=True))
        self._amplitude = 10.0 ** (p.power_dbm / 20.0)
        self._delay_s = p.transponder_delay_s + p.delay_trim_s
        self._ports = {
            channel: self.inputs.port(VRS_RX, samples, train=train, channel=channel)
            for channel in sorted(channels)
        }
        self._send = self.stream_out(VRS_TX, train=train)
        self._channel = self.publisher(VRS_CHANNEL, train=train).send
        columns = ("downlink", "uplink", *(f"level_{channel}_dbm" for channel in channels))
        self._channel_table = TableWriter((train,), columns)
        self._values = np.zeros((1, len(columns)))

    def start_over(self) -> None:
        """Have no channel in force."""
        p = self._p
        pairs = zip(p.downlink_channels, p.uplink_channels, strict=True)
        self._selector = ChannelSelector(dict(pairs))

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Answer on the channel in force."""
        bursts = {
            channel: items[port][0]
            for channel, port in self._ports.items()
            if items[port] is not None
        }
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
        reply = None
        if estimates is not None and downlink is not None and downlink in levels:
            row = rows[downlink]
            disturbance = self._check.disturbance(
                amplitude=float(estimates.amplitude[row]),
                snr=float(estimates.snr[row]),
                reduced_chi_square=float(estimates.reduced_chi_square[row]),
            )
            if not disturbance:
                reply = self._reply(stamp_ns, estimates, row)
        self._send(self._silence(stamp_ns) if reply is None else reply)
        self._publish_channel(stamp_ns, levels)
        self._report(stamp_ns, disturbance)

    def _reply(self, stamp_ns: int, estimates: ToneEstimate, row: int) -> Waveform:
        uplink = self._selector.uplink
        assert uplink is not None
        lag_rad = reply_lag_rad(estimates.phase_lag_rad[row], self._signal, self._delay_s)
        burst = modulate(self._signal, lag_rad) * self._amplitude
        radio = (self._signal.sample_rate_hz, self._carriers_hz[uplink], uplink)
        return Waveform(stamp_ns, *radio, burst[None, :])

    def _silence(self, stamp_ns: int) -> Waveform:
        uplink = self._selector.uplink or self._p.uplink_channels[0]
        radio = (self._signal.sample_rate_hz, self._carriers_hz[uplink], uplink)
        return silence(stamp_ns, *radio)

    def _publish_channel(self, stamp_ns: int, levels: Mapping[int, float]) -> None:
        self._values[0, 0] = self._selector.downlink or 0
        self._values[0, 1] = self._selector.uplink or 0
        for column, channel in enumerate(self._p.downlink_channels, start=2):
            self._values[0, column] = levels.get(channel, -np.inf)
        self._channel(self._channel_table.write(stamp_ns, self._values))

    def _report(self, stamp_ns: int, disturbance: str) -> None:
        if not disturbance or not self.switched_on:
            self.report(DiagnosticStatus.OK, "ranging", "answering", stamp_ns=stamp_ns)
            return
        on = f" on CH{self._selector.downlink}" if self._selector.downlink else ""
        message = disturbance if disturbance == "hears no station" else f"{disturbance}{on}"
        self.report(DiagnosticStatus.WARN, "ranging", message, stamp_ns=stamp_ns)


if __name__ == "__main__":
    VrsNode.main()
