"""One tick of the localizer, for one train or for many independent runs at once."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite

import numpy as np

from .filter_bank import BoolArray, Figure, FilterBank, Outcome
from .integrity_monitor import IntegrityMonitor
from .protection_level import ClaimMaker, Estimate
from .readings import Intake, RangeReading, TickReadings
from .settings import LocalizerSettings, Sensor
from .wheel_slip import WheelWatch


class LocalizerCore:
    """Filters, tests and claims of independent runs in step.

    Parameters
    ----------
    settings : LocalizerSettings
    shape : tuple of int
        Of the runs; empty for one train, whose readings are then plain floats.
    """

    def __init__(self, settings: LocalizerSettings, shape: tuple[int, ...] = ()) -> None:
        self.bank = FilterBank(settings, shape)
        self.monitor = IntegrityMonitor(settings.claim, shape)
        self._claims = ClaimMaker(settings.claim, shape)
        self._wheels = WheelWatch(settings.odometer, shape)
        self._intake = Intake(settings)
        self._station: Figure = np.nan

    def place(
        self,
        chainage_m: Figure,
        sigma_m: float,
        *,
        speed_mps: float = 0.0,
        sigma_mps: float = 0.05,
        which: BoolArray | None = None,
    ) -> None:
        """Put trains [...] where they are known to be, by all sensors' leave.

        Every filter takes it, so it is outside of what the protection level protects against.
        """
        if not (np.isfinite(chainage_m).all() and isfinite(speed_mps)):
            raise ValueError(f"chainage_m, speed_mps: {chainage_m}, {speed_mps} are not finite")
        if not (0.0 < sigma_m < inf and 0.0 < sigma_mps < inf):
            raise ValueError(f"sigma_m, sigma_mps: {sigma_m}, {sigma_mps} are not above zero")
        where = np.ones(self.bank.known.shape[:-1], dtype=np.bool_) if which is None else which
        self.bank.place(where, chainage_m, sigma_m, speed_mps, sigma_mps)
        self.monitor.forget(where)

    def step(self, step_s: float, readings: TickReadings) -> Estimate:
        """Let time pass, take the readings of a tick, and say what is known.

        Parameters
        ----------
        step_s : float
            Since the tick before, 0 in the first [s].
        readings : TickReadings

        Raises
        ------
        ValueError
            If the step is negative or not finite.
        """
        if not 0.0 <= step_s < inf:
            raise ValueError(f"step_s: {step_s} is negative or not finite")
        step_s = round(step_s, 9)  # so that ticks counted in floats are alike
        self._wheels.update(step_s, readings.odometer)
        fresh_station = self._new_station(readings.range)
        if step_s > 0.0:
            self.bank.predict(step_s, self._wheels.slip_mps, fresh_station)
        self._take(readings)
        self.bank.lose()
        self.monitor.test(self.bank, step_s)
        return self._claims.estimate(self.bank, self.monitor, step_s)

    def _take(self, readings: TickReadings) -> None:
        intake = self._intake
        # The wheels come first: they tell how far the train has come since the other fixes.
        if (wheels := readings.odometer) is not None:
            steady_mps = self._wheels.steady_mps
            self._offer(
                Sensor.ODOMETER,
                wheels.present,
                lambda bank, use: intake.odometer(bank, wheels, steady_mps, use),
            )
        if (ranging := readings.range) is not None:
            self._offer(
                Sensor.RANGE, ranging.present, lambda bank, use: intake.range(bank, ranging, use)
            )
        if (doppler := readings.doppler) is not None:
            self._offer(
                Sensor.DOPPLER,
                doppler.present,
                lambda bank, use: intake.doppler(bank, doppler, use),
            )
        if (block := readings.block) is not None:
            self._offer(
                Sensor.BLOCK, block.present, lambda bank, use: intake.block(bank, block, use)
            )

    def _offer(
        self,
        sensor: Sensor,
        present: bool | BoolArray,
        take: Callable[[FilterBank, BoolArray], tuple[Outcome, ...]],
    ) -> None:
        if not (present is True or np.any(present)):
            return
        use = self.monitor.use(sensor, present)
        self.monitor.note(sensor, self.bank, present, take(self.bank, use))

    def _new_station(self, ranging: RangeReading | None) -> bool | BoolArray:
        """Which runs have ranges from another station than before."""
        if ranging is None:
            return False
        station, present = ranging.station, ranging.present
        changed = (station != self._station) & present
        if not (changed if isinstance(changed, bool) else changed.any()):
            return False
        self._station = station if present is True else np.where(present, station, self._station)
        return changed
