"""Train protection that does not protect, and the test that catches it.

Run:  .venv/bin/python -m pytest examples/test_wrong_atp.py
See:  two passed: the corridor's own keeps behind a train that stops, the wrong one is caught.
"""

import numpy as np
import pytest

from rail_onboard.train_radio.atp_node import AtpNode


class CarelessAtp(AtpNode, name="atp", namespace="/train_1"):
    """Lets its driver run at 22 m/s, whatever its authority."""

    def setup(self) -> None:
        """Open the ports of its kind, but say what it likes."""
        super().setup()
        command = self._command
        self._command = lambda stamp_ns, _: command(stamp_ns, np.array([[22.0, *[0.0] * 5]]))


def behind_a_train_that_stops(corridor):
    """A corridor whose first train stops, and what must hold behind it."""
    c = corridor("moving_block", seed=3, duration_s=80)
    c.inject({"kind": "train_stop", "train": "first", "from_s": 20, "to_s": 80})
    c.always(
        lambda: c.truth("second").front_m <= c.topic("/second/atp/state").latest.end_of_authority_m
    )
    return c


def test_the_corridors_own_keeps_behind(corridor):
    """And so the run is safe."""
    assert behind_a_train_that_stops(corridor).run_to_end().verdict == "safe"


def test_a_careless_one_is_caught(corridor):
    """In the very tick in which it passes its end of authority."""
    c = behind_a_train_that_stops(corridor)
    c.add(CarelessAtp, replaces="/second/atp")
    with pytest.raises(AssertionError, match=r"tick \d+ .*end_of_authority_m"):
        c.run_to_end()
    assert c.verdict().violations["trains.second.atp.passed_authority"] > 0
