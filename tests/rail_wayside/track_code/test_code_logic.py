"""The code logic: fields by hand, and that following the codes is always safe and possible."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rail_signals.track_code.scales import GRAVITY_MPS2, SPEEDS_KMH, CodeScales, deceleration_mps2
from rail_wayside.track_code.code_logic import Block, CodeLogic

KMH = 1.0 / 3.6
BLOCKS = st.builds(
    Block,
    st.floats(300.0, 1600.0),
    st.floats(25.0, 330.0).map(lambda kmh: kmh * KMH),
    st.floats(-35.0, 35.0),
)
LINES = st.lists(BLOCKS, min_size=1, max_size=15)


def speeds(fields: dict[str, int]) -> tuple[float, float]:
    now, end = divmod(fields["speed"], 16)
    return SPEEDS_KMH[now] * KMH, SPEEDS_KMH[end] * KMH


def plain(blocks: list[Block], **more: float) -> CodeLogic:
    """Return a logic without reaction nor overspeed: pure braking."""
    settings = {"reaction_s": 0.0, "overspeed_mps": 0.0, **more}
    return CodeLogic(blocks, **settings)  # type: ignore[arg-type]


# Fields -----------------------------------------------------------------------------------


def test_the_last_block_before_the_overlap_ends_at_a_stand() -> None:
    logic = plain([Block(1000.0, 100.0)] * 6)
    codes = logic.all_fields([False, False, False, False, True, False])
    # Occupied is 4, its overlap 3: in 3 nothing moves, 2 ends at a stand, 1 at its entry.
    assert [speeds(code) for code in codes[2:4]] == [(100 * KMH, 0.0), (0.0, 0.0)]
    assert math.sqrt(2 * 0.5 * 1000.0) / KMH > 100.0  # 113.8 km/h: 100 is the largest below
    now, end = speeds(codes[1])
    assert end == 100 * KMH
    # From (100 km/h)^2 + 2 b L comes 151.7 km/h: 130 is the largest speed below.
    assert now == 130 * KMH


@pytest.mark.parametrize(("overlap", "stands"), [(0, 4), (1, 3), (2, 2)])
def test_the_end_of_the_line_is_occupied(overlap: int, stands: int) -> None:
    logic = CodeLogic([Block(800.0, 60.0)] * 5, overlap=overlap)
    codes = logic.all_fields([False] * 5)
    assert [speeds(code)[1] == 0.0 for code in codes] == [n >= stands for n in range(5)]
    assert [speeds(code)[0] == 0.0 for code in codes] == [n > stands for n in range(5)]


def test_unknown_is_occupied() -> None:
    logic = CodeLogic([Block(800.0, 60.0)] * 6)
    for place in range(5):
        known: list[bool | None] = [False] * 5
        unknown = list(known)
        known[place], unknown[place] = True, None
        assert logic.fields(unknown) == logic.fields(known)


def test_its_own_occupancy_has_no_part_in_a_code() -> None:
    logic = CodeLogic([Block(800.0, 60.0)] * 6)
    rest: list[bool | None] = [False, False, False, True, False]
    codes = [logic.all_fields([own, *rest])[0] for own in (True, False, None)]
    assert codes == [logic.fields(rest)] * 3


@given(LINES, st.data())
def test_more_occupied_never_allows_more(blocks: list[Block], data: st.DataObject) -> None:
    logic = CodeLogic(blocks)
    some = data.draw(st.lists(st.booleans(), min_size=len(blocks), max_size=len(blocks)))
    more = data.draw(st.lists(st.booleans(), min_size=len(blocks), max_size=len(blocks)))
    fewer, both = (
        logic.all_fields(some),
        logic.all_fields([a or b for a, b in zip(some, more, strict=True)]),
    )
    for free, taken in zip(fewer, both, strict=True):
        assert all(a >= b for a, b in zip(speeds(free), speeds(taken), strict=True))


@given(st.floats(0.0, 120.0), st.floats(1.0, 2000.0), st.floats(-50.0, 60.0))
def test_fields_are_rounded_to_the_safe_side(
    speed_mps: float, length_m: float, gradient_permil: float
) -> None:
    scales = CodeScales()
    assert SPEEDS_KMH[scales.speed_index(speed_mps)] <= 3.6 * speed_mps + 1e-6
    assert 25.0 * scales.length_index(length_m) <= length_m + 1e-6
    assert 5.0 * (scales.gradient_index(gradient_permil) - 10) <= gradient_permil + 1e-6
    for limit, index in ((16, scales.speed_index(speed_mps)), (64, scales.length_index(length_m))):
        assert 0 <= index < limit


def test_every_speed_of_the_table_is_coded_by_itself() -> None:
    scales = CodeScales()
    assert [scales.speed_index(kmh / 3.6) for kmh in SPEEDS_KMH] == list(range(16))


def test_bad_parameters_are_refused() -> None:
    with pytest.raises(ValueError, match="steeper than any"):
        CodeLogic([Block(500.0, 20.0, -51.0)])
    with pytest.raises(ValueError, match="blocks"):
        CodeLogic([])
    with pytest.raises(ValueError, match="16 rising"):
        CodeScales(speeds_kmh=(0.0, 10.0))
    with pytest.raises(ValueError, match="length_m"):
        Block(0.0, 20.0)
    with pytest.raises(ValueError, match="not 1"):
        CodeLogic([Block(500.0, 20.0)]).fields([False])


def test_a_long_train_keeps_the_limit_until_its_rear_is_out() -> None:
    blocks = [Block(500.0, limit) for limit in (22.0, 10.0, 22.0, 22.0, 22.0, 22.0, 22.0)]
    short = CodeLogic(blocks).all_fields([False] * 7)
    long = CodeLogic(blocks, longest_train_m=400.0).all_fields([False] * 7)
    assert speeds(short[2])[0] > 10.0 >= speeds(long[2])[0]
    assert speeds(long[1])[0] <= 10.0
    assert speeds(long[3])[0] > 10.0


# Following the codes ----------------------------------------------------------------------


@settings(max_examples=80)
@given(LINES, st.data(), st.floats(0.4, 1.2), st.floats(0.0, 8.0), st.floats(0.0, 2.0))
def test_from_every_code_the_next_can_be_reached(
    blocks: list[Block], data: st.DataObject, braking_mps2: float, t: float, w: float
) -> None:
    """The rule itself, on the true lengths and gradients."""
    occupied = data.draw(
        st.lists(st.sampled_from([True, False, None]), min_size=len(blocks), max_size=len(blocks))
    )
    logic = CodeLogic(blocks, braking_mps2=braking_mps2, reaction_s=t, overspeed_mps=w)
    codes = logic.all_fields(occupied)
    line = list(zip(blocks, codes, strict=True))
    for block, code in line:
        now, end = speeds(code)
        assert end <= now <= block.limit_mps + 1e-9
        b = deceleration_mps2(braking_mps2, block.gradient_permil)
        if now > end:
            assert now * t + ((now + w) ** 2 - end**2) / (2.0 * b) <= block.length_m + 1e-6
    for (_, code), (_, following) in pairwise(line):
        assert speeds(code)[1] <= speeds(following)[0]
    for index in range(len(blocks)):
        ahead = occupied[index + 1 : index + 3]
        if len(ahead) < 2 or ahead[0] is not False or ahead[1] is not False:
            assert codes[index]["speed"] & 15 == 0


@settings(max_examples=40)
@given(LINES, st.integers(0, 14), st.floats(0.5, 1.0))
def test_a_train_with_the_stated_braking_keeps_every_limit_and_never_enters(
    blocks: list[Block], taken: int, braking_mps2: float
) -> None:
    """A point mass that runs as fast as the codes let it, its brake exactly as stated."""
    occupied = [index >= 1 and index == min(taken, len(blocks) - 1) for index in range(len(blocks))]
    codes = plain(blocks, braking_mps2=braking_mps2).all_fields(occupied)
    speed_mps = speeds(codes[0])[1]
    for index, (block, code) in enumerate(zip(blocks, codes, strict=True)):
        now, end = speeds(code)
        assert speed_mps <= now + 1e-9  # what the last code let it enter with
        assert not occupied[index] or index == 0
        b = deceleration_mps2(braking_mps2, block.gradient_permil)
        # Closed form: from the speed now the brake reaches the end speed within the block.
        slowest_mps = math.sqrt(max(0.0, now**2 - 2.0 * b * block.length_m))
        assert slowest_mps <= end + 1e-9
        assert now <= block.limit_mps + 1e-9
        speed_mps = end
        if end == 0.0:
            break
    else:
        pytest.fail("ran out of the line")


def test_where_a_fall_takes_the_brake_no_braking_is_counted_on() -> None:
    steep = Block(1500.0, 40.0, -50.0)
    codes = CodeLogic([steep] * 5, braking_mps2=0.5).all_fields([False] * 5)
    assert {code["speed"] for code in codes} == {0}


def test_gravity_acts_in_full_downhill_only() -> None:
    assert deceleration_mps2(0.6, -10.0) == pytest.approx(0.6 - 0.01 * GRAVITY_MPS2)
    assert 0.6 < deceleration_mps2(0.6, 10.0) < 0.6 + 0.01 * GRAVITY_MPS2
