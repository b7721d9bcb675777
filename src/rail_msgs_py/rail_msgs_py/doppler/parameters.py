"""Parameters of the reference tones, which stations and receivers share."""

from __future__ import annotations

from dataclasses import dataclass

from rail_msgs_py.parameters import ParameterError, parameter
from rail_signals.doppler.tone_plan import TonePlan


@dataclass(frozen=True)
class ReferenceToneParameters:
    """Parameters of the reference tones."""

    carrier_hz: float = parameter(2.6e9, "middle of the tones", unit="Hz", low=1e6, high=1e11)
    sample_rate_hz: float = parameter(64e3, "complex sample rate", unit="Hz", low=1e3, high=1e8)
    samples: int = parameter(2048, "samples of a block, a power of two", low=512, high=1 << 20)
    slots: int = parameter(10, "frequency slots", low=1, high=1000)
    spacing_hz: float = parameter(6e3, "distance of two slots", unit="Hz", low=1.0, high=1e8)
    max_speed_mps: float = parameter(500.0 / 3.6, "fastest train", unit="m/s", low=1.0, high=300.0)
    max_offset_ppm: float = parameter(0.5, "largest offset of a receiver", low=0.0, high=100.0)
    min_distance_m: float = parameter(
        20.0, "least distance of a station from the track", unit="m", low=1.0, high=1e4
    )


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
