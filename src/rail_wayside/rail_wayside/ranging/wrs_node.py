"""Wayside station: sends the tone into its zones, ranges the trains that return it.

Topics, for each of its zones: in ``/clock``, ``<zone>/rx``; out ``<zone>/tx``, ``<zone>/range``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import bare_stamp, samples
from rail_msgs_py.delivery import Send
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.ranging import quantities
from rail_msgs_py.ranging.range_reading import RangeWriter
from rail_msgs_py.ranging.signal_parameters import SignalParameters, signal_of
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.ranging import RANGE, WRS_RX, WRS_TX
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.waveform import RepeatedBlock, Waveform, silence
from rail_signals.arrays import ComplexArray
from rail_signals.ranging.signal import modulate

from .ranging_station import NO_SIGNAL, RangingStation


@dataclass(frozen=True)
class WrsParameters(SignalParameters):
    """Parameters of a wayside station."""

    zones: tuple[str, ...] = parameter(("zone1",), "zones it looks into, an antenna each")
    downlink_channels: tuple[int, ...] = quantities.STATION_DOWNLINKS.parameter()
    uplink_channels: tuple[int, ...] = quantities.STATION_UPLINKS.parameter()
    downlink_carriers_hz: tuple[float, ...] = quantities.STATION_CARRIERS.parameter()
    power_dbm: float = quantities.WRS_POWER.parameter()
    comparator: str = quantities.COMPARATOR.parameter()
    delay_s: float = quantities.TRANSPONDER_DELAY.parameter()
    noise_dbm: float = quantities.RECEIVER_NOISE.parameter()


@dataclass
class _Antenna:
    """One zone's antenna: what it sends, and where its readings go."""

    tone: RepeatedBlock
    quiet: RepeatedBlock
    send: Send
    publish: Send
    writer: RangeWriter
    uplink_channel: int
    disturbance: str = ""


class WrsNode(EquipmentNode[WrsParameters], name="wrs1", namespace="/wayside"):
    """Wayside station as a managed node."""

    @cached_property
    def place(self) -> str:
        """Site: a station is named after it."""
        return str(self.get_name())

    @cached_property
    def listed_name(self) -> str:
        """Full name under which the table of topics has this station."""
        return f"{self.default_namespace}/{self.place}"

    def setup(self) -> None:
        """Make the tone, and open the ports of the antenna into every zone."""
        p = self._p
        self._check_parameters()
        signal = signal_of(p)
        self._station = RangingStation(
            signal,
            p.comparator,  # type: ignore[arg-type]
            p.delay_s,
            noise_mw=10.0 ** (p.noise_dbm / 10.0),
        )
        tone = modulate(signal, np.zeros(len(signal.tones_hz)))
        sent = tone[None, :] * 10.0 ** (p.power_dbm / 20.0)
        low_m, high_m = self._station.interval_m
        site = self.place
        self._antennas: list[_Antenna] = []
        for zone, channel, uplink_channel, carrier_hz in zip(
            p.zones, p.downlink_channels, p.uplink_channels, p.downlink_carriers_hz, strict=True
        ):
            radio = (signal.sample_rate_hz, carrier_hz, channel)
            antenna = _Antenna(
                RepeatedBlock(Waveform(0, *radio, sent)),
                RepeatedBlock(silence(0, *radio)),
                self.stream_out(WRS_TX, site=site, zone=zone),
                self.stream_out(RANGE, site=site, zone=zone),
                RangeWriter(zone, low_m, high_m),
                uplink_channel,
            )
            self._antennas.append(antenna)
            receive = partial(self._on_block, zone, antenna)
            self.blocks_in(WRS_RX, samples, receive, site=site, zone=zone)
        self.blocks_in(CLOCK, bare_stamp, self._on_clock)

    def start_over(self) -> None:
        """Have received nothing."""
        for antenna in self._antennas:
            antenna.disturbance = ""

    def _check_parameters(self) -> None:
        p = self._p
        per_zone = (p.zones, p.downlink_channels, p.uplink_channels, p.downlink_carriers_hz)
        counts = {len(values) for values in per_zone}
        if len(counts) != 1 or 0 in counts:
            raise ParameterError(
                f"zones: {p.zones}: every zone needs one downlink channel, one uplink channel and "
                "one carrier"
            )
        if p.comparator not in ("and", "quadrature", "two_tone"):
            raise ParameterError(f"comparator: {p.comparator}: and, quadrature or two_tone")

    def _on_clock(self, stamp_ns: int, _: None) -> None:
        for antenna in self._antennas:
            block = antenna.tone if self.switched_on else antenna.quiet
            antenna.send(block.at(stamp_ns))

    def _on_block(
        self, zone: str, antenna: _Antenna, stamp_ns: int, received: ComplexArray | None
    ) -> None:
        reading = NO_SIGNAL
        if received is not None and self.switched_on:
            reading = self._station.read(received[0])
        antenna.publish(antenna.writer.view(stamp_ns, reading.range_m, reading.variance_m2))
        if reading.disturbance != antenna.disturbance:
            antenna.disturbance = reading.disturbance
            self._report_disturbance(zone, antenna, stamp_ns)

    def _report_disturbance(self, zone: str, antenna: _Antenna, stamp_ns: int) -> None:
        disturbance = antenna.disturbance
        reason = disturbance.split(":")[0]
        self.report(
            DiagnosticStatus.WARN if disturbance else DiagnosticStatus.OK,
            zone,
            f"{reason} on CH{antenna.uplink_channel}" if reason else "undisturbed",
            values=[("detail", disturbance)],
            stamp_ns=stamp_ns,
        )


if __name__ == "__main__":
    WrsNode.main()
