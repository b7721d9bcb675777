"""Worlds that are not as the localizer's filters believe, by name.

Biases change faster or more slowly with the distance run, wheels are worse or slip more often,
readings fail to come more often, and nothing but the biases errs.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from .simulation import SimulatedLine

AS_BELIEVED: Final = "as believed"

WORLDS: Final[Mapping[str, SimulatedLine]] = MappingProxyType(
    {
        AS_BELIEVED: SimulatedLine(),
        "range bias over 50 m": SimulatedLine(range_bias_length_m=50.0),
        "range bias over 5 km": SimulatedLine(range_bias_length_m=5000.0),
        "Doppler bias over 50 m": SimulatedLine(doppler_bias_length_m=50.0),
        "Doppler bias over 3 km": SimulatedLine(doppler_bias_length_m=3000.0),
        "wheels of 2 %": SimulatedLine(wheel_scale=0.02),
        "slips three times": SimulatedLine(slips_per_s=0.15),
        "outages four times": SimulatedLine(outages_per_s=1.0 / 30.0),
        "no noise, biases only": SimulatedLine(range_sigma_m=(1e-3, 2e-3), wheel_noise_mps=0.0),
    }
)
