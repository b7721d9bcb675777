"""The cost of a place by Doppler shifts, and its minimum by Gauss and Newton.

In plain floats: with some five stations and three unknowns arrays cost more than they save.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

from .surveyed_line import SurveyedLine

Unknowns = tuple[float, float, float]
"""Chainage [m], speed [m/s], offset at the carrier [Hz]."""

#: Of a symmetric matrix [3, 3]: 00, 01, 02, 11, 12, 22.
Symmetric = tuple[float, float, float, float, float, float]

_MOST_STEPS = 12
# A step of Gauss and Newton leaves its square over the distance of the nearest station.
_STEP_M, _STEP_MPS = 0.02, 1e-3
_MOST_STEP_M = 20.0


@dataclass(frozen=True)
class ReceivedShift:
    """One station of a block: its antenna [m], its shift and what that depends on.

    The shift is ``per_mps v C(s, v) + scale delta``, C the mean rate; ``weight`` is one over the
    variance [1/Hz^2].
    """

    x_m: float
    y_m: float
    z_m: float
    shift_hz: float
    weight: float
    per_mps: float
    scale: float


@dataclass(frozen=True)
class Minimum:
    """A minimum of the cost, with the curvature of its parabola there."""

    at: Unknowns
    cost: float
    normal: Symmetric


class ShiftCost:
    """The cost of a place, a speed and an offset.

    Parameters
    ----------
    line : SurveyedLine
    received : sequence of ReceivedShift
    averaging_time_s : float
        `doppler_plan.TonePlan.averaging_time_s`.
    speed, offset : (float, float)
        What is known beforehand: mean, and one over the variance.
    """

    def __init__(
        self,
        line: SurveyedLine,
        received: Sequence[ReceivedShift],
        averaging_time_s: float,
        speed: tuple[float, float],
        offset: tuple[float, float],
    ) -> None:
        self._line, self._tau_s = line, averaging_time_s
        self._received = [
            (h.x_m, h.y_m, h.z_m, h.shift_hz, h.weight, h.per_mps, h.scale) for h in received
        ]
        self._speed, self._offset = speed, offset

    def __call__(self, at: Unknowns) -> float:
        """Weighted squares of what is left of shifts and priors."""
        s, v, delta = at
        frames = self._line.frame(s - v * self._tau_s), self._line.frame(s + v * self._tau_s)
        (mean_v, weight_v), (mean_d, weight_d) = self._speed, self._offset
        total = weight_v * (v - mean_v) ** 2 + weight_d * (delta - mean_d) ** 2
        for sx, sy, sz, shift, weight, per_mps, scale in self._received:
            rate = 0.0
            for px, py, pz, tx, ty, tz, _, _, _ in frames:
                dx, dy, dz = px - sx, py - sy, pz - sz
                rate += (dx * tx + dy * ty + dz * tz) / sqrt(dx * dx + dy * dy + dz * dz)
            total += weight * (shift - per_mps * v * 0.5 * rate - scale * delta) ** 2
        return total

    def step(self, at: Unknowns) -> tuple[Unknowns, float, Symmetric]:
        """Step of Gauss and Newton, the cost where it leads, and the normal matrix.

        The cost is that of a parabola.
        """
        s, v, delta = at
        run_m = v * self._tau_s
        frames = self._line.frame(s - run_m), self._line.frame(s + run_m)
        (mean_v, weight_v), (mean_d, weight_d) = self._speed, self._offset
        off_v, off_d = mean_v - v, mean_d - delta
        n00, n01, n02, n11, n12, n22 = 0.0, 0.0, 0.0, weight_v, 0.0, weight_d
        f0, f1, f2 = 0.0, weight_v * off_v, weight_d * off_d
        total = f1 * off_v + f2 * off_d
        for sx, sy, sz, shift, weight, per_mps, scale in self._received:
            rates, bends = [], []
            for px, py, pz, tx, ty, tz, bx, by, bz in frames:
                dx, dy, dz = px - sx, py - sy, pz - sz
                distance = sqrt(dx * dx + dy * dy + dz * dz)
                rate = (dx * tx + dy * ty + dz * tz) / distance
                turn = tx * tx + ty * ty + tz * tz + dx * bx + dy * by + dz * bz
                rates.append(rate)
                bends.append((turn - rate * rate) / distance)
            mean = 0.5 * (rates[0] + rates[1])
            left = shift - per_mps * v * mean - scale * delta
            by_s = per_mps * v * 0.5 * (bends[0] + bends[1])
            by_v = per_mps * (mean + 0.5 * run_m * (bends[1] - bends[0]))
            ws, wv = weight * by_s, weight * by_v
            n00 += ws * by_s
            n01 += ws * by_v
            n02 += ws * scale
            n11 += wv * by_v
            n12 += wv * scale
            n22 += weight * scale * scale
            f0 += ws * left
            f1 += wv * left
            f2 += weight * scale * left
            total += weight * left * left
        normal = (n00, n01, n02, n11, n12, n22)
        c00, c01, c02, c11, c12, c22 = inverse(normal)
        step = (
            c00 * f0 + c01 * f1 + c02 * f2,
            c01 * f0 + c11 * f1 + c12 * f2,
            c02 * f0 + c12 * f1 + c22 * f2,
        )
        return step, total - f0 * step[0] - f1 * step[1] - f2 * step[2], normal

    def minimum(self, at: Unknowns, window_m: tuple[float, float], worst: float) -> Minimum | None:
        """The minimum near a place.

        None if it is not within the window, its cost is above `worst`, or it is not reached.
        """
        for _ in range(_MOST_STEPS):
            (ds, dv, dd), cost, normal = self.step(at)
            if cost > worst or not abs(ds) < 1e9:
                return None
            # No farther than where the rates keep their shape, and not far off the line.
            fraction = min(1.0, _MOST_STEP_M / max(abs(ds), 1e-9))
            s = at[0] + fraction * ds
            inside = window_m[0] <= s <= window_m[1]
            at = (
                min(max(s, window_m[0]), window_m[1]),
                at[1] + fraction * dv,
                at[2] + fraction * dd,
            )
            if inside and fraction * abs(ds) < _STEP_M and fraction * abs(dv) < _STEP_MPS:
                return Minimum(at, self(at), normal)
        return None


def inverse(matrix: Symmetric) -> Symmetric:
    """Inverse of a symmetric matrix [3, 3]; of a singular one infinite."""
    a, b, c, d, e, f = matrix
    # Scaled to unit diagonal, so that rank is seen whatever the units.
    if not (a > 0.0 and d > 0.0 and f > 0.0):
        return (float("inf"),) * 6
    p, q, r = 1.0 / sqrt(a), 1.0 / sqrt(d), 1.0 / sqrt(f)
    b, c, e = b * p * q, c * p * r, e * q * r
    determinant = 1.0 - b * b - c * c - e * e + 2.0 * b * c * e
    if not determinant > 0.0:
        return (float("inf"),) * 6
    over = 1.0 / determinant
    return (
        (1.0 - e * e) * over * p * p,
        (c * e - b) * over * p * q,
        (b * e - c) * over * p * r,
        (1.0 - c * c) * over * q * q,
        (b * c - e) * over * q * r,
        (1.0 - b * b) * over * r * r,
    )
