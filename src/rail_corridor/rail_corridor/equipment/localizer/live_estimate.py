"""What the localizer on board says of a train, in values and words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from rail_corridor.equipment.live_state import LiveState
from rail_msgs_py.topics.localizer import LOCALIZER_STATE

#: What a position is good for, as ``rail_signals.localizer.protection_level.Status`` counts it.
STATUS = ("unavailable", "unmonitored", "protected")
_MEANING = {
    "protected": "protected: holds even if any one sensor is wrong",
    "unmonitored": "unmonitored: holds unless one certain sensor is wrong",
    "unavailable": "not known",
}


@dataclass(frozen=True)
class LocalizerEstimate:
    """Answer of a localizer.

    Parameters
    ----------
    stamp_ns : int
    track : str
        Empty where it is not known on which one.
    front_m, low_m, high_m, speed_mps : float
        Position and the interval that holds it; NaN and infinite where not available.
    status : str
        One of `STATUS`.
    reason : str
        Why it is not protected; empty if it is.
    left_out : tuple of str
        Sensors that are excluded as faulty.
    """

    stamp_ns: int
    track: str
    front_m: float
    low_m: float
    high_m: float
    speed_mps: float
    status: str
    reason: str
    left_out: tuple[str, ...]

    @property
    def protection_m(self) -> float:
        """Protection level: the train is within ``front_m`` ± this."""
        return max(self.high_m - self.front_m, self.front_m - self.low_m)

    @property
    def known(self) -> bool:
        """Whether there is a position."""
        return self.status != "unavailable" and math.isfinite(self.front_m)

    @property
    def meaning(self) -> str:
        """The status in words."""
        return f"{_MEANING[self.status]}{f' ({self.reason})' if self.reason else ''}"


def estimate_of(state: LiveState, train: str) -> LocalizerEstimate | None:
    """Newest answer of the localizer of a train, None if there is none."""
    table = state.tables.get(LOCALIZER_STATE.name(train=train))
    if table is None or not table.rows or table.columns != LOCALIZER_STATE.columns:
        return None
    return read_estimate(table.row(table.rows[0]), table.stamp_ns, state.first_track(train))


def read_estimate(row: Mapping[str, float], stamp_ns: int, track: str) -> LocalizerEstimate:
    """View of a row of its table."""
    status = min(max(int(row["status"]), 0), 2)
    reason, left_out = _words(int(row["reason"]), int(row["excluded"]))
    return LocalizerEstimate(
        stamp_ns,
        track,
        row["front_m"],
        row["low_m"],
        row["high_m"],
        row["speed_mps"],
        STATUS[status],
        reason,
        left_out,
    )


def error_of(state: LiveState, train: str) -> tuple[float, float, float] | None:
    """Position, low and high end of the localizer, less the truth of its own tick [m]."""
    estimate = estimate_of(state, train)
    if estimate is None or not estimate.known:
        return None
    error_m = state.error_m(train, estimate.track, estimate.front_m, estimate.stamp_ns)
    if error_m is None:
        return None
    true_m = estimate.front_m - error_m
    return error_m, estimate.low_m - true_m, estimate.high_m - true_m


def _words(reason: int, excluded: int) -> tuple[str, tuple[str, ...]]:
    """Reason and excluded sensors; what counts them brings SciPy, which takes time to load."""
    if not reason and not excluded:
        return "", ()
    from rail_signals.localizer.protection_level import ProtectionReason
    from rail_signals.localizer.settings import Sensor

    known = {int(member): member.name for member in ProtectionReason}
    why = known.get(reason, f"reason {reason}").lower().replace("_", " ") if reason else ""
    return why, tuple(s.name.lower() for s in Sensor if excluded >> int(s) & 1)
