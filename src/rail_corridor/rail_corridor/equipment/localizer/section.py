"""The section on the localizer."""

from __future__ import annotations

from typing import Final

from pydantic import Field

from rail_corridor.scenario.model import Section
from rail_world.line.description_base import Description, Number


class LocalizerPlan(Description):
    """One position on board from all sensors, which trains then run on."""

    integrity_risk: Number = Field(
        default=1e-5,
        ge=1e-9,
        le=1e-2,
        description="probability that the error exceeds the protection level",
    )
    odometer_error: Number = Field(
        default=0.005, ge=0.0, le=0.1, description="standard deviation of the wheels' error"
    )


LOCALIZER_SECTION: Final[Section[LocalizerPlan | None]] = Section(
    "localizer", LocalizerPlan | None, "position on board from all sensors; null = none", None
)
