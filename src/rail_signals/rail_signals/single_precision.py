"""Elementary functions in single precision for compiled kernels: no branches, no calls.

A loop over them becomes vector instructions, and a value is the same in any loop on any machine,
which those of NumPy and of the C library do not promise. Errors are below 2e-7 of the largest
value.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rail_signals.compiled import compiled

_ONE, _HALF = np.float32(1.0), np.float32(0.5)
_QUARTER_RAD = np.float32(0.5 * math.pi)
# Moshier, Cephes, 1989: sinf and cosf between -pi/4 and pi/4.
_S3, _S5, _S7 = (
    np.float32(-1.6666654611e-1),
    np.float32(8.3321608736e-3),
    np.float32(-1.9515295891e-4),
)
_C4, _C6, _C8 = (
    np.float32(4.1666645683e-2),
    np.float32(-1.3887316255e-3),
    np.float32(2.4433157118e-5),
)
# Added and taken away again, it leaves the nearest whole number, to the even one at a half.
_WHOLE = 1.5 * 2.0**52
# The same: atanf below the tangent of an eighth of pi.
_A3, _A5, _A7, _A9 = (
    np.float32(-3.33329491539e-1),
    np.float32(1.99777106478e-1),
    np.float32(-1.38776856032e-1),
    np.float32(8.05374449538e-2),
)
_ZERO, _PI, _EIGHTH_RAD = np.float32(0.0), np.float32(math.pi), np.float32(0.25 * math.pi)
_TANGENT = np.float32(math.tan(math.pi / 8))


@compiled
def nearest_whole(value: Any) -> Any:
    """The whole number nearest to a double below 2^51 in magnitude."""
    return (value + _WHOLE) - _WHOLE


@compiled
def phasor(quarter: Any, angle: Any) -> Any:
    """Cosine and sine of ``quarter`` quarter turns and ``angle`` more.

    Parameters
    ----------
    quarter : int
        Taken modulo 4.
    angle : float32
        From -1/2 to 1/2 [quarter turns].

    Returns
    -------
    float32, float32
    """
    x = angle * _QUARTER_RAD
    z = x * x
    sine = x + x * z * (_S3 + z * (_S5 + z * _S7))
    cosine = _ONE - _HALF * z + z * z * (_C4 + z * (_C6 + z * _C8))
    odd = (quarter & 1) != 0
    real = sine if odd else cosine
    imag = cosine if odd else sine
    real = -real if ((quarter + 1) & 2) != 0 else real
    imag = -imag if (quarter & 2) != 0 else imag
    return real, imag


@compiled
def phasor_of_turns(turns: Any) -> Any:
    """Cosine and sine [float32] of ``2 pi turns``, a double; whole turns are taken out of it."""
    quarters = 4.0 * (turns - nearest_whole(turns))
    whole = nearest_whole(quarters)
    return phasor(np.int32(whole), np.float32(quarters - whole))


@compiled
def angle(real: Any, imag: Any) -> Any:
    """Angle [rad] of a complex number of two float32, from -pi to pi; 0 of zero."""
    wide, high = abs(real), abs(imag)
    large = high if high > wide else wide
    small = wide if high > wide else high
    # Above an eighth of pi it is counted from a quarter.
    is_large = small > _TANGENT * large
    over = small - large if is_large else small
    under = small + large if is_large else large
    x = over / (under if under > _ZERO else _ONE)
    z = x * x
    found = x + x * z * (_A3 + z * (_A5 + z * (_A7 + z * _A9)))
    found = found + (_EIGHTH_RAD if is_large else _ZERO)
    found = _QUARTER_RAD - found if high > wide else found
    found = _PI - found if real < _ZERO else found
    return -found if imag < _ZERO else found
