"""What people do during a run."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from rail_msgs_py.train_radio.quantities import ON_SIGHT
from rail_world.line.description_base import Description, Name, StrictFloat


class ReleaseOnSight(Description):
    """A person releases a train that is held without a place or an authority, to run on sight.

    It counts for a train protection that is on at that time, from when the train stands, until it
    has a place and an authority again.
    """

    kind: Literal["release_on_sight"]
    train: Name = Field(description="the train")
    at_s: StrictFloat = Field(ge=0.0, le=1e6, description="time [s]")
    speed_kmh: StrictFloat = Field(
        default=round(3.6 * ON_SIGHT.default, 6),
        ge=2.0,
        le=40.0,
        description="speed not to be exceeded on sight [km/h]; the least of a train's releases",
    )
