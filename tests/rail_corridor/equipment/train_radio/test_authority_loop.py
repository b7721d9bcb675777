"""Zone controller's desk and train protection, joined by a wire instead of the radio."""

from collections.abc import Mapping

import numpy as np
import pytest

from rail_msgs_py.train_radio.safe_channel import SafeChannel
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_onboard.train_radio.supervision import AuthoritySupervision
from rail_onboard.train_radio.train_location import TrainLocation
from rail_onboard.train_radio.train_modes import ModeSupervision
from rail_onboard.train_radio.train_protection import TrainIdentity, TrainProtection
from rail_wayside.train_radio.authority_issuer import AuthorityIssuer
from rail_wayside.train_radio.moving_block import MovingBlock
from rail_wayside.train_radio.speed_profile import Segment
from rail_wayside.train_radio.train_bounds import TrainStart

SECRET = bytes(range(32))
CONTROLLER = 0xF000
TICK_NS = 250_000_000
LENGTH_M = 100.0


class Corridor:
    """Two trains on a track of 3 km, the first ahead; base station b1 alone is heard."""

    def __init__(
        self,
        placed_m: float = 1.0,
        first_m: float = 1000.0,
        leaves_at_m: Mapping[int, float] | None = None,
    ) -> None:
        starts_m = {1: first_m, 2: 600.0}
        block = MovingBlock(
            [Segment(0, "main", 3000.0, ((0.0, 20.0),))],
            [TrainStart(n, f"t{n}", LENGTH_M, 1, 0, m, placed_m) for n, m in starts_m.items()],
        )
        draw = np.random.default_rng(7).bytes
        channels = {
            n: SafeChannel(SECRET, CONTROLLER, n, (FrameKind.LOCATION_REPORT,), draw)
            for n in starts_m
        }
        self.block = block
        self.desk = AuthorityIssuer(block, channels, ["b1", "b2"], leaves_at_m=leaves_at_m)
        self.trains = {
            n: TrainProtection(
                TrainIdentity(n, 0, start_m, placed_m, LENGTH_M),
                SafeChannel(SECRET, n, CONTROLLER, (FrameKind.MOVEMENT_AUTHORITY,), draw),
                TrainLocation(0.02),
                ModeSupervision(AuthoritySupervision(LENGTH_M)),
            )
            for n, start_m in starts_m.items()
        }
        self.tick = 0
        self.run_m = 0.0
        self.down: dict[int, list[bytes]] = {}
        self.sent: dict[str, list[tuple[int, bytes]]] = {}

    def step(
        self,
        deaf: tuple[int, ...] = (),
        *,
        silent: tuple[int, ...] = (),
        speed_mps: float = 0.0,
    ) -> dict[int, str]:
        """One tick of 250 ms with trains that run at a speed; reasons."""
        self.run_m += 0.25 * speed_mps
        now_ns, self.tick = self.tick * TICK_NS, self.tick + 1
        reasons, up = {}, {}
        for n, train in self.trains.items():
            frames = [] if n in deaf else self.down.get(n, [])
            reasons[n] = train.tick(now_ns, self.run_m, speed_mps, frames).reason
            if n not in silent:
                up[n] = train.frame(now_ns)
        for n, frame in up.items():
            self.desk.receive("b1", n, frame, now_ns)
        self.sent = self.desk.telegrams(now_ns)
        self.down = {}
        for frames in self.sent.values():
            for slot, frame in frames:
                self.down.setdefault(slot, []).append(frame)
        return reasons


def test_trains_may_go_once_the_channels_stand() -> None:
    corridor = Corridor()
    assert set(corridor.step().values()) == {"no authority"}
    for _ in range(8):
        reasons = corridor.step()
    assert set(reasons.values()) == {""}
    ends = {
        n: train.state_values(corridor.tick * TICK_NS)[5] for n, train in corridor.trains.items()
    }
    assert ends[1] == pytest.approx(3000.0 - 20.0)
    # Rear of the first, its uncertainty and the margin.
    assert 600.0 < ends[2] <= 1000.0 - LENGTH_M - 10.0


def test_frames_go_where_the_train_was_heard() -> None:
    corridor = Corridor()
    corridor.step()
    assert {base: len(frames) for base, frames in corridor.sent.items()} == {"b1": 2, "b2": 0}


def test_a_train_that_hears_nothing_brakes_after_the_time_out() -> None:
    corridor = Corridor()
    for _ in range(8):
        corridor.step()
    reasons = [corridor.step(deaf=(2,))[2] for _ in range(16)]
    # 3 s from the time-stamp, which was one tick old, and may have been two: the train knows no
    # least delay.
    assert reasons.index("no authority") == 12 - 2
    assert set(reasons[:10]) == {""} and set(reasons[10:]) == {"no authority"}


def test_counts_tell_what_was_lost() -> None:
    corridor = Corridor()
    for _ in range(8):
        corridor.step()
    before = corridor.trains[2].counts[1]
    for _ in range(3):
        corridor.step(deaf=(2,))
    corridor.step()
    assert corridor.trains[2].counts[1] == before + 3
    given = corridor.desk.authority_state(2, corridor.tick * TICK_NS)
    assert given.lost == 0 and given.accepted > 5 and given.rejected == 0


def test_frames_of_others_do_nothing() -> None:
    corridor = Corridor()
    for _ in range(8):
        corridor.step()
    for_first = corridor.down[1]
    accepted = corridor.trains[2].counts[0]
    corridor.trains[2].tick(corridor.tick * TICK_NS, 0.0, 0.0, for_first)
    assert corridor.trains[2].counts[0] == accepted
    assert corridor.trains[2].counts[2] == len(for_first)
    corridor.desk.receive("b1", 99, bytes(64), 0)  # no such slot


def test_a_range_that_contradicts_the_reports_makes_the_hull_of_both_and_heals() -> None:
    corridor = Corridor(placed_m=5.0)
    for _ in range(8):
        corridor.step()
    for _ in range(4):
        corridor.desk.ranged(1, corridor.tick * 0.25, 0, 1300.0, 0.01**2)
        corridor.step()
    front_m, half_m = corridor.trains[1].state_values((corridor.tick - 1) * TICK_NS)[3:5]
    assert front_m - half_m == pytest.approx(995.0)
    assert front_m + half_m == pytest.approx(1300.0 + 4 * 0.01 + 1.5, abs=0.11)
    for _ in range(4):
        corridor.desk.ranged(1, corridor.tick * 0.25, 0, 1000.4, 0.01**2)
        corridor.step()
    front_m, half_m = corridor.trains[1].state_values((corridor.tick - 1) * TICK_NS)[3:5]
    assert half_m <= 1.65 and abs(front_m - 1000.4) <= 0.01
    assert not corridor.desk.troubles(1)


def test_a_fix_moves_the_location() -> None:
    corridor = Corridor(placed_m=5.0)
    for _ in range(4):
        corridor.step()
    corridor.desk.ranged(1, 1.0, 0, 1000.4, 0.01**2)
    for _ in range(2):
        corridor.step()
    front_m, half_m = corridor.trains[1].state_values((corridor.tick - 1) * TICK_NS)[3:5]
    # Four standard deviations and what they do not see, 1.5 m; rounded up in the telegram.
    assert abs(front_m - 1000.4) <= 0.01
    assert 4.0 * 0.01 + 1.5 <= half_m <= 1.65


def test_a_range_of_no_known_variance_moves_nothing() -> None:
    corridor, untold = Corridor(placed_m=5.0), Corridor(placed_m=5.0)
    for _ in range(4):
        corridor.step()
        untold.step()
    for variance_m2 in (np.inf, np.nan):
        corridor.desk.ranged(1, 1.0, 0, 1000.4, variance_m2)
        corridor.step()
        untold.step()
    now_ns = (corridor.tick - 1) * TICK_NS
    assert corridor.trains[1].state_values(now_ns) == untold.trains[1].state_values(now_ns)
    assert not corridor.desk.troubles(1)


@pytest.mark.parametrize(("speed_mps", "leaves"), [(20.0, True), (5.0, False)])
def test_who_could_not_stop_before_it_left_and_is_silent_has_left(
    speed_mps: float, leaves: bool
) -> None:
    # 20 m/s and 1.5 m/s^2 are 133 m, 5 m/s are 8 m; it is 50 m before the border.
    corridor = Corridor(first_m=2950.0 - 3.0 * speed_mps, leaves_at_m={1: 3000.0})
    for _ in range(12):
        corridor.step(speed_mps=speed_mps)
    assert corridor.block.trains == (1, 2)
    for _ in range(10):
        corridor.step(silent=(1,), speed_mps=speed_mps)
    assert corridor.block.trains == (1, 2)
    for _ in range(4):
        corridor.step(silent=(1,), speed_mps=speed_mps)
    assert corridor.block.trains == ((2,) if leaves else (1, 2))


def test_who_does_not_leave_is_kept_however_fast_he_was() -> None:
    corridor = Corridor(first_m=2950.0)
    for _ in range(12):
        corridor.step(speed_mps=20.0)
    for _ in range(40):
        corridor.step(silent=(1,))
    assert corridor.block.trains == (1, 2)
