"""Modes of a train that is protected by radio, and running on sight.

======================= ==========================================================================
not known               the place of the front is not known: the train is held
located                 it is known, and the train stands
moving                  it is known, and the train runs under supervision
on sight                a person has released the train: a low speed is permitted, and the driver
                        stops short of whatever is in the way
======================= ==========================================================================

A unit that is switched on begins with "not known", and the train moves only after it has been
located. A release counts for a train that lacks its place or an authority, from when it stands on.
It ends as soon as both are there; another hole needs another release. A person is asked for it
because nobody but the driver guards a train on sight: the zone controller only knows that it may
be anywhere that the low speed has let it come to.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from enum import IntEnum

from rail_onboard.track_code.supervision import STANDSTILL_MPS, SupervisionOutput, Thresholds

from .supervision import AuthoritySupervision, ReceivedAuthority
from .train_location import Location

_SAME_TIME_S = 1e-6
ODOMETER_DOUBTED = "odometer in doubt: wheels slide or spin"


class TrainMode(IntEnum):
    """Mode of a train, as in ``ATP_STATE``."""

    NOT_KNOWN = 0
    LOCATED = 1
    MOVING = 2
    ON_SIGHT = 3


class ModeSupervision:
    """Supervision by authorities or on sight, whichever the train has come to.

    Parameters
    ----------
    supervision : AuthoritySupervision
    releases_s : iterable of float
        When a person releases the train to run on sight [s].
    on_sight_mps : float
        Speed permitted on sight.
    timeout_s : float
        Age of an authority at which it is none.
    thresholds : Thresholds, optional

    Raises
    ------
    ValueError
        If the speed on sight is not above zero.
    """

    def __init__(
        self,
        supervision: AuthoritySupervision,
        *,
        releases_s: Iterable[float] = (),
        on_sight_mps: float = 15.0 / 3.6,
        timeout_s: float = 3.0,
        thresholds: Thresholds | None = None,
    ) -> None:
        if not on_sight_mps > 0.0:
            raise ValueError(f"on_sight_mps: {on_sight_mps} is not above zero")
        self._supervision, self._timeout_s = supervision, timeout_s
        self._on_sight_mps, self._thresholds = on_sight_mps, thresholds or Thresholds()
        self._releases_s = sorted(releases_s)
        self._last_s: float | None = None
        self._released = self._on_sight = False
        self._service = self._emergency = ""
        self.mode = TrainMode.NOT_KNOWN

    @property
    def authority(self) -> ReceivedAuthority | None:
        """The authority in force, which may be void."""
        return self._supervision.authority

    @property
    def released(self) -> bool:
        """Whether the train runs on sight, or will as soon as it stands."""
        return self._released or self._on_sight

    def update(
        self,
        time_s: float,
        location: Location,
        speed_mps: float,
        *,
        authority: ReceivedAuthority | None = None,
        fastest_mps: float | None = None,
        odometer_doubted: bool = False,
    ) -> SupervisionOutput:
        """One tick; parameters as of `AuthoritySupervision.update`.

        While the odometer is in doubt the train is braked, so that physics bounds its speed.
        """
        self._note_releases(time_s)
        if self._on_sight:
            # What is held against a train that had no authority ends with its release.
            self._supervision.reset()
        out = self._supervision.update(
            time_s, location, speed_mps, authority=authority, fastest_mps=fastest_mps
        )
        fastest = abs(speed_mps) if fastest_mps is None else fastest_mps
        standing = fastest <= STANDSTILL_MPS
        held = self._supervision.authority
        if held is not None and held.emergency_stop and self._fresh(held, time_s):
            self._on_sight = False
        elif location.valid and held is not None and self._fresh(held, time_s):
            self._on_sight = self._released = False
        elif self._released and standing:
            self._on_sight, self._released = True, False
            self._service = self._emergency = ""
        if self._on_sight:
            out = self._judge_on_sight(fastest)
        if odometer_doubted:
            reason = out.reason if out.emergency_brake else ODOMETER_DOUBTED
            out = replace(out, warning=True, service_brake=True, reason=reason)
        self.mode = self._mode_of(location, abs(speed_mps) <= STANDSTILL_MPS)
        return out

    def _note_releases(self, time_s: float) -> None:
        """Hear the person: only a unit that is on at that time does."""
        last_s = time_s - _SAME_TIME_S if self._last_s is None else self._last_s
        if any(last_s < at_s <= time_s + _SAME_TIME_S for at_s in self._releases_s):
            self._released = True
        self._last_s = time_s + _SAME_TIME_S

    def _fresh(self, authority: ReceivedAuthority, time_s: float) -> bool:
        oldest_s = min(self._timeout_s, authority.validity_s) + _SAME_TIME_S
        return time_s - authority.sealed_s <= oldest_s

    def _mode_of(self, location: Location, standing: bool) -> TrainMode:
        if self._on_sight:
            return TrainMode.ON_SIGHT
        if not location.valid:
            return TrainMode.NOT_KNOWN
        return TrainMode.LOCATED if standing else TrainMode.MOVING

    def _judge_on_sight(self, speed_mps: float) -> SupervisionOutput:
        """Warn, brake or release a train that runs on sight."""
        limits, permitted_mps = self._thresholds, self._on_sight_mps
        if speed_mps > permitted_mps + limits.emergency_over_mps:
            self._emergency = "too fast on sight"
        elif speed_mps <= STANDSTILL_MPS:
            self._emergency = ""
        if self._emergency or speed_mps > permitted_mps + limits.service_over_mps:
            self._service = self._emergency or "too fast on sight"
        elif speed_mps <= max(permitted_mps - limits.release_under_mps, 0.5 * permitted_mps):
            self._service = ""
        braked = bool(self._service)
        return SupervisionOutput(
            permitted_mps,
            braked or speed_mps > permitted_mps + limits.warn_over_mps,
            braked,
            bool(self._emergency),
            self._service,
            traction_cut_off=braked,
            on_sight=True,
        )
