"""What the localizer assumes of a train's motion, of its sensors and of their faults.

Every value is an assumption that the protection level rests on; ``docs/localizer.md`` lists them.
Standard deviations are called sigma. An error that stays the same from reading to reading is kept
apart from noise: noise averages out, a bias does not, and a filter that took one for the other
would claim too much.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from enum import IntEnum
from math import inf, isfinite
from typing import Final

from scipy.special import ndtri


class Sensor(IntEnum):
    """Sources of position and speed; the values are the places in arrays."""

    RANGE = 0
    DOPPLER = 1
    BLOCK = 2
    ODOMETER = 3


SENSORS: Final = len(Sensor)


def _check(model: object, *, zero: tuple[str, ...] = (), infinite: tuple[str, ...] = ()) -> None:
    """Refuse what is not above zero, or not finite, but for the names given."""
    for entry in fields(model):  # type: ignore[arg-type]
        value = getattr(model, entry.name)
        if not isinstance(value, (int, float)):
            continue
        low = value > 0.0 or (value == 0.0 and entry.name in zero)
        if not (low and (isfinite(value) or (value == inf and entry.name in infinite))):
            raise ValueError(f"{entry.name}: {value} is not above zero")


@dataclass(frozen=True)
class MotionModel:
    """Acceleration as a first-order Gauss-Markov process (Singer's model).

    Parameters
    ----------
    acceleration_mps2 : float
        Sigma.
    correlation_s : float
        Time constant; 2 sigma^2 / constant is the jerk's density.
    step_mps2 : float
        Sigma of a change of acceleration within the age of a reading.
    """

    acceleration_mps2: float = 1.0
    correlation_s: float = 3.0
    step_mps2: float = 1.0

    def __post_init__(self) -> None:
        _check(self, zero=("step_mps2",))


@dataclass(frozen=True)
class RangeModel:
    """Errors of a position by phase ranging.

    Parameters
    ----------
    least_sigma_m : float
        Noise is taken for no less, whatever a reading says of itself.
    bias_m : float
        Sigma of what stays the same: survey, calibration, multipath. New with every station.
    bias_length_m : float
        Distance run over which it changes; standing still it does not.
    """

    least_sigma_m: float = 0.1
    bias_m: float = 0.3
    bias_length_m: float = 500.0

    def __post_init__(self) -> None:
        _check(self, zero=("bias_m",), infinite=("bias_length_m",))


@dataclass(frozen=True)
class DopplerModel:
    """Errors of position and speed by Doppler shifts.

    Parameters
    ----------
    least_sigma_m, least_sigma_mps : float
        Noise is taken for no less.
    correlated : float
        Sigma of the error that stays the same, over the sigma that a fix states: an error of
        frequency that lasts moves the fix along the same line as noise does.
    length_m : float
        Distance run over which it changes.
    """

    least_sigma_m: float = 0.3
    least_sigma_mps: float = 0.05
    correlated: float = 1.0
    length_m: float = 300.0

    def __post_init__(self) -> None:
        _check(self, zero=("correlated",), infinite=("length_m",))


@dataclass(frozen=True)
class BlockModel:
    """Errors of the place where a new block was noticed.

    Parameters
    ----------
    detection_s : float
        It is noticed between 0 and this after the joint was passed. The mean of the two is taken,
        with half of it as sigma: a delay that is always at its bound is one sigma off.
    survey_m : float
        Sigma of the joint's chainage.
    """

    detection_s: float = 0.5
    survey_m: float = 0.5

    def __post_init__(self) -> None:
        _check(self, zero=("detection_s",))


@dataclass(frozen=True)
class OdometerModel:
    """Errors of the speed of the wheels: ``w = v + k w + u + noise``.

    Parameters
    ----------
    noise_mps : float
        Sigma of the noise of one reading.
    scale, scale_length_m : float
        Sigma of k, the relative error by wear, and the Distance run over which it changes.
    creep, effort_creep, slip : float
        Sigma of u over the speed when coasting, under traction or braking, and once the wheels
        have been seen to slip or slide.
    creep_mps, effort_creep_mps, slip_mps : float
        Added to it: slowly turning wheels slip by more than a fraction of their speed.
    effort_mps2 : float
        A wheel that changes its speed faster than this pulls or brakes.
    limit_mps2 : float
        No train changes its speed faster than this: the wheel slips or slides.
    hold_s : float
        For how long effort and slip are assumed after they were last seen.
    correlation_s : float
        Time constant of u.
    """

    noise_mps: float = 0.05
    scale: float = 0.02
    scale_length_m: float = 100e3
    creep: float = 0.003
    creep_mps: float = 0.005
    effort_creep: float = 0.05
    effort_creep_mps: float = 0.15
    slip: float = 0.2
    slip_mps: float = 0.5
    effort_mps2: float = 0.3
    limit_mps2: float = 1.6
    hold_s: float = 4.0
    correlation_s: float = 2.0

    def __post_init__(self) -> None:
        free = ("scale", "creep", "effort_creep", "effort_creep_mps", "slip", "slip_mps")
        _check(self, zero=free, infinite=("scale_length_m", "effort_mps2", "limit_mps2"))
        if not self.scale <= 0.2:
            raise ValueError(f"scale: {self.scale} is more than 0.2")


@dataclass(frozen=True)
class IntegrityClaim:
    """What is claimed, and what is done about faults.

    Parameters
    ----------
    risk : float
        Probability that the train is outside of a protection level, *given* the fault of one
        sensor: no credit is taken for faults being rare.
    false_alarms_per_hour : float
        Bound on how often healthy sensors are taken for contradictory.
    tick_s : float
        From tick to tick, to divide the alarms among the ticks.
    widest_m : float
        A protection level above it is not given.
    silent_s : float
        After so long, or three ticks, without a reading but of wheels there is no position without
        them: their fault is not covered.
    hold_s : float
        For how long a hypothesis that was refuted stays so.
    return_s : float
        For how long an excluded sensor must agree with the others before it is used again.
    agreement : float
        Within how many sigma.
    return_readings : tuple of int
        In how many readings at least, in the order of `Sensor`.
    strikes : tuple of int
        Consecutive readings of a sensor outside the gate that refute; single outliers are left
        out and no more.
    unmonitored_s : float
        For how long a position is given that does not survive the fault of some sensor.
    restart_s : float
        After so long in contradiction everything begins anew.
    oldest_s : float
        Age that a reading may have.
    most_alike : int
        So many ranges or Doppler fixes in a row with the same values are of a frozen sensor.
    """

    risk: float = 1e-5
    false_alarms_per_hour: float = 1e-3
    tick_s: float = 0.1
    widest_m: float = 200.0
    silent_s: float = 0.75
    hold_s: float = 5.0
    return_s: float = 20.0
    agreement: float = 4.0
    return_readings: tuple[int, ...] = (50, 20, 2, 50)
    strikes: tuple[int, ...] = (3, 3, 1, 3)
    unmonitored_s: float = 600.0
    restart_s: float = 60.0
    oldest_s: float = 1.0
    most_alike: int = 5

    def __post_init__(self) -> None:
        _check(self, infinite=("unmonitored_s",))
        for name in ("return_readings", "strikes"):
            counts = getattr(self, name)
            if len(counts) != SENSORS or min(counts) < 1:
                raise ValueError(f"{name}: {counts} are not {SENSORS} counts from 1")
        if not self.most_alike > 1:
            raise ValueError(f"most_alike: {self.most_alike} is not a count from 2")
        if not (self.risk < 0.5 and self.false_alarms_per_tick < 0.5):
            raise ValueError(f"risk: {self.risk}, {self.false_alarms_per_hour} are too large")

    @property
    def false_alarms_per_tick(self) -> float:
        """Their probability in a tick."""
        return self.false_alarms_per_hour * self.tick_s / 3600.0

    @property
    def sigmas(self) -> float:
        """Half the width of a normal interval that misses with probability `risk`.

        Examples
        --------
        >>> round(IntegrityClaim(risk=1e-5).sigmas, 3)
        4.417
        """
        return -float(ndtri(0.5 * self.risk))

    def threshold(self, tests: int) -> float:
        """Sigmas that none of so many tests in a tick exceeds but for a false alarm (Bonferroni).

        Examples
        --------
        >>> round(IntegrityClaim().threshold(13), 3)
        5.987
        """
        return -float(ndtri(0.5 * self.false_alarms_per_tick / tests))


@dataclass(frozen=True)
class LocalizerSettings:
    """All assumptions; ``direction`` is that of travel, +1 or -1 towards smaller chainages."""

    direction: int = 1
    motion: MotionModel = field(default_factory=MotionModel)
    ranging: RangeModel = field(default_factory=RangeModel)
    doppler: DopplerModel = field(default_factory=DopplerModel)
    block: BlockModel = field(default_factory=BlockModel)
    odometer: OdometerModel = field(default_factory=OdometerModel)
    claim: IntegrityClaim = field(default_factory=IntegrityClaim)

    def __post_init__(self) -> None:
        if self.direction not in (1, -1):
            raise ValueError(f"direction: {self.direction} is neither 1 nor -1")
