"""The plan of reference tones: which station sends what, and how long a train listens.

Symbols, used throughout the Doppler modules:

====================  ==========================================================
``f``, ``f_k``        carrier; frequency of the tone in slot k: carrier plus slot offset [Hz]
``fs``, ``N``, ``T``  complex sample rate [Hz], samples in a block, length N/fs of a block [s]
``gamma``             signal-to-noise ratio of a tone per complex sample (linear)
``s``                 chainage of the train's antenna [m]
``v``                 its rate ds/dt [m/s], negative towards decreasing chainage
``R_k(s)``            distance from station k to the antenna [m]
``delta``             offset of the receiver at the carrier: what all shifts share [Hz]
====================  ==========================================================

Stations send unmodulated tones, told apart by a frequency slot of their own. A receiver finds the
tone of slot k shifted by ``-(f_k / c) v dR_k/ds + (f_k / f) delta``.

A shift is that of the whole block: the slope of the least-squares line through the phase, that
is the mean of the momentary shift with the weights ``1 - (2 t / T)^2``. Abeam at 500 km/h the
shift runs by kilohertz a second, and the shift at mid-block would be another number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S

#: Half width of the main lobe of the window that tones are searched with [bins].
LOBE_BINS = 4
#: Fewest bins between neighbouring slots that no tone reaches: there the noise is measured.
GUARD_BINS = 4
_FEWEST_SAMPLES = 512


@dataclass(frozen=True)
class TonePlan:
    """Carrier, slots and block of the reference tones.

    Parameters
    ----------
    carrier_hz
        Carrier [Hz], the middle of the slots.
    sample_rate_hz
        Complex sample rate of the receiver [Hz].
    samples
        Samples in one block; a power of two.
    slots
        Number of slots, numbered from the lowest frequency.
    spacing_hz
        Distance of neighbouring slots [Hz].
    max_speed_mps, max_offset_ppm
        Fastest train [m/s], largest offset of its receiver [ppm]: together the widest shift.
    min_distance_m
        Least distance from a station to the track [m]; with the speed, the steepest shift.

    Raises
    ------
    ValueError
        If a field is out of range, or shifted tones of neighbouring slots could mix.

    Examples
    --------
    >>> plan = TonePlan()
    >>> round(plan.max_shift_hz), round(plan.max_chirp_hz_per_s), plan.slot_offset_hz(0)
    (2504, 8365, -27000.0)
    >>> TonePlan(spacing_hz=5000.0)
    Traceback (most recent call last):
    ...
    ValueError: spacing_hz must be at least 5914.5 Hz for shifts of 2504.5 Hz, got 5000.0
    """

    carrier_hz: float = 2.6e9
    sample_rate_hz: float = 64e3
    samples: int = 2048
    slots: int = 10
    spacing_hz: float = 6e3
    max_speed_mps: float = 500.0 / 3.6
    max_offset_ppm: float = 0.5
    min_distance_m: float = 20.0

    def __post_init__(self) -> None:
        """Validate every field."""
        for name in ("carrier_hz", "sample_rate_hz", "spacing_hz", "max_speed_mps"):
            _require(name, getattr(self, name), 0.0, strictly=True)
        _require("min_distance_m", self.min_distance_m, 0.0, strictly=True)
        _require("max_offset_ppm", self.max_offset_ppm, 0.0)
        if self.samples < _FEWEST_SAMPLES or self.samples & (self.samples - 1):
            raise ValueError(
                f"samples must be a power of two from {_FEWEST_SAMPLES}, got {self.samples!r}"
            )
        if self.slots < 1:
            raise ValueError(f"slots must be at least 1, got {self.slots!r}")
        least_hz = 2 * (self.max_shift_hz + self.lobe_hz) + GUARD_BINS * self.bin_hz
        if self.spacing_hz < least_hz:
            raise ValueError(
                f"spacing_hz must be at least {least_hz:.1f} Hz for shifts of"
                f" {self.max_shift_hz:.1f} Hz, got {self.spacing_hz!r}"
            )
        if self.slots * self.spacing_hz > self.sample_rate_hz:
            raise ValueError(
                f"slots of {self.spacing_hz:g} Hz must fit into {self.sample_rate_hz:g} Hz,"
                f" got {self.slots}"
            )

    @property
    def duration_s(self) -> float:
        """Length T of a block [s]."""
        return self.samples / self.sample_rate_hz

    @property
    def bin_hz(self) -> float:
        """Distance 1 / T of the frequencies of the transform [Hz]."""
        return self.sample_rate_hz / self.samples

    @property
    def max_shift_hz(self) -> float:
        """Largest shift: Doppler at the highest speed and the offset of the receiver [Hz]."""
        speed = self.max_speed_mps / SPEED_OF_LIGHT_M_PER_S
        return self.carrier_hz * (speed + 1e-6 * self.max_offset_ppm)

    @property
    def max_chirp_hz_per_s(self) -> float:
        """Steepest fall of a shift, abeam of a station: f v^2 / (c d) [Hz/s]."""
        distance = SPEED_OF_LIGHT_M_PER_S * self.min_distance_m
        return self.carrier_hz * self.max_speed_mps**2 / distance

    @property
    def lobe_hz(self) -> float:
        """How far the line of a tone reaches in the search, to either side [Hz]."""
        return (
            LOBE_BINS * self.bin_hz
            + 0.5 * self.max_chirp_hz_per_s * self.duration_s
            + (self.bin_hz)
        )

    @property
    def averaging_time_s(self) -> float:
        """Half the distance of the two instants that stand for a block: T / sqrt(20) [s].

        The mean with the weights ``1 - (2 t / T)^2`` is, up to third order in time, that of the
        values there.
        """
        return self.duration_s / math.sqrt(20.0)

    def slot_offset_hz(self, slot: int) -> float:
        """Middle of a slot, relative to the carrier [Hz].

        Raises
        ------
        ValueError
            If there is no such slot.
        """
        if not 0 <= slot < self.slots:
            raise ValueError(f"slot must lie between 0 and {self.slots - 1}, got {slot!r}")
        return (slot - 0.5 * (self.slots - 1)) * self.spacing_hz

    def tone_hz(self, slot: int) -> float:
        """Frequency of the tone of a slot [Hz]."""
        return self.carrier_hz + self.slot_offset_hz(slot)


def _require(name: str, value: float, least: float, *, strictly: bool = False) -> None:
    if not math.isfinite(value) or value < least or (strictly and value == least):
        bound = f"above {least:g}" if strictly else f"at least {least:g}"
        raise ValueError(f"{name} must be finite and {bound}, got {value!r}")
