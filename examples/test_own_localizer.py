"""A localizer of your own in a train of the corridor, and tests that judge it by the truth.

Run:  .venv/bin/python -m pytest examples/test_own_localizer.py
See:  two passed: it is never past its authority, and when a station is off the train goes on.
"""

from math import inf, nan

import numpy as np

from rail_msgs_py.decoders import table_row
from rail_msgs_py.tick_node import EquipmentNode
from rail_msgs_py.topics.localizer import LOCALIZER_STATE, RELAYED_RANGE
from rail_msgs_py.topics.world import ODOMETER
from rail_onboard.localizer.localizer_node import LocalizerParameters

NOT_KNOWN = (0, 0, 0, 0, nan, -inf, inf, nan, -inf, inf, inf, inf, 1)  # as LOCALIZER_STATE.columns


class MyLocalizer(EquipmentNode[LocalizerParameters], name="localizer", namespace="/train_1"):
    """The last range, carried on by the wheels; 15 m further on it does not know any more."""

    def setup(self) -> None:
        """Open the ports: wheels, and ranges that protection relays a tick late."""
        late_ns, train = round(1e9 * self._p.tick_s), self.place
        self.wheels = self.inputs.trigger(ODOMETER, table_row(ODOMETER), train=train)
        relayed = table_row(RELAYED_RANGE)
        self.ranged = self.inputs.port(RELAYED_RANGE, relayed, delay_ns=late_ns, train=train)
        self.send = self.table_out(LOCALIZER_STATE, (train,), awaited=True, train=train)

    def start_over(self) -> None:
        """Know where it was put into service, and nothing else."""
        self.fix_m, self.half_m, self.counted_m = self._p.start_m, self._p.placed_m, 0.0

    def on_tick(self, stamp_ns: int, items: dict) -> None:
        """Publish the front, and an interval that holds it."""
        counted_m, speed_mps = items[self.wheels]
        taken_s, position_m, half_m = items.get(self.ranged) or (nan, nan, inf)
        if np.isfinite(position_m):
            age_s = 1e-9 * stamp_ns - taken_s
            self.fix_m, self.half_m = position_m + speed_mps * age_s, half_m + 1.5 * age_s
            self.counted_m = counted_m
        further_m = counted_m - self.counted_m
        here_m, sure_m = self.fix_m + further_m, self.half_m + 0.05 * further_m
        row = (2, 0, 0, 0, here_m, here_m - sure_m, here_m + sure_m, speed_mps)
        fastest_mps = 1.1 * speed_mps + 0.1
        known = (*row, 0.9 * speed_mps, fastest_mps, sure_m / 3, fastest_mps, 0)
        self.send(stamp_ns, np.array([known if further_m < 15 else NOT_KNOWN], dtype=float))


def test_it_stays_within_its_authority(corridor):
    """For 40 s, in every tick."""
    c = corridor("located_block", seed=3, duration_s=40)
    c.add(MyLocalizer, replaces="/second/localizer")
    end = c.topic("/second/atp/state")
    c.always(lambda: c.truth("second").front_m <= end.latest.end_of_authority_m)
    assert c.run_to_end().verdict == "safe"
    assert c.truth("second").front_m > 800


def test_the_train_goes_on_when_it_is_unsure(corridor):
    """The station of its zone is off: protection has an odometer of its own until ranges come."""
    c = corridor("located_block", seed=3, duration_s=40)
    c.add(MyLocalizer, replaces="/second/localizer")
    c.run_for(30)
    c.switch_off("/wayside/wrs4")
    c.run_for(5)
    assert c.topic("/second/localizer/state").latest.status == 0
    assert not c.topic("/second/atp/command").latest.service_brake
    assert c.run_to_end().verdict == "safe"
