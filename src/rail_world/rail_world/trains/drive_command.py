"""What supervision on board imposes on the driver."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isnan


@dataclass(frozen=True)
class DriveCommand:
    """A permitted speed and brake demands, which override the driver.

    Parameters
    ----------
    max_speed_mps : float
        Speed not to exceed; above it the full service brake is applied.
    service_brake, emergency_brake : bool
        Demands of full braking; the emergency brake goes before.
    traction_cut_off : bool
        The motors get no current.
    on_sight : bool
        The driver goes no faster than lets him stop short of whatever he sees.

    Raises
    ------
    ValueError
        If the speed is negative or not a number.
    """

    max_speed_mps: float = inf
    service_brake: bool = False
    emergency_brake: bool = False
    traction_cut_off: bool = False
    on_sight: bool = False

    def __post_init__(self) -> None:
        if isnan(self.max_speed_mps) or self.max_speed_mps < 0.0:
            raise ValueError(f"max_speed_mps: {self.max_speed_mps} is not a speed")
