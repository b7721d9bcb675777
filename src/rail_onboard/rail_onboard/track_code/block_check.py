"""Blocks as a measure of the odometer: each is as long as its code says."""

from __future__ import annotations

from typing import Final

from rail_signals.track_code.scales import CodeScales

#: A border is where its change of carrier was noticed, give or take this [m].
_BORDER_M: Final = 5.0
#: A shorter block tells too little of the wheels to make them believed again [m].
_LEAST_M: Final = 200.0


class BlockCheck:
    """Compares the way between two entrances by the wheels with the length of the block.

    Parameters
    ----------
    notice_s : float
        By how much a change of carrier is noticed late.
    odometer_error : float
        Relative error of distances that must be allowed for.
    """

    def __init__(self, notice_s: float, odometer_error: float) -> None:
        self._notice_s, self._error = notice_s, odometer_error
        scales = CodeScales()
        self._step_m, self._longest_m = scales.length_step_m, 63 * scales.length_step_m
        self.reset()

    def reset(self) -> None:
        """Know no entrance."""
        # Place and speed: now, at the last entrance and at the one before.
        self._now = (0.0, 0.0)
        self._entered: tuple[float, float] | None = None
        self._begun: tuple[float, float] | None = None

    def run_to(self, distance_m: float, speed_mps: float) -> None:
        """Take the place by the wheels."""
        self._now = distance_m, speed_mps

    def enter(self) -> None:
        """The carrier has changed."""
        self._entered = self._now

    def leave(self, length_m: float, *, follows: bool) -> float | None:
        """Judge the block behind the last entrance, once the code of the new one is known.

        Parameters
        ----------
        length_m : float
            By its code.
        follows : bool
            Whether the new circuit is the next one by its identity.

        Returns
        -------
        float or None
            1 if the block was as long by the wheels; the part of it if it was too short by them;
            None if nothing can be told.
        """
        begun, self._begun = self._begun, self._entered
        if begun is None or self._entered is None or not follows or length_m >= self._longest_m:
            return None
        run_m = self._entered[0] - begun[0]
        doubt_m = _BORDER_M + self._notice_s * max(begun[1], self._entered[1])
        if run_m < length_m * (1.0 - self._error) - doubt_m:
            return max(run_m, 1.0) / (length_m + self._step_m)
        most_m = (length_m + self._step_m) * (1.0 + self._error) + doubt_m
        return 1.0 if run_m <= most_m and length_m >= _LEAST_M else None
