"""Readings of a tick, and the rows in which they enter a filter.

A reading with the age t was true of the state t ago. Going back with the acceleration of now,

    s(now - t) = s - t v + t^2 a / 2,    v(now - t) = v - t a,

which a step of the acceleration within t can falsify by ``t^2 / 2`` and ``t`` times it; that is
added to the noise. All rows are linear with known coefficients, whatever a filter believes, so
that the filters differ in nothing but the sensors they use.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .filter_bank import (
    DOPPLER_BIAS,
    RANGE_BIAS,
    SCALE,
    SLIP,
    A,
    BoolArray,
    FilterBank,
    MeasurementRow,
    Outcomes,
    S,
    V,
    Values,
)
from .settings import SENSORS, LocalizerSettings


class RangeFix(NamedTuple):
    """Chainage by phase ranging.

    ``station`` is any number that tells apart the stations that measured. Here as in the other
    readings every value is a float, or float64 [..., 1] for many runs; ``present`` is where there
    is a reading: elsewhere the others are not looked at, but must be finite, variances above zero.
    The age is the time since the reading was true. ``lasting_m`` is the sigma of what is the same
    from reading to reading beyond what is assumed of any range, as where its time is wrong.
    """

    chainage_m: Values
    variance_m2: Values
    age_s: Values
    station: Values = 0.0
    present: bool | BoolArray = True
    lasting_m: Values = 0.0


class DopplerFix(NamedTuple):
    """Chainage and speed, positive with chainage, with their covariance [m^2, m^2/s, m^2/s^2]."""

    chainage_m: Values
    speed_mps: Values
    variance_m2: Values
    covariance_m2ps: Values
    speed_variance_m2ps2: Values
    age_s: Values
    present: bool | BoolArray = True


class BlockEntry(NamedTuple):
    """Chainage of the joint by which a new block was entered; the age is that of the notice."""

    joint_m: Values
    age_s: Values
    present: bool | BoolArray = True


class WheelSpeed(NamedTuple):
    """Speed of the wheels, positive in the direction of travel.

    A distance counted over a tick, divided by the tick, is the speed in the middle of it.
    """

    speed_mps: Values
    age_s: Values
    present: bool | BoolArray = True


class TickMeasurements(NamedTuple):
    """What came in a tick; None where no run has any."""

    range: RangeFix | None = None
    doppler: DopplerFix | None = None
    block: BlockEntry | None = None
    odometer: WheelSpeed | None = None


class MeasurementModel:
    """Offers readings to the filters of a bank."""

    def __init__(self, settings: LocalizerSettings) -> None:
        self._settings = settings

    def range(self, bank: FilterBank, reading: RangeFix, use: BoolArray) -> Outcomes:
        """``z = s + b + noise``."""
        model = self._settings.ranging
        bank.start(reading.chainage_m, use)
        noise = np.maximum(reading.variance_m2, model.least_sigma_m**2)
        row, slack = self._place_row(reading.age_s)
        if _is_zero(reading.lasting_m) or model.bias_m == 0.0:
            noise = noise + np.square(reading.lasting_m)
            row.append((RANGE_BIAS, None))
        else:
            row.append((RANGE_BIAS, np.hypot(model.bias_m, reading.lasting_m) / model.bias_m))
        return (bank.take(row, reading.chainage_m, noise + slack, use),)

    def doppler(self, bank: FilterBank, reading: DopplerFix, use: BoolArray) -> Outcomes:
        """``z = s + sigma d + noise`` and the speed less its regression on the position.

        The regression c = cov / var makes the noise of the two rows independent. An error that
        lasts moves a fix along the axis on which noise does, so it has no part in the second row.
        """
        model = self._settings.doppler
        bank.start(reading.chainage_m, use)
        regression = reading.covariance_m2ps / reading.variance_m2
        variance = np.maximum(reading.variance_m2, model.least_sigma_m**2)
        rest = reading.speed_variance_m2ps2 - regression * reading.covariance_m2ps
        rest = np.maximum(rest, model.least_sigma_mps**2)
        place, slack = self._place_row(reading.age_s)
        first = bank.take(
            [*place, (DOPPLER_BIAS, np.sqrt(variance))], reading.chainage_m, variance + slack, use
        )
        age_s = reading.age_s
        row: MeasurementRow = [
            (S, -regression),
            (V, 1.0 + regression * age_s),
            (A, -age_s * (1.0 + 0.5 * regression * age_s)),
        ]
        slack = np.square(self._settings.motion.step_mps2 * age_s)
        speed_mps = reading.speed_mps - regression * reading.chainage_m
        if first.refused is not None:
            use = use & ~first.refused
        return first, bank.take(row, speed_mps, rest + slack, use)

    def block(self, bank: FilterBank, reading: BlockEntry, use: BoolArray) -> Outcomes:
        """``joint = s - (age + T/2) v + noise``, T the longest delay of the detection.

        The noise goes with the speed: with the fastest of those that the filters of single faults
        believe in, one of which is right. It is the same for all filters, whose differences would
        else not be what the tests take them for.
        """
        model = self._settings.block
        half_s = 0.5 * model.detection_s
        bank.start(reading.joint_m, use)
        row, slack = self._place_row(reading.age_s + half_s)
        speeds = np.square(bank.x[V]) + bank.variances[V]
        speeds = np.where(bank.known, speeds, 0.0)[..., : 1 + SENSORS].max(axis=-1, keepdims=True)
        noise = model.survey_m**2 + half_s**2 * speeds
        return (bank.take(row, reading.joint_m, noise + slack, use),)

    def odometer(
        self, bank: FilterBank, reading: WheelSpeed, steady_mps: Values, use: BoolArray
    ) -> Outcomes:
        """``w = v + k w0 + u + noise``: linear, with a speed w0 that does not follow the noise."""
        model, age_s = self._settings.odometer, reading.age_s
        wheel_mps = self._settings.direction * reading.speed_mps
        row: list[tuple[int, Values | None]] = [
            (V, None),
            (SCALE, self._settings.direction * steady_mps),
            (SLIP, None),
        ]
        noise: Values = model.noise_mps**2
        if not _is_zero(age_s):
            row.append((A, -age_s))
            noise = noise + np.square(self._settings.motion.step_mps2 * age_s)
        return (bank.take(row, wheel_mps, noise, use),)

    def _place_row(self, age_s: Values) -> tuple[list[tuple[int, Values | None]], Values]:
        if _is_zero(age_s):
            return [(S, None)], 0.0
        half_square = 0.5 * np.square(age_s)
        slack = np.square(self._settings.motion.step_mps2 * half_square)
        return [(S, None), (V, -age_s), (A, half_square)], slack


def _is_zero(values: Values) -> bool:
    return isinstance(values, float) and values == 0.0
