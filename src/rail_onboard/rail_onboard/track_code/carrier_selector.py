"""Which carrier the rails under the train carry: neighbouring circuits use different ones."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rail_signals.ranging.band_level import band_levels_db

#: How much stronger another carrier must be than the one in force [dB].
HYSTERESIS_DB = 3.0


class CarrierSelector:
    """Keeps or changes the carrier in force, from the power in the bands of a block.

    Parameters
    ----------
    carriers_hz : sequence of float
        Carriers to tell apart.
    sample_rate_hz : float
        Of the blocks.
    least_level_db : float
        Level, 0 dB being that of a wave of amplitude 1, below which there is no carrier.

    Examples
    --------
    >>> import numpy as np
    >>> selector = CarrierSelector((1700.0, 2300.0), 16e3, -60.0)
    >>> selector.update(0.1 * np.sin(2 * np.pi * 2300.0 / 16e3 * np.arange(1600)))
    2300.0
    >>> round(selector.level_db)
    -20
    >>> selector.update(np.zeros(1600)) is None
    True
    """

    def __init__(
        self, carriers_hz: Sequence[float], sample_rate_hz: float, least_level_db: float
    ) -> None:
        self._carriers_hz = tuple(carriers_hz)
        self._rate_hz = sample_rate_hz
        self._least_db = least_level_db
        self._carrier_hz: float | None = None
        self.level_db = -math.inf

    def update(self, samples: NDArray[np.float64]) -> float | None:
        """Carrier in force after a block of real samples, None if there is none."""
        levels_db = band_levels_db(samples, self._carriers_hz, self._rate_hz)
        levels = dict(zip(self._carriers_hz, levels_db, strict=True))
        best_hz = max(levels, key=lambda carrier_hz: (levels[carrier_hz], -carrier_hz))
        in_force_db = levels.get(self._carrier_hz or 0.0, -math.inf)
        if levels[best_hz] <= self._least_db:
            self._carrier_hz = None
        elif levels[best_hz] > in_force_db + HYSTERESIS_DB or in_force_db <= self._least_db:
            self._carrier_hz = best_hz
        self.level_db = levels.get(self._carrier_hz or 0.0, -math.inf)
        return self._carrier_hz
