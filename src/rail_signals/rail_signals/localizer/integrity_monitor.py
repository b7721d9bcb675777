"""Fault detection and exclusion: which faults are still possible, which sensors are left out.

**Hypotheses.** H0: no sensor is faulty; Hi: sensor i is, and no other. Under Hi the filter without
sensor i is right, whatever sensor i reported, so the train is within ``K sigma`` of it but for the
risk. Whichever of the hypotheses is true, it is then in the *hull* of their intervals, before any
fault is found and while it is not yet known which sensor has it. The hull uses the separation
that is there, where the protection level of solution separation (Blanch et al., IEEE Trans.
AES-51(1), 2015) uses the largest that would not be detected: it is never wider, and rests on
no test.

**Tests** make the hull narrow again. Under Hi the filter without i agrees with each that leaves
out one more sensor j: their difference is normal, with the variance ``P_ij - P_i`` since the
smaller error is independent of what it gains; the readings it takes pass its gate; and the scale
and the biases that it estimates are no larger than they may be. A hypothesis that fails is
refuted, by itself and for some seconds. H0 refuted: a fault is *found*. All but one refuted: its
sensor is *excluded*, every filter that knew it becomes a copy of the one that did not, and the
bank goes on with the others. It is used again when it has agreed with them for long enough.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from .filter_bank import FILTERS, SCALE, USES, BoolArray, FilterBank, Outcomes, V
from .settings import SENSORS, IntegrityClaim, Sensor

HYPOTHESES: Final = 1 + SENSORS
"""H0 and one for each sensor: the first filters of the bank."""


def _edges() -> tuple[list[int], list[int], list[int]]:
    """Filters to be compared: each of the hypotheses' with those that leave out one more."""
    parents: list[int] = []
    children: list[int] = []
    starts: list[int] = []
    for parent in range(HYPOTHESES):
        starts.append(len(parents))
        for child, left_out in enumerate(FILTERS):
            if len(left_out) == len(FILTERS[parent]) + 1 and left_out > FILTERS[parent]:
                parents.append(parent)
                children.append(child)
    return parents, children, starts


_PARENTS, _CHILDREN, _STARTS = (np.array(column) for column in _edges())
#: Separations of s and v, readings of a tick, and estimates of k, b and d that can refute H0.
_TESTS: Final = 2 * SENSORS + (SENSORS + 1) + 3
#: A separation has no less a variance: two filters that know the same differ by rounding [m, m/s].
_LEAST_SEPARATION: Final = (0.05, 0.02)
#: Filter that each becomes a copy of when a sensor is excluded; -1 = there is none.
_WITHOUT: Final = np.array(
    [[FILTERS.index(out | {s}) if out | {s} in FILTERS else -1 for out in FILTERS] for s in Sensor]
)


class IntegrityMonitor:
    """Tests the hypotheses, excludes sensors and lets them return.

    Parameters
    ----------
    claim : IntegrityClaim
    shape : tuple of int
        Of the runs.

    Attributes
    ----------
    excluded : bool [..., sensor]
    refuted_s : float64 [..., hypothesis]
        For how long a hypothesis stays refuted; not above zero: it is possible.
    """

    def __init__(self, claim: IntegrityClaim, shape: tuple[int, ...] = ()) -> None:
        self._claim = claim
        self._threshold2 = claim.threshold(_TESTS) ** 2
        extra = tuple(1 for _ in shape)
        self._floor = np.square(_LEAST_SEPARATION).reshape(2, *extra, 1)
        self._most_strikes = np.array(claim.strikes).reshape(SENSORS, *extra, 1)
        self._time_s = 0.0
        self.excluded = np.zeros((*shape, SENSORS), dtype=np.bool_)
        self.refuted_s = np.zeros((*shape, HYPOTHESES))
        self._strikes = np.zeros((SENSORS, *shape, len(FILTERS)), dtype=np.int64)
        self._agreed = np.zeros((SENSORS, *shape), dtype=np.int64)
        self._since_s = np.zeros((SENSORS, *shape))
        self._contrary_s = np.zeros(shape)
        self._any_excluded = self._any_struck = self._any_refuted = False

    @property
    def quiet(self) -> bool:
        """Whether no run has anything refuted or excluded."""
        return not (self._any_refuted or self._any_excluded)

    def forget(self, which: BoolArray) -> None:
        """Begin anew in some runs [...]."""
        self.excluded[which] = False
        self.refuted_s[which] = 0.0
        self._strikes[:, which] = 0
        self._agreed[:, which] = 0
        self._contrary_s[which] = 0.0
        self._any_excluded = bool(self.excluded.any())

    def use(self, sensor: Sensor, present: bool | BoolArray) -> BoolArray:
        """Which filters a reading is offered to [..., filter]."""
        use: BoolArray = USES[sensor]
        if present is not True:
            use = use & present
        if self._any_excluded:
            use = use & ~self.excluded[..., sensor, None]
        return use

    def note(
        self, sensor: Sensor, bank: FilterBank, present: bool | BoolArray, outcomes: Outcomes
    ) -> None:
        """Count what the gates refused, and the agreement of a sensor that is excluded."""
        refusals = [outcome.refused for outcome in outcomes if outcome.refused is not None]
        if self._any_struck or refusals:
            offered = self.use(sensor, present)
            refused = np.any(np.stack(refusals), axis=0) if refusals else False
            strikes = np.where(refused, self._strikes[sensor] + 1, 0)
            self._strikes[sensor] = np.where(offered, strikes, self._strikes[sensor])
            self._any_struck = bool(self._strikes.any())
        if self._any_excluded and self.excluded[..., sensor].any():
            self._agree(sensor, bank, present, outcomes)

    def _agree(
        self, sensor: Sensor, bank: FilterBank, present: bool | BoolArray, outcomes: Outcomes
    ) -> None:
        """Let a sensor return that has agreed with the first filter, which does not use it."""
        agrees: BoolArray = np.asarray(bank.known[..., 0])
        for outcome in outcomes:
            innovation, variance = outcome.innovation[..., 0], outcome.variance[..., 0]
            agrees = agrees & (innovation**2 <= self._claim.agreement**2 * variance)
        out = self.excluded[..., sensor] & np.broadcast_to(present, bank.known.shape)[..., 0]
        count, since_s = self._agreed[sensor, ...], self._since_s[sensor, ...]
        since_s[...] = np.where(out & agrees & (count == 0), self._time_s, since_s)
        count[...] = np.where(out, np.where(agrees, count + 1, 0), count)
        enough = count >= self._claim.return_readings[sensor]
        back = np.asarray(out & enough & (self._time_s - since_s >= self._claim.return_s))
        if back.any():
            self.excluded[back, sensor] = False
            count[back] = 0
            self._any_excluded = bool(self.excluded.any())

    def test(self, bank: FilterBank, step_s: float) -> None:
        """Refute hypotheses and exclude sensors, at the end of a tick."""
        self._time_s += step_s
        if self._any_refuted:
            self.refuted_s -= step_s
        strange = np.square(bank.x[SCALE:, ..., :HYPOTHESES]) > self._threshold2 * bank.most
        if strange.any():
            self._refute(strange.any(axis=0) & bank.known[..., :HYPOTHESES])
        both = np.concatenate((bank.x[: V + 1], bank.variances[: V + 1]))
        apart = both.take(_CHILDREN, -1) - both.take(_PARENTS, -1)
        limit = self._threshold2 * np.maximum(apart[2:], self._floor)
        separate = np.square(apart[:2]) > limit
        if separate.any():
            failing = separate.any(axis=0)
            failing &= bank.known.take(_CHILDREN, -1) & bank.known.take(_PARENTS, -1)
            self._refute(np.logical_or.reduceat(failing, _STARTS, axis=-1))
        if self._any_struck:
            struck = np.asarray((self._strikes >= self._most_strikes).any(axis=0))
            self._refute(struck[..., :HYPOTHESES])
            # Filters that are witnesses only begin anew where they contradict themselves.
            struck[..., :HYPOTHESES] = False
            if struck.any():
                bank.forget(struck)
                self._strikes[:, struck] = 0
        if self._any_refuted or self._any_excluded:
            self._any_refuted = bool((self.refuted_s > 0.0).any())
            self._judge(bank, step_s)

    def _refute(self, which: BoolArray) -> None:
        self.refuted_s[which] = self._claim.hold_s
        self._any_refuted = True

    def _judge(self, bank: FilterBank, step_s: float) -> None:
        """Exclude the sensor of the only hypothesis that is left; begin anew where none is."""
        possible = self.refuted_s <= 0.0
        left = possible[..., 1:] & ~self.excluded
        single = ~possible[..., 0] & (left.sum(axis=-1) == 1)
        if single.any():
            for sensor in Sensor:
                which = single & left[..., sensor]
                if which.any():
                    self._exclude(bank, sensor, which)
            possible = self.refuted_s <= 0.0
        contrary = ~possible.any(axis=-1) | (self.excluded.sum(axis=-1) > 1)
        self._contrary_s = np.where(contrary, self._contrary_s + step_s, 0.0)
        anew = self._contrary_s >= self._claim.restart_s
        if anew.any():
            self.forget(anew)
            bank.forget(np.broadcast_to(anew[..., None], bank.known.shape))

    def _exclude(self, bank: FilterBank, sensor: Sensor, which: BoolArray) -> None:
        source = _WITHOUT[sensor]
        bank.x[:, which] = bank.x[:, which][..., source]
        bank.p[:, :, which] = bank.p[:, :, which][..., source]
        bank.known[which] = bank.known[which][..., source] & (source >= 0)
        # What a filter without two sensors has from the excluded one cannot be taken out of it.
        bank.forget(~bank.known)
        self.excluded[which, sensor] = True
        self.refuted_s[which] = 0.0
        self._strikes[:, which] = 0
        self._agreed[sensor, which] = 0
        self._any_excluded = True
