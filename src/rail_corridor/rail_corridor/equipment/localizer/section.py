"""The section on the localizer."""

from __future__ import annotations

from typing import Final

from rail_corridor.scenario.model import Section
from rail_msgs_py.localizer import quantities
from rail_msgs_py.quantities import ODOMETER_ERROR
from rail_world.line.description_base import Description, StrictFloat, field_of


class LocalizerPlan(Description):
    """One position on board from all sensors, which trains then run on."""

    integrity_risk: StrictFloat = field_of(quantities.INTEGRITY_RISK)
    odometer_error: StrictFloat = field_of(ODOMETER_ERROR)


LOCALIZER_SECTION: Final[Section[LocalizerPlan | None]] = Section(
    "localizer", LocalizerPlan | None, "position on board from all sensors; null = none", None
)
