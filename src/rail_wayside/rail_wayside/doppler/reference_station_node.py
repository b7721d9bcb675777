"""Reference station: sends its tone, the same in every tick.

Topics in: ``/clock``. Topics out: ``tone``.
"""

from __future__ import annotations

from dataclasses import dataclass

from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.decoders import bare_stamp
from rail_msgs_py.doppler import quantities
from rail_msgs_py.doppler.parameters import ReferenceToneParameters, tone_plan_of
from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.quantities import TICK
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.doppler import REFERENCE_TX
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.waveform import RepeatedBlock, Waveform, silence
from rail_signals.doppler.signal import reference_tone

_CHANNEL = 1


@dataclass(frozen=True)
class ReferenceStationParameters(ReferenceToneParameters):
    """Parameters of a reference station."""

    slot: int = quantities.SLOT.parameter()
    power_dbm: float = quantities.POWER.parameter()
    tick_s: float = TICK.parameter()


class ReferenceStationNode(
    EquipmentNode[ReferenceStationParameters], name="reference", namespace="/wayside/ref1"
):
    """A reference station as a managed node; switched off it is silent."""

    def setup(self) -> None:
        """Make its tone, the same for all ticks."""
        p = self._p
        plan = tone_plan_of(p)
        if not p.slot < plan.slots:
            raise ParameterError(f"slot: {p.slot} is not below {plan.slots}, the number of slots")
        cycles = plan.slot_offset_hz(p.slot) * p.tick_s
        if abs(cycles - round(cycles)) > 1e-6:
            raise ParameterError(f"tick_s: {p.tick_s:g} s is not a whole number of periods")
        # Waves of mean power 1 mW have amplitude 1.
        samples = 10.0 ** (p.power_dbm / 20.0) * reference_tone(plan, p.slot)
        radio = (plan.sample_rate_hz, plan.carrier_hz, _CHANNEL)
        self._tone = RepeatedBlock(Waveform(0, *radio, samples[None, :]))
        self._silence = RepeatedBlock(silence(0, *radio))
        self._send = self.stream_out(REFERENCE_TX, station=self.place)
        self.blocks_in(CLOCK, bare_stamp, self._on_clock)

    def _on_clock(self, stamp_ns: int, _: None) -> None:
        self._send((self._tone if self.switched_on else self._silence).at(stamp_ns))
        message = "sends its tone" if self.switched_on else "switched off"
        self.report(DiagnosticStatus.OK, "tone", message, stamp_ns=stamp_ns)


if __name__ == "__main__":
    ReferenceStationNode.main()
