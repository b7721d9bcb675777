"""Poses of trains in ``map``, aligned with the track: ``geometry_msgs/PoseWithCovarianceStamped``.

The pose of a point of the track: x points along it towards increasing chainage, whichever way the
train runs, y to the left, z up from the sleepers (REP 103). With heading psi and slope g the point
moves by

    d = (cos psi, sin psi, g)

for each metre of chainage, which is measured in plan. So a variance s^2 of the chainage is one of
s^2 d d^T in ``map``. A train stays on its track, but a covariance that were singular would be of no
use to a filter: across the track, up and in each angle it has the variance of what the model of
the line leaves out - sway, cant, the reach of the suspension.

The covariance is that of the message: rows and columns x, y, z and the rotations about the axes of
``map``. The truth is exact, all of it zero.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from numpy.typing import NDArray

from .stamps import NANOSECONDS, to_ns

FRAME: Final = "map"
#: Standard deviations across the track and up [m], about its x (cant is up to 0.1), y and z [rad].
OFF_TRACK_M: Final = (0.1, 0.1)
TURN_RAD: Final = (0.1, 0.01, 0.01)


@dataclass(frozen=True)
class MapPose:
    """Where a train is in ``map``.

    Parameters
    ----------
    stamp_ns : int
        Simulated time.
    x_m, y_m, z_m : float
    heading_rad : float
        Of the track, counter-clockwise from x.
    slope : float
        Rise per metre of chainage.
    variance_m2 : float or None
        Of the chainage, finite; None for the truth.
    """

    stamp_ns: int
    x_m: float
    y_m: float
    z_m: float
    heading_rad: float
    slope: float
    variance_m2: float | None = None

    @property
    def axes(self) -> NDArray[np.float64]:
        """Directions of the axes of the track in ``map``, as columns [map, track]."""
        cos_h, sin_h = math.cos(self.heading_rad), math.sin(self.heading_rad)
        long = math.hypot(1.0, self.slope)
        cos_p, sin_p = 1.0 / long, self.slope / long
        return np.array(
            [
                [cos_h * cos_p, -sin_h, -cos_h * sin_p],
                [sin_h * cos_p, cos_h, -sin_h * sin_p],
                [sin_p, 0.0, cos_p],
            ]
        )

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance in ``map`` [6, 6]."""
        whole = np.zeros((6, 6))
        if self.variance_m2 is None:
            return whole
        along_m2 = self.variance_m2 * (1.0 + self.slope**2)
        axes = self.axes
        whole[:3, :3] = axes * [along_m2, *np.square(OFF_TRACK_M)] @ axes.T
        whole[3:, 3:] = axes * np.square(TURN_RAD) @ axes.T
        return whole

    def to_msg(self) -> PoseWithCovarianceStamped:
        """Message form."""
        message = PoseWithCovarianceStamped()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(self.stamp_ns, NANOSECONDS)
        message.header.frame_id = FRAME
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        place.x, place.y, place.z = self.x_m, self.y_m, self.z_m
        # First the slope about y, where up is negative, then the heading about z.
        half_h, half_p = 0.5 * self.heading_rad, -0.5 * math.atan(self.slope)
        turn.x = -math.sin(half_h) * math.sin(half_p)
        turn.y = math.cos(half_h) * math.sin(half_p)
        turn.z = math.sin(half_h) * math.cos(half_p)
        turn.w = math.cos(half_h) * math.cos(half_p)
        message.pose.covariance = self.covariance.ravel()
        return message

    @classmethod
    def from_msg(cls, message: Any) -> MapPose:
        """View of a message; the heading is that within half a turn of x."""
        place, turn = message.pose.pose.position, message.pose.pose.orientation
        x, y, z, w = turn.x, turn.y, turn.z, turn.w
        ahead = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w))
        level = math.hypot(*ahead[:2])
        covariance = np.reshape(message.pose.covariance, (6, 6))
        along_m2 = float(np.array(ahead) @ covariance[:3, :3] @ np.array(ahead))
        return cls(
            to_ns(message.header.stamp),
            place.x,
            place.y,
            place.z,
            math.atan2(ahead[1], ahead[0]),
            ahead[2] / level if level else math.inf,
            along_m2 * level**2 if covariance.any() else None,
        )

    def describe(self) -> str:
        """In words, without the time."""
        sure = "" if self.variance_m2 is None else f" ± {math.sqrt(self.variance_m2):.3f} m along"
        return (
            f"x {self.x_m:.2f} m, y {self.y_m:.2f} m, z {self.z_m:.2f} m{sure}, "
            f"heading {math.degrees(self.heading_rad):.1f}°, {1e3 * self.slope:+.1f} ‰"
        )
