"""What tells interference from noise in a received ranging burst, at either end of a link."""

from __future__ import annotations

#: Noise this far above that of the receiver is a jammer [dB].
JAMMING_LIMIT_DB = 6.0
#: Residuals of the components this far above the noise are another signal (chi-square per degree of
#: freedom).
CHI_SQUARE_LIMIT = 6.0
#: ... if they also hold this fraction of the signal. A second train 40 m or more from the first is
#: told down to -20 dB; what is missed moves the range by its relative amplitude times c / 4 pi f.
RESIDUAL_FRACTION = 1e-5


def second_signal(
    reduced_chi_square: float, snr: float, samples: int, limit: float = CHI_SQUARE_LIMIT
) -> bool:
    """Whether a burst holds more than one signal.

    Parameters
    ----------
    reduced_chi_square, snr : float
        As in `rail_signals.ranging.receiver.ToneEstimate`.
    samples : int
        Length of the burst.
    limit : float
        Reduced chi-square above which it counts.

    Examples
    --------
    >>> second_signal(90.0, 100.0, 960), second_signal(1.0, 100.0, 960)
    (True, False)
    """
    return reduced_chi_square > limit and reduced_chi_square / (snr * samples) > RESIDUAL_FRACTION
