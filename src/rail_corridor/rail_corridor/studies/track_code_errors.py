"""Messages that the receivers of track codes get wrong, counted.

The receivers, the waves and the closed forms are those of `rail_signals.track_code.study`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from rail_corridor.study.strict import Strict
from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.study.baseband import with_deviations_scaled
from rail_signals.track_code.study.chain_errors import count_noise_only
from rail_signals.track_code.study.closed_forms import message_error_rate
from rail_signals.track_code.study.receivers import COUNTERS, Receiver
from rail_signals.track_code.study.words import CheckedWords

#: Profile whose words are sent.
PROFILE: Final = "tones27"
#: The document's chain where nothing is sent.
NOISE_ONLY: Final = "noise_only"


class TrackCodeErrorParameters(Strict):
    """Random words in white noise, and who receives them."""

    receiver: Receiver | Literal["noise_only"] = Field(
        "chain_bits", description="who receives; noise_only is chain_lost without a carrier"
    )
    density_db_hz: float | None = Field(
        None, ge=15.0, le=60.0, validate_default=True, description="C/N0; none with noise_only"
    )
    messages: int = Field(
        100, ge=1, le=10_000_000, description="of a run at least; decisions with noise_only"
    )
    deviation_scale: float = Field(
        1.0, ge=0.05, le=2.0, description="deviations over those of the profile"
    )

    @field_validator("density_db_hz")
    @classmethod
    def _is_of_a_carrier(cls, value: float | None, info: ValidationInfo) -> float | None:
        receiver = info.data.get("receiver")
        if value is None and receiver in COUNTERS:
            raise ValueError(f"a value is needed for {receiver}")
        if value is not None and receiver == NOISE_ONLY:
            raise ValueError("must be null for noise_only, which has no carrier")
        return value


def count_track_code_errors(
    parameters: TrackCodeErrorParameters, seed: int
) -> Mapping[str, float | None]:
    """Messages that one receiver gets wrong.

    Parameters
    ----------
    parameters : TrackCodeErrorParameters
    seed : int

    Returns
    -------
    mapping
        ``messages``; ``errors`` among them; ``undetected``, wrong ones that are taken for true,
        None where the receiver does not judge; ``bound``, the closed form of the error rate of
        one slot, or of noise alone the share of random words that pass the check.
    """
    profile = with_deviations_scaled(load_profile(PROFILE), parameters.deviation_scale)
    number = [*COUNTERS, NOISE_ONLY].index(parameters.receiver)
    rng = np.random.default_rng([seed, number])
    if parameters.receiver == NOISE_ONLY or parameters.density_db_hz is None:
        counted = count_noise_only(profile, parameters.messages, rng)
        bound = CheckedWords(profile).pass_rate
    else:
        count = COUNTERS[parameters.receiver]
        counted = count(profile, parameters.density_db_hz, parameters.messages, rng)
        bound = message_error_rate(profile, parameters.density_db_hz)
    return {
        "messages": counted.messages,
        "errors": counted.errors,
        "undetected": counted.undetected,
        "bound": bound,
    }
