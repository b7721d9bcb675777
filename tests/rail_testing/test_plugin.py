"""The plug-in, in test suites of its own: what the marker does, and what a failure leaves."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from mcap.reader import make_reader

pytest_plugins = ["pytester"]
pytestmark = pytest.mark.system
POSITION = "/wayside/zone_controller/train_a/position"

SUITE = """
import random
import pytest
from nav_msgs.msg import Odometry
from rclpy.node import Node
from std_msgs.msg import Float64

POSITION = "/wayside/zone_controller/train_a/position"

class Dice(Node):
    drawn = random.Random()

    def __init__(self):
        super().__init__("dice")
        self.send = self.create_publisher(Float64, "/dice", 10)
        self.create_subscription(Odometry, POSITION, self.throw, 10)

    def throw(self, message):
        late = message.header.stamp.nanosec >= 500_000_000
        self.send.publish(Float64(data=self.drawn.random() if late else 1.0))

@pytest.mark.rail(repeat=True)
def test_dice(corridor):
    c = corridor("plain_line", duration_s=1.0)
    c.add(Dice)
    c.run_to_end()

@pytest.mark.rail(repeat=True)
def test_same(corridor):
    corridor("plain_line", duration_s=1.0).run_to_end()

def test_fails(corridor):
    c = corridor("plain_line", seed=5)
    c.always(lambda: c.time_s < 0.6)
    c.run_for(2)

@pytest.mark.rail(seeds=[1, 2])
class TestVariants:
    @pytest.mark.rail(placements=["one"])
    def test_variants(self, corridor):
        c = corridor("plain_line", duration_s=0.3)
        assert c.placement == "one" and c.seed in (1, 2)
        c.run_to_end()
"""


def test_a_suite_of_a_tester(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(SUITE)
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider", "-p", "no:xdist")
    result.assert_outcomes(passed=3, failed=2)
    said = result.stdout.str()
    # Nothing but the dice differs, from the sixth tick on.
    assert re.search(r"two runs differ.*: tick 5: /dice: data: .*, then ", said)
    assert "tick 7 (0.70 s): does not hold: lambda: c.time_s < 0.6" not in said
    assert "tick 6 (0.60 s): does not hold: lambda: c.time_s < 0.6" in said
    assert "plain_line, seed 5, tick 6 (0.60 s)" in said
    assert re.search(r"again: \S+ -m pytest '.*::test_fails'", said)
    found = re.search(r"recording: (\S*test_fails\S*\.mcap)", said)
    assert found is not None
    with Path(found[1]).open("rb") as stream:
        messages = make_reader(stream).iter_messages(topics=[POSITION])
        assert len(list(messages)) == 7
