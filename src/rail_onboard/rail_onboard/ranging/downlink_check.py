"""Whether the tone of a downlink may be returned.

The transponder makes a new, clean signal of the phase it has measured. The station sees the noise
of the uplink only, and takes that of the downlink to be alike; a phase that a jammer or a second
station has moved it would take for good. So what the train cannot measure well it does not return.
"""

from __future__ import annotations

import math

from rail_signals.ranging.interference import JAMMING_LIMIT_DB, second_signal


class DownlinkCheck:
    """Judges received bursts.

    Parameters
    ----------
    noise_mw : float
        Receiver noise expected in a burst; infinite = jamming is not looked for.
    samples : int
        Length of a burst.

    Examples
    --------
    >>> check = DownlinkCheck(1e-10, 960)
    >>> check.disturbance(amplitude=1e-4, snr=100.0, reduced chi-square=1.0)
    ''
    >>> check.disturbance(amplitude=1e-4, snr=100.0, reduced chi-square=90.0)
    'hears more than one station'
    >>> check.disturbance(amplitude=1e-4, snr=1.0, reduced chi-square=1.0)
    'channel jammed'
    """

    def __init__(self, noise_mw: float, samples: int) -> None:
        self._jamming_mw = noise_mw * 10.0 ** (JAMMING_LIMIT_DB / 10.0)
        self._samples = samples

    def disturbance(self, *, amplitude: float, snr: float, reduced_chi_square: float) -> str:
        """Return the reason not to return the tone of a burst, empty if it may be.

        Parameters
        ----------
        amplitude, snr, reduced_chi_square : float
            As in `rail_signals.ranging.receiver.ToneEstimate`.
        """
        if not (snr > 0.0 and math.isfinite(amplitude)):
            return "cannot read the tone"
        if amplitude**2 / snr > self._jamming_mw:
            return "channel jammed"
        if second_signal(reduced_chi_square, snr, self._samples):
            return "hears more than one station"
        return ""
