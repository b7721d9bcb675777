"""Parameters of the reference tones, which stations and receivers share."""

from __future__ import annotations

from dataclasses import dataclass

from rail_msgs_py.parameters import ParameterError
from rail_signals.doppler.tone_plan import TonePlan

from . import quantities


@dataclass(frozen=True)
class ReferenceToneParameters:
    """Parameters of the reference tones."""

    carrier_hz: float = quantities.CARRIER.parameter()
    sample_rate_hz: float = quantities.SAMPLE_RATE.parameter()
    samples: int = quantities.SAMPLES.parameter()
    slots: int = quantities.SLOTS.parameter()
    spacing_hz: float = quantities.SLOT_SPACING.parameter()
    max_speed_mps: float = quantities.MAX_SPEED.parameter()
    max_offset_ppm: float = quantities.RECEIVER_OFFSET.parameter()
    min_distance_m: float = quantities.LEAST_DISTANCE.parameter()


def tone_plan_of(p: ReferenceToneParameters) -> TonePlan:
    """Plan of the tones.

    Raises
    ------
    ParameterError
        If the parameters do not fit together.
    """
    try:
        return TonePlan(
            p.carrier_hz,
            p.sample_rate_hz,
            p.samples,
            p.slots,
            p.spacing_hz,
            p.max_speed_mps,
            p.max_offset_ppm,
            p.min_distance_m,
        )
    except ValueError as error:
        raise ParameterError(f"reference tones: {error}") from None
