"""What every description of the truth is built from."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

LONGEST_TRACK_M: Final = 1e6


def _not_a_bool(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("a number is wanted, not a truth value")
    return value


Number = Annotated[float, BeforeValidator(_not_a_bool)]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]
Chainage = Annotated[Number, Field(ge=0.0, le=LONGEST_TRACK_M)]
Length = Annotated[Number, Field(gt=0.0, le=LONGEST_TRACK_M)]
Speed = Annotated[Number, Field(ge=1.0, le=600.0)]


def whole_samples(sample_rate_hz: float, tick_s: float) -> int:
    """Samples in a tick.

    Raises
    ------
    ValueError
        If that is not a whole number above zero.
    """
    exact = sample_rate_hz * tick_s
    count = round(exact)
    if count < 1 or abs(exact - count) > 1e-6:
        raise ValueError(f"tick_s: {tick_s:g} is not a whole number of samples")
    return count


class Description(BaseModel):
    """Base of every description: frozen, no unknown field, no NaN, no infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
