"""Where a train is, from all of its sensors: the localizer on board.

It fuses positions by phase ranging, positions and speeds by Doppler shifts, the joints passed when
track codes change, and the speed of the wheels, and claims an interval that holds the train even
if any one of them is wrong. This is the whole of it: the node converts messages to its readings
and its estimate to messages, the study of its integrity runs many trains through it side by side.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from math import inf, isfinite

import numpy as np

from .filter_bank import BoolArray, FilterBank, Outcomes, Values
from .integrity_monitor import IntegrityMonitor
from .protection_level import Estimate, ProtectionLevels
from .readings import MeasurementModel, RangeFix, TickMeasurements
from .screening import ReadingScreen, Rejection, UnusedReading
from .settings import LocalizerSettings, Sensor
from .wheel_slip import SlipDetector


class Localizer:
    """The localizer of a train that runs one way, or of many independent runs in step.

    Parameters
    ----------
    settings : LocalizerSettings
        Assumptions about motion, sensors and faults.
    shape : tuple of int
        Of the runs; empty for one train, whose readings are then plain floats.

    Attributes
    ----------
    bank : FilterBank
    monitor : IntegrityMonitor

    Examples
    --------
    >>> from rail_signals.localizer.protection_level import Localization
    >>> from rail_signals.localizer.readings import WheelSpeed
    >>> localizer = Localizer(LocalizerSettings())
    >>> wheels = TickMeasurements(odometer=WheelSpeed(20.0, 0.0))
    >>> Localization.of(localizer.tick(0.0, wheels)).reason
    <Reason.NO_FIX: 1>
    >>> localizer.place(1000.0, 1.0, speed_mps=20.0)
    >>> rng = np.random.default_rng(1)
    >>> for time_s in np.arange(1, 11) / 10:
    ...     measured_m = 1000.0 + 20.0 * time_s + 0.1 * rng.standard_normal()
    ...     readings = TickMeasurements(
    ...         RangeFix(measured_m, 0.01, age_s=0.0), odometer=WheelSpeed(20.0, age_s=0.0)
    ...     )
    ...     here = Localization.of(localizer.tick(time_s, readings))
    >>> round(here.position_m), here.low_m < 1020.0 < here.high_m, here.status.name
    (1020, True, 'PROTECTED')
    """

    def __init__(self, settings: LocalizerSettings, shape: tuple[int, ...] = ()) -> None:
        self._settings, self._shape = settings, shape
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when switched on: also where the train was placed."""
        settings, shape = self._settings, self._shape
        self.bank = FilterBank(settings, shape)
        self.monitor = IntegrityMonitor(settings.claim, shape)
        self._screen = ReadingScreen(settings.claim.oldest_s, settings.claim.most_alike)
        self._levels = ProtectionLevels(settings.claim, shape)
        self._wheels = SlipDetector(settings.odometer, shape)
        self._model = MeasurementModel(settings)
        self._station: Values = np.nan
        self._silent_s = np.full(shape, np.inf)
        self._time_s = -inf

    @property
    def rejected(self) -> list[UnusedReading]:
        """Readings of the last tick that were no evidence."""
        return self._screen.rejected

    @property
    def rejections(self) -> Counter[tuple[Sensor, Rejection]]:
        """How many readings were no evidence since the last reset, and why."""
        return self._screen.counts

    def place(
        self,
        chainage_m: Values,
        sigma_m: float,
        *,
        speed_mps: float = 0.0,
        sigma_mps: float = 0.05,
        which: BoolArray | None = None,
    ) -> None:
        """Put trains [...] where they are known to be, from outside.

        Every filter takes it as true: no fault of a sensor makes it wrong, and the protection level
        does not protect against its being wrong.

        Raises
        ------
        ValueError
            If a value is not finite or a sigma not above zero.
        """
        if not (np.isfinite(chainage_m).all() and isfinite(speed_mps)):
            raise ValueError(f"chainage_m, speed_mps: {chainage_m}, {speed_mps} are not finite")
        if not (0.0 < sigma_m < inf and 0.0 < sigma_mps < inf):
            raise ValueError(f"sigma_m, sigma_mps: {sigma_m}, {sigma_mps} are not above zero")
        where = np.ones(self.bank.known.shape[:-1], dtype=np.bool_) if which is None else which
        self.bank.place(where, chainage_m, sigma_m, speed_mps, sigma_mps)
        self.monitor.forget(where)
        self._silent_s = np.where(where, 0.0, self._silent_s)

    def tick(self, time_s: float, readings: TickMeasurements) -> Estimate:
        """Take what came since the tick before, and say what is known now.

        Readings that are no evidence are kept out and counted, see `ReadingScreen`.

        Parameters
        ----------
        time_s : float
            Now.
        readings : TickMeasurements

        Raises
        ------
        ValueError
            If the time is not finite or not later than that of the tick before.
        """
        if not (isfinite(time_s) and time_s > self._time_s):
            raise ValueError(f"time_s: {time_s} is not later than {self._time_s}")
        # Rounded so that ticks counted in floats are alike.
        step_s = 0.0 if self._time_s == -inf else round(time_s - self._time_s, 9)
        self._time_s = time_s
        readings = self._screen.screen(time_s, readings)
        self._wheels.update(step_s, readings.odometer)
        new_station = self._new_station(readings.range)
        if step_s > 0.0:
            self.bank.predict(step_s, self._wheels.slip_mps, new_station)
        self._take(readings)
        self.bank.lose()
        self.monitor.test(self.bank, step_s)
        return self._levels.estimate(
            *(self.bank, self.monitor, step_s),
            self._wheels.most_mps[..., 0],
            self._has_long_been_silent(step_s, readings),
        )

    def _has_long_been_silent(self, step_s: float, readings: TickMeasurements) -> BoolArray:
        """Whether nothing but the wheels has been heard for long, of every run [...]."""
        self._silent_s = self._silent_s + step_s
        for reading in (readings.range, readings.doppler, readings.block):
            if reading is None:
                continue
            if reading.present is True:
                self._silent_s = np.zeros(self._shape)
            else:
                heard = np.broadcast_to(reading.present, (*self._shape, 1))[..., 0]
                self._silent_s = np.where(heard, 0.0, self._silent_s)
        claim = self._settings.claim
        silent: BoolArray = self._silent_s > max(claim.silent_s, 3.0 * claim.tick_s)
        return silent

    def _take(self, readings: TickMeasurements) -> None:
        model = self._model
        # The wheels come first: by them the other fixes are compared with how far it has come.
        if (wheels := readings.odometer) is not None:
            steady_mps = self._wheels.steady_mps
            self._offer(
                Sensor.ODOMETER,
                wheels.present,
                lambda bank, use: model.odometer(bank, wheels, steady_mps, use),
            )
        if (ranging := readings.range) is not None:
            self._offer(
                Sensor.RANGE, ranging.present, lambda bank, use: model.range(bank, ranging, use)
            )
        if (doppler := readings.doppler) is not None:
            self._offer(
                Sensor.DOPPLER,
                doppler.present,
                lambda bank, use: model.doppler(bank, doppler, use),
            )
        if (block := readings.block) is not None:
            self._offer(
                Sensor.BLOCK, block.present, lambda bank, use: model.block(bank, block, use)
            )

    def _offer(
        self,
        sensor: Sensor,
        present: bool | BoolArray,
        take: Callable[[FilterBank, BoolArray], Outcomes],
    ) -> None:
        if not (present is True or np.any(present)):
            return
        use = self.monitor.use(sensor, present)
        self.monitor.note(sensor, self.bank, present, take(self.bank, use))

    def _new_station(self, ranging: RangeFix | None) -> bool | BoolArray:
        """Which runs have ranges from another station than before."""
        if ranging is None:
            return False
        station, present = ranging.station, ranging.present
        changed = (station != self._station) & present
        if not (changed if isinstance(changed, bool) else changed.any()):
            return False
        self._station = station if present is True else np.where(present, station, self._station)
        return changed
