"""What the localizer on board says of a train, in figures and words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rail_msgs_py.topics.localizer import LOCALIZER_STATE

if TYPE_CHECKING:
    from .live_state import Picture

#: What a position is good for, as ``rail_signals.localizer.protection_level.Status`` counts it.
STATUS = ("unavailable", "unmonitored", "protected")
_MEANING = {
    "protected": "protected: holds even if any one sensor is wrong",
    "unmonitored": "unmonitored: holds unless one certain sensor is wrong",
    "unavailable": "not known",
}


@dataclass(frozen=True)
class Located:
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


def located(picture: Picture, train: str) -> Located | None:
    """Newest answer of the localizer of a train, None if there is none."""
    table = picture.tables.get(LOCALIZER_STATE.name(train=train))
    if table is None or not table.rows or table.columns != LOCALIZER_STATE.columns:
        return None
    row = table.row(table.rows[0])
    status = min(max(int(row["status"]), 0), 2)
    reason, left_out = _words(int(row["reason"]), int(row["excluded"]))
    return Located(
        table.stamp_ns,
        picture.first_track(train),
        row["front_m"],
        row["low_m"],
        row["high_m"],
        row["speed_mps"],
        STATUS[status],
        reason,
        left_out,
    )


def off_the_truth(picture: Picture, train: str) -> tuple[float, float, float] | None:
    """Position, low and high end of the localizer, less the truth of its own tick [m]."""
    said = located(picture, train)
    if said is None or not said.known:
        return None
    error_m = picture.error_m(train, said.track, said.front_m, said.stamp_ns)
    if error_m is None:
        return None
    true_m = said.front_m - error_m
    return error_m, said.low_m - true_m, said.high_m - true_m


def shown(picture: Picture, train: str, *, gone: bool) -> dict[str, Any] | None:
    """The same for the page."""
    said = located(picture, train)
    if said is None:
        return None
    age_s = max(0.0, (picture.now_ns - said.stamp_ns) * 1e-9)
    made: dict[str, Any] = {
        "status": said.status,
        "reason": said.reason,
        "left_out": said.left_out,
        "track": said.track,
        "age_s": round(age_s, 2),
        "gone": gone,
    }
    if said.known:
        off = off_the_truth(picture, train)
        made |= {
            "at_m": round(said.front_m, 3),
            "low_m": round(said.low_m, 3),
            "high_m": round(said.high_m, 3),
            "protection_m": round(said.protection_m, 3),
            "error_m": None if off is None else round(off[0], 3),
            "holds": None if off is None else off[1] <= 0.0 <= off[2],
        }
    return made


def _words(reason: int, excluded: int) -> tuple[str, tuple[str, ...]]:
    """Reason and excluded sensors; what counts them brings SciPy, which takes time to load."""
    if not reason and not excluded:
        return "", ()
    from rail_signals.localizer.protection_level import Reason
    from rail_signals.localizer.settings import Sensor

    known = {int(member): member.name for member in Reason}
    why = known.get(reason, f"reason {reason}").lower().replace("_", " ") if reason else ""
    return why, tuple(s.name.lower() for s in Sensor if excluded >> int(s) & 1)
