"""Vehicle station: where it is run, and what of it can be judged."""

from __future__ import annotations

import math
from dataclasses import fields
from math import inf
from typing import Any, ClassVar

from rail_msgs_py.ranging.signal_parameters import SignalParameters, signal_of
from rail_msgs_py.topics.ranging import VRS_CHANNEL, VRS_RX, VRS_TX
from rail_msgs_py.waveform import Waveform
from rail_signals.ranging.receiver import FmToneReceiver, ToneEstimate
from rail_signals.ranging.signal import RangingSignal
from rail_testing.conformance.bench import Bench
from rail_testing.conformance.kind import EquipmentKind, Ports, ValueRange

#: Difference of the delay from its calibration that is 3 m of range [s].
DELAY_TOLERANCE_S = 20e-9
_SIGMAS = 5.0
#: By so much another channel may be stronger than the one in force: hysteresis [dB].
_WEAKER_DB = 6.0


class Vrs(EquipmentKind):
    """Vehicle station of a train that passes zones in turn."""

    name: ClassVar[str] = "vrs"
    title: ClassVar[str] = "vehicle station of phase ranging"
    node_kind: ClassVar[str] = "vrs"
    scenario: ClassVar[dict[str, Any]] = {
        "name": "vrs_conformance",
        "seed": 5,
        "duration_s": 200.0,
        "tick_s": 0.25,
        "tracks": {"main": {"elements": [{"straight_m": 2000}], "speed_limits": [[0, 80]]}},
        "stations": {"zone_length_m": 250.0},
        "channels": {"main": [[1, 2], [3, 4]]},
        "trains": [{"name": "train_a", "route": ["main"], "start_m": 60}],
    }
    ranges: ClassVar[dict[str, dict[str, ValueRange]]] = {
        VRS_CHANNEL.pattern: {
            "downlink": ValueRange(0.0, 1e4),
            "uplink": ValueRange(0.0, 1e4),
        }
    }
    recovers_within_s: ClassVar[float] = 10.0

    def ports(self, bench: Bench) -> Ports:
        """Topics of its train."""
        train, channels = bench.place, bench.parameters["downlink_channels"]
        received = {VRS_RX.name(train=train, channel=channel): VRS_RX for channel in channels}
        outputs = {VRS_TX.name(train=train): VRS_TX, VRS_CHANNEL.name(train=train): VRS_CHANNEL}
        return Ports(received, {}, outputs)

    def reply(self, bench: Bench) -> Waveform:
        """What it has sent in the last tick."""
        sent: Waveform = bench.output(VRS_TX, train=bench.place).latest
        return sent

    def working(self, bench: Bench) -> bool:
        """It answers."""
        return not self.reply(bench).silent

    def false_claim(self, bench: Bench) -> str:
        """An answer on a channel that is not its own, or after a delay that is not calibrated."""
        reply = self.reply(bench)
        if reply.silent:
            return ""
        p = bench.parameters
        heard = self._heard(bench)
        uplinks = dict(zip(p["uplink_channels"], p["downlink_channels"], strict=True))
        if reply.channel not in uplinks:
            return f"answers on channel {reply.channel}, which is none of its uplink channels"
        carrier_hz = p["uplink_carriers_hz"][list(p["uplink_channels"]).index(reply.channel)]
        if reply.carrier_hz != carrier_hz:
            wanted = f"channel {reply.channel} is at {carrier_hz:.0f} Hz"
            return f"answers at {reply.carrier_hz:.0f} Hz; {wanted}"
        downlink = uplinks[reply.channel]
        if downlink not in heard:
            return f"answers on channel {reply.channel}, but hears nothing on channel {downlink}"
        strongest = max(heard, key=lambda channel: float(heard[channel].amplitude))
        weaker_db = 20.0 * math.log10(
            float(heard[strongest].amplitude) / float(heard[downlink].amplitude)
        )
        if weaker_db > _WEAKER_DB:
            own = p["uplink_channels"][list(p["downlink_channels"]).index(strongest)]
            return (
                f"answers on channel {reply.channel}, of the pair with channel {downlink}, though "
                f"channel {strongest} is {weaker_db:.0f} dB stronger: its own is channel {own}"
            )
        return self._false_delay(bench, reply, heard[downlink])

    def _false_delay(self, bench: Bench, reply: Waveform, received: ToneEstimate) -> str:
        p, signal = bench.parameters, _signal_of(bench)
        sent = FmToneReceiver(signal).estimate(reply.samples[0])
        if not bool(sent.detected):
            return "sends what is no ranging signal"
        wanted_s = float(p["transponder_delay_s"]) + float(p["delay_trim_s"])
        tone_hz = signal.tones_hz[0]
        lag_rad = float(sent.phase_lag_rad[0] - received.phase_lag_rad[0])
        turn_rad = math.remainder(lag_rad - 2.0 * math.pi * tone_hz * wanted_s, 2.0 * math.pi)
        off_s = turn_rad / (2.0 * math.pi * tone_hz)
        noise_s = math.sqrt(float(received.variance_rad2[0])) / (2.0 * math.pi * tone_hz)
        if abs(off_s) <= DELAY_TOLERANCE_S + _SIGMAS * noise_s:
            return ""
        return (
            f"its delay is {1e6 * (wanted_s + off_s):.3f} us; it is calibrated to "
            f"{1e6 * wanted_s:.3f} us, so ranges are off by {150.0 * 1e6 * off_s:.1f} m"
        )

    def _heard(self, bench: Bench) -> dict[int, ToneEstimate]:
        """What has been received in the last tick, by downlink channel."""
        receiver = FmToneReceiver(_signal_of(bench))
        heard = {}
        for channel in bench.parameters["downlink_channels"]:
            history = bench.output(VRS_RX, train=bench.place, channel=channel)
            blocks = history.newest(3)
            now = [b for b in blocks if b.stamp_ns == self.reply(bench).stamp_ns and not b.silent]
            if not now:
                continue
            found = receiver.estimate(now[0].samples[0])
            if bool(found.detected):
                heard[channel] = found
        return heard

    def not_silent(self, bench: Bench) -> str:
        """It must send nothing."""
        return "" if self.reply(bench).silent else "is switched off and answers"

    def believes_garbage(self, bench: Bench) -> str:
        """It must not answer to what is no station."""
        if self.reply(bench).silent:
            return ""
        return "answers, though what it hears is no ranging signal"

    def levels(self, bench: Bench) -> dict[int, float]:
        """Levels that it claims to hear, by channel [dBm]."""
        view = bench.output(VRS_CHANNEL, train=bench.place).latest
        found = {}
        for column, value in view.as_dict().items():
            if column.startswith("level_") and value != -inf:
                found[int(column.split("_")[1])] = value
        return found


def _signal_of(bench: Bench) -> RangingSignal:
    """The ranging signal that it was told."""
    known = {each.name for each in fields(SignalParameters)}
    given = {name: value for name, value in bench.parameters.items() if name in known}
    return signal_of(SignalParameters(**given))


KIND = Vrs()
