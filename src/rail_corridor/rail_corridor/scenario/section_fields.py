"""Kinds of fields that sections of a scenario share."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field

from rail_msgs_py.ranging.quantities import CHANNEL
from rail_world.line.description_base import StrictFloat, range_of


def _not_a_bool(value: object) -> object:
    if isinstance(value, bool):
        raise ValueError("a whole number is wanted, not a truth value")
    return value


StrictInt = Annotated[int, BeforeValidator(_not_a_bool)]
ChannelNumber = Annotated[StrictInt, range_of(CHANNEL)]
Time = Annotated[StrictFloat, Field(ge=0.0, le=1e6)]
Frequency = Annotated[StrictFloat, Field(ge=1.0, le=1e9)]
ChannelPair = tuple[ChannelNumber, ChannelNumber]
