#!/usr/bin/env python3
"""Faults put into the sources on purpose: each must make a test fail.

    python tests/mutants.py [--jobs N] [--list] [NAME...]

A test that cannot fail proves nothing, and no run of the tests shows which ones cannot. So here
are faults of the kind that would cost a life: counters that are always zero, checks of
plausibility left out, a protection level twice as wide or half, margins dropped, timeouts ten
times as long. Each is put into a copy of ``src``, never into the checkout, and the few tests that
are to notice it are run on that copy. Shown is a table of faults and of the first test that noticed
each; the exit code is 1 if one was not noticed.

A fault is a file, a text that stands there exactly once and the text that takes its place: short,
so that it is quickly set right when the code around it moves. `tests/house/test_mutants.py` sees
that all of them still apply. What the tests say of the sources as they are is checked first.
"""

from __future__ import annotations

import argparse
import compileall
import multiprocessing
import os
import queue
import re
import shlex
import shutil
import sys
import tempfile
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
_PACKAGES = (
    *("rail_signals", "rail_msgs_py", "rail_world", "rail_wayside", "rail_onboard"),
    "rail_corridor",
)
#: A test run that takes longer hangs: that is noticed, too.
_PATIENCE_S = 90.0
_PASSED, _FAILED = 0, 1  # exit codes of pytest
_FORKS = multiprocessing.get_context("forkserver")
#: Loading these takes longer than most of the tests.
_LOADED_ONCE = (
    *("numpy", "scipy.optimize", "scipy.stats", "scipy.signal", "scipy.interpolate", "pydantic"),
    *("yaml", "typer", "rich.console", "rich.table", "hypothesis", "pytest", "rclpy.lifecycle"),
    *("rclpy.executors", "rclpy.serialization", "rclpy.experimental.events_executor"),
    *("nav_msgs.msg", "sensor_msgs.msg", "std_msgs.msg", "visualization_msgs.msg"),
    *("diagnostic_msgs.msg", "lifecycle_msgs.srv", "rosgraph_msgs.msg"),
    "cryptography.hazmat.primitives.cmac",
    "cryptography.hazmat.primitives.kdf.hkdf",
)

CORRIDOR = "rail_corridor/rail_corridor"
EQUIPMENT = f"{CORRIDOR}/equipment"
ONBOARD = "rail_onboard/rail_onboard"
WAYSIDE = "rail_wayside/rail_wayside"
MESSAGES = "rail_msgs_py/rail_msgs_py/train_radio"
LOCALIZER = "rail_signals/rail_signals/localizer"
_TRACK_CODE_STUDY = "rail_signals/rail_signals/track_code/study"


@dataclass(frozen=True)
class Mutant:
    """One fault.

    Parameters
    ----------
    name : str
    file : str
        Below ``src``.
    old, new : str
        Text that stands there exactly once, and what takes its place.
    tests : tuple of str
        Below ``tests``: files or single tests, as pytest takes them.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]

    def applied_to(self, text: str) -> str:
        """Text of the file with the fault.

        Raises
        ------
        ValueError
            If the old text does not stand there exactly once.
        """
        if text.count(self.old) != 1:
            raise ValueError(f"{self.name}: {self.file}: {text.count(self.old)} times: {self.old}")
        return text.replace(self.old, self.new)


@dataclass(frozen=True)
class Verdict:
    """What became of a fault: who noticed it, or why it is not known; and the time it took."""

    mutant: Mutant
    killed_by: str
    trouble: str
    seconds: float

    def __str__(self) -> str:
        fate = self.killed_by or ("TROUBLE" if self.trouble else "SURVIVED")
        return f"{self.mutant.name:45} {self.seconds:5.1f} s  {fate}"


def _group(file: str, tests: str, *faults: tuple[str, str, str]) -> list[Mutant]:
    """Faults of one file that the same tests are to notice: name, old text, new text.

    ``tests`` are files of tests; where names follow, each after ``::``, only these.
    """
    chosen: list[str] = []
    for word in tests.split():
        path, _, test = word.partition("::")
        if test and not path:
            file_of_it = chosen[-1].partition("::")[0]
            if chosen[-1] == file_of_it:
                chosen.pop()
            chosen.append(f"{file_of_it}::{test}")
        else:
            chosen.append(word)
    return [Mutant(name, file, old, new, tuple(chosen)) for name, old, new in faults]


_REPORTS = "rail_corridor/equipment"
MUTANTS: list[Mutant] = [
    # The tick, its start, and what nodes say of themselves.
    *_group(
        "rail_msgs_py/rail_msgs_py/inbox.py",
        "rail_msgs_py/test_inbox.py rail_msgs_py/test_tick_inputs.py",
        (
            "a closed tick can be filled again",
            "self._latest_taken_ns = max(self._latest_taken_ns, stamp_ns)",
            "pass",
        ),
    ),
    *_group(
        "rail_world/rail_world/world_node.py",
        "nodes/test_world_node.py",
        ("whoever waits is left behind", "if left > 0:", "if left > 99:"),
        (
            "one sign of failure is enough to begin",
            "self._absent and not silent and",
            "self._absent or",
        ),
    ),
    *_group(
        f"{CORRIDOR}/report/intake.py",
        "rail_corridor/report/test_intake.py",
        (
            "repeats are events",
            "if self._health.get(status.name) == (status.level, status.message):",
            "if False:",
        ),
        (
            "what stands is forgotten",
            'self._standing.discard(self._said.get(status.hardware_id, b""))',
            "pass",
        ),
    ),
    *_group(
        f"{CORRIDOR}/recording/parts.py",
        "rail_corridor/recording/test_parts.py",
        (
            "what a part repeats is said again",
            "message.sequence > newest.get(topic, 0)",
            "True",
        ),
        ("a part of another recording is taken", "if not same or", "if"),
    ),
    *_group(
        f"{CORRIDOR}/report/from_recording.py",
        "rail_corridor/recording/test_parts.py",
        ("a report of what was not recorded is made", "    if names:", "    if not names:"),
    ),
    *_group(
        "rail_msgs_py/rail_msgs_py/map_pose.py",
        "rail_msgs_py/test_map_pose.py rail_corridor/report/test_map_poses.py",
        ("a slope is none of the covariance", "* (1.0 + self.slope**2)", "* 1.0"),
    ),
    # Counters and thresholds of the report.
    *_group(
        f"{EQUIPMENT}/ranging/report.py",
        f"{_REPORTS}/ranging/test_verdicts.py",
        (
            "wrong_track_ticks is 0",
            'wrong_track_ticks": int(np.count_nonzero(errors.wrong_track))',
            'wrong_track_ticks": 0',
        ),
        (
            "misleading_ticks is 0",
            'misleading_ticks": int(np.count_nonzero(misleading))',
            'misleading_ticks": 0',
        ),
        ("60 sigma mislead", "_MISLEADING_SIGMAS = 6.0", "_MISLEADING_SIGMAS = 60.0"),
        ("10 m mislead", "_MISLEADING_M = 1.0", "_MISLEADING_M = 10.0"),
        (
            "a position that is no number does not mislead",
            "known & ~(usable & (np.abs(error_m) <= allowed_m))",
            "found.wrong_track | (usable & (np.abs(error_m) > allowed_m))",
        ),
        ("a track that nobody knows is the last", "(track < 0) | np.isnan", "np.isnan"),
        ("missed handovers are 0", '"missed": expected - made', '"missed": 0'),
        ("wrong handovers are 0", '"wrong": wrong,', '"wrong": 0,'),
    ),
    *_group(
        f"{EQUIPMENT}/supervision_report.py",
        f"{_REPORTS}/train_radio/test_verdicts.py",
        ("overspeed is 0", "float(np.count_nonzero(over) * scenario.tick_s)", "0.0"),
        ("nobody is above what is permitted", "np.count_nonzero(beyond) * scenario.tick_s", "0.0"),
        ("overspeed from 5 m/s on", "OVERSPEED_MPS = 0.5", "OVERSPEED_MPS = 5.0"),
        ("gaps to fronts, not rears", "front_m - train.vehicle.length_m", "front_m"),
        ("trains side by side do not touch", "(front_m >= mine", "(front_m > mine"),
    ),
    *_group(
        f"{EQUIPMENT}/track_code/report.py",
        f"{_REPORTS}/track_code/test_verdicts.py",
        ("wrong messages are 0", '"wrong": int(wrong)', '"wrong": 0'),
        ("occupied blocks entered are 0", "return entered", "return 0"),
        ("a rear at the border is inside", "rear_m < ends_m", "rear_m <= ends_m"),
    ),
    *_group(
        f"{EQUIPMENT}/track_code/claims.py",
        f"{_REPORTS}/track_code/test_verdicts.py",
        ("a word may be 80 s old", "OLDEST_S: Final = 8.0", "OLDEST_S: Final = 80.0"),
    ),
    *_group(
        f"{EQUIPMENT}/train_radio/report.py",
        f"{_REPORTS}/train_radio/test_verdicts.py",
        ("passed_authority is 0", "return passed, withdrawn", "return 0, withdrawn"),
        (
            "once withdrawn, excused for ever",
            "excused and front_m[tick] <= stands_by_m",
            "excused",
        ),
        (
            "no authority is no end",
            "np.where(none, -math.inf, end_m)",
            "np.where(none, math.inf, end_m)",
        ),
        ("every cut is an excuse", "if cut and end_m", "if cut or end_m"),
        (
            "mislocated is 0",
            '{"mislocated": int(np.count_nonzero(mislocated))}',
            '{"mislocated": 0}',
        ),
        (
            "a place that is no number is right",
            "(half_m != math.inf) & ~(error_m <= half_m)",
            "(half_m != math.inf) & (error_m > half_m)",
        ),
    ),
    *_group(
        f"{EQUIPMENT}/train_radio/threat_metrics.py",
        f"{_REPORTS}/train_radio/test_verdicts.py",
        ("forged authorities are 0", "return forged\n", "return 0\n"),
        ("forged reports are 0", '"forged_reports": forged', '"forged_reports": 0'),
        ("10 cm are rounding", "_ROUNDING_M = 0.011", "_ROUNDING_M = 0.11"),
    ),
    *_group(
        f"{EQUIPMENT}/localizer/report.py",
        f"{_REPORTS}/localizer/test_verdicts.py",
        ("exceeded is 0", '"exceeded": int(np.count_nonzero(~holds))', '"exceeded": 0'),
        (
            "an interval that is no number holds",
            "(low_m <= truth_m) & (truth_m <= high_m)",
            "~((low_m > truth_m) | (truth_m > high_m))",
        ),
    ),
    *_group(
        f"{EQUIPMENT}/train_bus/report.py",
        f"{_REPORTS}/train_bus/test_verdicts.py",
        ("false reports of the bus are 0", "len(reports) - len(true)", "0"),
    ),
    *_group(
        f"{CORRIDOR}/run_data.py",
        "rail_corridor/report/test_run_data.py",
        ("no tick is missing", "int(np.count_nonzero(~np.logical_and.reduce(received)))", "0"),
    ),
    # Campaigns.
    *_group(
        f"{CORRIDOR}/studies/builtin/handover.yaml",
        "rail_corridor/studies/test_verdicts.py",
        (
            "false places violate nothing",
            "phase_ranging.misleading_ticks, take: sum, over_runs: sum, must_be: 0",
            "phase_ranging.misleading_ticks, take: sum, over_runs: sum",
        ),
        (
            "missed handovers violate nothing",
            "handovers.missed, take: sum, over_runs: sum, must_be: 0",
            "handovers.missed, take: sum, over_runs: sum",
        ),
    ),
    *_group(
        f"{CORRIDOR}/studies/builtin/kills.yaml",
        "rail_corridor/studies/test_verdicts.py",
        ("to touch is no collision", "at_least: 0.001", "at_least: 0.0"),
    ),
    *_group(
        f"{CORRIDOR}/studies/kills.py",
        "rail_corridor/studies/test_verdicts.py",
        ("any death is that of the node", 'failed["node"] == node', "True"),
        ("every run went on", 'report["complete"] and report["ticks"] == ticks', "True"),
    ),
    *_group(
        f"{CORRIDOR}/study/summary.py",
        "rail_corridor/studies/test_verdicts.py",
        ("nothing is a violation", "if figure.violated_by(", "if not figure.violated_by("),
    ),
    *_group(
        f"{CORRIDOR}/study/stopping.py",
        "rail_corridor/study/test_figures.py",
        (
            "a cell ends as runs come in",
            "while self.ended is None and self.seen in self._waiting",
            "while self._waiting",
        ),
        ("an interval is never narrow", "found.half_width <= rule", "found.half_width > rule"),
    ),
    *_group(
        f"{CORRIDOR}/study/intervals.py",
        "rail_corridor/study/test_figures.py",
        ("intervals of means are too narrow", "math.sqrt(n)", "n"),
    ),
    *_group(
        f"{CORRIDOR}/studies/threats.py",
        "rail_corridor/studies/test_verdicts.py"
        " ::test_the_oracle_sees_other_content_than_was_sealed"
        " rail_corridor/studies/test_threats.py ::test_the_oracle_sees_a_missing_check"
        " ::test_the_oracle_sees_frames_that_are_too_old",
        ("other content is accepted", "accepted.payload != sealed.payload or ", "False and "),
        ("what is old is accepted", "> _MAX_AGE_NS:", "> 1000 * _MAX_AGE_NS:"),
        (
            "what was accepted is accepted again",
            "sealed.order <= self._newest",
            "-1 > self._newest",
        ),
    ),
    *_group(
        f"{LOCALIZER}/study/campaign.py",
        "rail_signals/localizer/study/test_verdicts.py",
        ("the campaign counts nothing", "int(which.sum())", "0"),
        ("no fault is found late", "int((delays_s > most_s).sum())", "0"),
        ("no alarm is false", "int(alarmed.sum())", "0"),
        ("no exclusion is wrong", "int(wrong.sum())", "0"),
    ),
    *_group(
        "rail_signals/rail_signals/train_bus/study/campaign.py",
        "rail_signals/train_bus/study/test_verdicts.py",
        ("located within 5 m", "max(0.5, 0.01 *", "max(5.0, 0.01 *"),
    ),
    *_group(
        f"{CORRIDOR}/studies/integrity.py",
        "rail_corridor/studies/test_integrity_study.py",
        (
            "misleading positions of the study are 0",
            '"misleading": counted.misleading,',
            '"misleading": 0,',
        ),
        ("every world is as believed", "WORLDS[parameters.world]", "WORLDS[AS_BELIEVED]"),
        (
            "a fault that is never found is found at once",
            "found if math.isfinite(found) else None",
            "found if math.isfinite(found) else 0.0",
        ),
    ),
    *_group(
        f"{CORRIDOR}/studies/train_bus.py",
        "rail_corridor/studies/test_train_bus_study.py",
        ("any name is the right one", "result.reported == fault", "is_reported"),
        ("no healthy train is flagged", 'counts["flagged"] += is_reported', "pass"),
    ),
    # Ranging.
    *_group(
        f"{WAYSIDE}/ranging/association.py",
        "rail_wayside/ranging/test_association.py",
        ("trains may pass each other", "or (distance_m > 0.0) == known", "or True"),
        (
            "one of two ways is taken",
            "if matching is not None and next(matchings, None) is None",
            "if matching",
        ),
    ),
    *_group(
        f"{WAYSIDE}/ranging/zone_map.py",
        "rail_wayside/ranging/test_zone_map.py",
        (
            "nothing is too near for a zone",
            "> 1.0 + 4.0 * variance_m2",
            "> 1e9 + 4.0 * variance_m2",
        ),
        ("nothing is too far for a zone", "excess_m > 4.0 *", "excess_m > 40.0 *"),
    ),
    *_group(
        f"{WAYSIDE}/ranging/train_tracker.py",
        "rail_wayside/ranging/test_train_tracker.py"
        " ::test_a_reading_that_jumps_is_not_believed"
        " ::test_a_train_that_was_lost_is_known_a_second_and_a_half_after_it_is_found",
        ("the gate is ten times as wide", "GATE_M = 12.0", "GATE_M = 120.0"),
        ("6 sigma of the gate are 60", "SIGMAS = 6.0", "SIGMAS = 60.0"),
        ("a train that was lost is known at once", "CONFIRMED_S = 1.5", "CONFIRMED_S = 0.0"),
    ),
    *_group(
        f"{WAYSIDE}/ranging/ranging_station.py",
        "rail_wayside/ranging/test_ranging_station.py"
        " ::test_two_trains_are_told_and_give_no_range"
        " ::test_two_tones_that_cannot_tell_the_cycle_give_no_range",
        ("two signals make a range", "if second_signal(", "if False and second_signal("),
        ("a cycle that is not known is taken", "if math.isnan(range_m):", "if False:"),
    ),
    *_group(
        f"{ONBOARD}/ranging/downlink_check.py",
        "rail_onboard/ranging/test_downlink_check.py",
        ("a jammed tone is returned", "> self._jamming_mw:", "> 1e9:"),
        ("two stations' tone is returned", "if second_signal(", "if False and second_signal("),
    ),
    # Track codes.
    *_group(
        "rail_signals/rail_signals/track_code/word.py",
        "rail_signals/track_code/test_word.py ::test_one_two_or_three_wrong_bits_never_pass",
        ("check bits are not looked at", "word >> degree) != check:", "word >> degree) < 0:"),
    ),
    *_group(
        "rail_signals/rail_signals/track_code/hop_kernel.py",
        "rail_signals/track_code/test_kernels.py",
        ("a clipped sample too many passes", "count <= marks[2]", "count <= marks[2] + 1"),
        ("loud samples pass", "0 < peak <= marks[1]", "0 < peak"),
    ),
    *_group(
        "rail_signals/rail_signals/track_code/slot_kernel.py",
        "rail_signals/track_code/test_receiver.py ::test_every_decision_is_that_of_the_chain"
        " ::test_a_level_in_no_window_is_no_word",
        ("no change is noticed", "is_changed[hop] = change_hz >", "is_changed[hop] = 0.0 >"),
        ("a level in no window passes", "clear &= (level <= limits[1]) |", "clear &= True |"),
    ),
    *_group(
        f"{_TRACK_CODE_STUDY}/words.py",
        "rail_signals/track_code/study/test_words.py",
        (
            "one right check bit passes a random word",
            "(found == self.syndrome).all(axis=-1)",
            "(found == self.syndrome).any(axis=-1)",
        ),
    ),
    *_group(
        f"{_TRACK_CODE_STUDY}/low_rate_chain.py",
        "rail_signals/track_code/study/test_low_rate_chain.py",
        (
            "any two valid slots confirm a word",
            "valid[:, 1:] & valid[:, :-1] & same",
            "valid[:, 1:] & valid[:, :-1]",
        ),
        ("noise of the levels is not looked at", "clear & quiet &", "clear &"),
    ),
    *_group(
        f"{_TRACK_CODE_STUDY}/chain_errors.py",
        "rail_signals/track_code/study/test_chain_errors.py",
        (
            "undetected wrong messages are 0",
            "undetected += int(np.count_nonzero(valid & ~right))",
            "pass",
        ),
        (
            "words made of noise are 0",
            "errors += int(np.count_nonzero(decided.confirmed[:, 1:]))",
            "pass",
        ),
    ),
    *_group(
        f"{_TRACK_CODE_STUDY}/fit_errors.py",
        "rail_signals/track_code/study/test_fit_errors.py",
        ("no message of a fit is wrong", "(found != sent)", "(found != found)"),
        ("slots count before a word is found", "k >= first and (k", "(k"),
    ),
    *_group(
        f"{CORRIDOR}/studies/track_code_errors.py",
        "rail_corridor/studies/test_track_code_errors.py",
        ("track code errors of the study are 0", '"errors": counted.errors,', '"errors": 0,'),
    ),
    *_group(
        f"{WAYSIDE}/track_code/code_logic.py",
        "rail_wayside/track_code/test_code_logic.py ::test_unknown_is_occupied"
        " ::test_the_last_block_before_the_overlap_ends_at_a_stand",
        ("not known is free", "if occupied[index] is False", "if not occupied[index]"),
        ("no overlap is kept", "if free >= self._overlap", "if free >= 0"),
    ),
    *_group(
        f"{ONBOARD}/track_code/supervision.py",
        "rail_onboard/track_code/test_supervision.py"
        " ::test_the_response_time_itself_is_forgiven ::test_to_pass_a_stop_trips_the_train",
        (
            "a code may be ten times as old",
            "> self._delays.response_s + 1e-9",
            "> 10.0 * self._delays.response_s",
        ),
        (
            "a stop may be passed",
            "self._passed_stop |= speed_mps",
            "self._passed_stop |= 0.0 * speed_mps",
        ),
    ),
    # Braking and authorities.
    *_group(
        f"{ONBOARD}/braking_curve.py",
        "rail_onboard/train_radio/test_supervision.py"
        " ::test_the_permitted_speed_leaves_just_the_way_to_stop_before_the_end"
        " ::test_a_fall_and_the_error_of_the_speed_count_at_both_ends",
        (
            "motors stop at once",
            "self.traction_mps2 * pull_s + fall_mps2 * wait_s\n",
            "fall_mps2 * wait_s\n",
        ),
        (
            "no fall takes from the brake",
            "[-self.gradients.steepest_fall_permil], 0.0)",
            "[0.0], 0.0)",
        ),
        (
            "the speed is exact",
            "true_mps = (1.0 + self.speed_error) *",
            "true_mps = 1.0 *",
        ),
    ),
    *_group(
        f"{ONBOARD}/train_radio/authority_curves.py",
        "rail_onboard/train_radio/test_supervision.py"
        " rail_onboard/train_radio/test_braking_safety.py",
        ("no margin before the end", "min(rolling_m - self._margin_m, overlap_m)", "rolling_m"),
        ("the front is where it is believed", "s + location.uncertainty_m, s -", "s, s -"),
        ("the rear leaves a limit at once", "if to_m > place.rear_m:", "if to_m > place.front_m:"),
    ),
    *_group(
        f"{ONBOARD}/train_radio/supervision.py",
        "rail_onboard/train_radio/test_supervision.py"
        " ::test_the_permitted_speed_leaves_just_the_way_to_stop_before_the_end"
        " ::test_communication_is_lost_by_the_age_of_the_authority"
        " ::test_the_emergency_curve_to_the_end_itself"
        " ::test_old_and_future_authorities_and_those_out_of_order_are_ignored"
        " ::test_a_train_that_does_not_know_where_it_is_stops",
        (
            "an authority may be ten times as old",
            "authority.sealed_s > oldest_s",
            "authority.sealed_s > 10.0 * oldest_s",
        ),
        ("old authorities are obeyed", "authority.sealed_s > self._authority.sealed_s", "True"),
        ("without a place a train goes on", 'return "" if located else', 'return "" if True else'),
    ),
    *_group(
        f"{ONBOARD}/train_radio/train_location.py",
        "rail_onboard/train_radio/test_train_location.py"
        " ::test_a_fix_is_brought_to_now_by_the_odometer"
        " ::test_fixes_that_contradict_each_other_leave_the_hull_until_one_agrees",
        (
            "the wheels are exact",
            "interval.high_m += most_m",
            "interval.high_m += distance_m - last.distance_m",
        ),
        (
            "a contradiction is not noticed",
            "if known is not None and known.overlaps(low_m, high_m):",
            "if False:",
        ),
    ),
    *_group(
        f"{ONBOARD}/train_radio/train_protection.py",
        "nodes/test_atp_node.py::test_what_others_sealed_or_sealed_for_others_is_refused",
        (
            "the authority of another train is obeyed",
            "telegram.direction) != mine:",
            "telegram.direction) == ():",
        ),
    ),
    *_group(
        f"{WAYSIDE}/train_radio/moving_block.py",
        "rail_wayside/train_radio/test_moving_block.py"
        " ::test_the_end_lies_a_margin_behind_the_worst_rear_ahead"
        " ::test_trains_in_the_wrong_order_must_stop"
        " ::test_a_train_that_turns_up_further_back_occupies_both_and_is_told_less",
        ("no margin behind a train", "end_m = before_m - self._margin_m", "end_m = before_m"),
        ("authorities end a metre further on", "direction * end_m,", "direction * end_m + 1.0,"),
        ("trains out of order run on", "stop = inverted(bounds)", "stop = False"),
        ("who may be ahead is told no less", "end_m -= bounds.lead_m", "end_m -= 0.0"),
    ),
    *_group(
        f"{WAYSIDE}/train_radio/train_bounds.py",
        "rail_wayside/train_radio/test_moving_block.py"
        " ::test_a_range_that_disagrees_makes_the_hull_until_a_new_one_agrees"
        " ::test_a_leap_is_not_believed_until_it_is_possible_or_ranged"
        " ::test_without_integrity_the_rear_does_not_advance",
        ("a range never contradicts", "if self._apart(self._report, self._range):", "if False:"),
        ("a leap is believed", "if self._apart(self._proven, where):", "if False:"),
        ("ranges of 60 sigma", "self._sigmas * sigma_m", "10.0 * self._sigmas * sigma_m"),
        ("a train that is not whole is", "if not self.no_integrity:", "if True:"),
    ),
    # The safe channel.
    *_group(
        f"{MESSAGES}/safe_channel.py",
        "rail_msgs_py/train_radio/test_safe_channel.py"
        " ::test_every_single_bit_matters ::test_repetition_and_order"
        " ::test_a_session_is_given_up_after_silence"
        " ::test_wrong_train_wrong_way_wrong_kind_and_wrong_key"
        " ::test_recorded_greetings_neither_make_nor_cut_a_session",
        ("any safety code will do", "return code.matches(frame)", "return True"),
        ("frames are taken again", "if number > newest:", "if number >= newest:"),
        ("frames are taken in any order", "if number > newest:", "if number != newest:"),
        ("any kind is taken", "header.kind not in self._accepts:", "header.kind > 15:"),
        ("any address will do", "if header.source != self.peer or", "if False and"),
    ),
    *_group(
        f"{MESSAGES}/safe_channel.py",
        "rail_msgs_py/train_radio/test_unit_channel.py"
        " ::test_no_frame_passes_that_was_held_back_longer_than_the_limit"
        " ::test_a_jump_of_the_peers_clock_is_named"
        " ::test_a_jump_that_hides_a_delay_is_bounded_by_ones_own_clock",
        (
            "frames of any age are taken",
            "RejectionReason.TOO_OLD if age.most_ns > self._max_age_ns else None",
            "None",
        ),
        ("a clock may jump", "return Rejected(RejectionReason.CLOCK_JUMPED)", "pass"),
    ),
    *_group(
        f"{MESSAGES}/clock_offset.py",
        "rail_msgs_py/train_radio/test_unit_channel.py"
        " ::test_clocks_that_are_wrong_and_drift_cost_nothing"
        " ::test_no_frame_passes_that_was_held_back_longer_than_the_limit",
        ("bounds do not grow", "bounds[1] + grown_ns", "bounds[1] - grown_ns"),
        (
            "an age is that of the fastest clock",
            "now_ns - stamp_ns + high",
            "now_ns - stamp_ns + low",
        ),
    ),
    *_group(
        f"{MESSAGES}/safe_frame.py",
        "rail_msgs_py/train_radio/test_safe_channel.py"
        " ::test_a_frame_is_one_burst_and_stands_as_documented ::test_every_single_bit_matters"
        " ::test_what_is_thrown_back_at_its_sender_has_another_key",
        ("half of the safety code counts", "frame[_CODE_AT:])", "frame[_CODE_AT:_CODE_AT + 4])"),
        ("both directions have one key", 'b"direction" + pair', 'b"direction"'),
    ),
    *_group(
        f"{MESSAGES}/train_channel.py",
        "rail_msgs_py/train_radio/test_unit_channel.py"
        " ::test_frames_may_be_three_ticks_old_or_a_second"
        " ::test_no_two_starts_have_one_nonce_in_whatever_process"
        " ::test_what_was_recorded_before_a_restart_is_of_no_use_after_it",
        ("frames may be 3 s old", "max(1.0, 3.0 * settings", "max(3.0, 3.0 * settings"),
        ("nonces come again after a restart", "own, peer, stamp_ns]", "own, peer]"),
    ),
    # The localizer.
    *_group(
        f"{LOCALIZER}/protection_level.py",
        "rail_signals/localizer/test_integrity_monitor.py",
        (
            "the protection level is doubled",
            "half = self._sigmas * sigma",
            "half = 2.0 * self._sigmas * sigma",
        ),
        (
            "the protection level is halved",
            "half = self._sigmas * sigma",
            "half = 0.5 * self._sigmas * sigma",
        ),
        (
            "only the likeliest counts",
            "low = np.where(hull, low, np.inf).min(axis=-1)",
            "low = low[..., 0]",
        ),
        (
            "any width is given",
            "middle - low)[S] <= self._claim.widest_m",
            "middle - low)[S] <= 1e9",
        ),
    ),
    *_group(
        f"{LOCALIZER}/integrity_monitor.py",
        "rail_signals/localizer/test_integrity_monitor.py",
        (
            "the threshold is ten times as high",
            "claim.threshold(_TESTS) ** 2",
            "(10.0 * claim.threshold(_TESTS)) ** 2",
        ),
        (
            "the threshold is halved",
            "claim.threshold(_TESTS) ** 2",
            "(0.5 * claim.threshold(_TESTS)) ** 2",
        ),
        ("two that may be faulty are one", "(left.sum(axis=-1) == 1)", "(left.sum(axis=-1) >= 1)"),
    ),
    *_group(
        f"{ONBOARD}/localizer/protected_interval.py",
        "rail_onboard/localizer/test_protected_interval.py",
        ("doubted wheels are believed", "if self.wheels_doubted:", "if False:"),
    ),
    # Restarts, slides, circuits that lie.
    *_group(
        f"{ONBOARD}/train_radio/train_protection.py",
        "nodes/test_atp_node.py::test_switched_off_it_brakes_and_on_again_it_knows_nothing",
        ("who restarts stands where it started", "if time_ns == 0:", "if True:"),
    ),
    *_group(
        f"{ONBOARD}/train_radio/odometer_watch.py",
        "rail_onboard/train_radio/test_odometer_watch.py",
        ("a way may be as short as it likes", "if counted_m < least_m - slack_m:", "if False:"),
    ),
    *_group(
        "rail_wayside/rail_wayside/train_radio/authority_issuer.py",
        "rail_corridor/equipment/train_radio/test_faults_and_liveness.py"
        "::test_a_controller_restarted_gives_nothing_until_old_authorities_are_over_and_trains_stand",
        ("a restarted controller knows its trains", "if time_s > 0.0:", "if False:"),
    ),
    *_group(
        "rail_wayside/rail_wayside/track_code/detector.py",
        "rail_wayside/track_code/test_detector.py",
        ("noise clears a circuit", "LEAST_COHERENCE: Final = 0.6", "LEAST_COHERENCE: Final = 0.0"),
    ),
]


class Copies:
    """Copies of the sources, each lent to one fault at a time.

    Parameters
    ----------
    directory : Path
    count : int
    """

    def __init__(self, directory: Path, count: int) -> None:
        self._free: queue.Queue[Path] = queue.Queue()
        for number in range(count):
            copy = directory / str(number) / "src"
            shutil.copytree(ROOT / "src", copy, ignore=shutil.ignore_patterns("*.egg-info"))
            # Compiled once: a run of tests would compile all that it imports each time.
            compileall.compile_dir(str(copy), quiet=2)
            self._free.put(copy)

    def run(self, mutant: Mutant) -> Verdict:
        """Put a fault into a copy, run its tests there, and take it out again."""
        copy = self._free.get()
        path, begun = copy / mutant.file, time.perf_counter()
        text, stat = path.read_text(encoding="utf-8"), path.stat()
        try:
            path.write_text(mutant.applied_to(text), encoding="utf-8")
            code, output = run_tests(copy, mutant.tests)
        except ValueError as error:
            return Verdict(mutant, "", str(error), 0.0)
        finally:
            path.write_text(text, encoding="utf-8")
            os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
            self._free.put(copy)
        killed_by = trouble = ""
        if code is None:
            killed_by = f"no end within {_PATIENCE_S:g} s"
        elif code == _FAILED:
            killed_by = _first_failure(output)
        elif code != _PASSED:
            trouble = f"the tests ended with {code}:\n{output[-2000:]}"
        return Verdict(mutant, killed_by, trouble, time.perf_counter() - begun)

    def check(self, mutants: Iterable[Mutant]) -> str:
        """What the tests of all the faults say of the sources without any; empty if they pass."""
        copy = self._free.get()
        tests = sorted({test for mutant in mutants for test in mutant.tests})
        code, output = run_tests(copy, tests, patience_s=4 * _PATIENCE_S)
        self._free.put(copy)
        return "" if code == _PASSED else output or "no end"


def run_tests(
    copy: Path, tests: Sequence[str], patience_s: float = _PATIENCE_S
) -> tuple[int | None, str]:
    """Run tests of the checkout on a copy of the sources, up to the first that fails.

    Returns the exit code of pytest, None if it did not end, and what it printed.
    """
    with tempfile.NamedTemporaryFile(mode="r", errors="replace") as log:
        # A process of its own, forked from one that has loaded everybody else's packages.
        process = _FORKS.Process(target=_pytest, args=(str(copy), tuple(tests), log.name))
        process.start()
        process.join(patience_s)
        ended = not process.is_alive()
        process.kill()
        process.join()
        return (process.exitcode if ended else None), log.read()


def _pytest(copy: str, tests: tuple[str, ...], log: str) -> None:
    """Run in the process of its own."""
    import pytest

    with open(log, "wb") as stream:
        for number in (1, 2):
            os.dup2(stream.fileno(), number)
    # Byte code of a fault must not be taken for that of the sources, nor the other way round.
    sys.dont_write_bytecode = True
    os.chdir(ROOT)
    paths = " ".join(shlex.quote(f"{copy}/{package}") for package in _PACKAGES)
    arguments = ["-q", "-x", "-rfE", "--tb=no", "--no-header", "-p", "no:cacheprovider"]
    arguments += ["-o", f"pythonpath={paths}", *(f"{ROOT}/tests/{test}" for test in tests)]
    sys.exit(int(pytest.main(arguments)))


def _first_failure(output: str) -> str:
    found = re.search(r"^(?:FAILED|ERROR) (?:tests/)?(.+?)(?: - .*)?$", output, re.MULTILINE)
    return found.group(1) if found else "a test"


def judge(mutants: Sequence[Mutant], jobs: int) -> int:
    """Run all of them, print the table; return the exit code."""
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="rail_mutants_") as directory:
        copies = Copies(Path(directory), jobs)
        with ThreadPoolExecutor(jobs) as pool:
            sound = pool.submit(copies.check, mutants)
            verdicts = []
            for verdict in pool.map(copies.run, mutants):
                verdicts.append(verdict)
                print(verdict, flush=True)
            broken = sound.result()
    code = conclude(verdicts, broken)
    print(f"in {time.perf_counter() - begun:.0f} s")
    return code


def conclude(verdicts: Sequence[Verdict], broken: str) -> int:
    """Print what is wrong, and how many were noticed; return the exit code."""
    for verdict in verdicts:
        if verdict.trouble:
            print(f"{verdict.mutant.name}: {verdict.trouble}")
    if broken:
        print(f"tests fail on the sources as they are:\n{broken}")
    killed = sum(bool(verdict.killed_by) for verdict in verdicts)
    print(f"{killed} of {len(verdicts)} mutants killed")
    return 1 if broken or killed < len(verdicts) else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the faults named, or all."""
    parser = argparse.ArgumentParser(description="Faults that the tests must notice.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="only those whose name has this")
    parser.add_argument("--jobs", type=int, default=2, help="so many at a time")
    parser.add_argument("--list", action="store_true", help="print what there is, run nothing")
    options = parser.parse_args(arguments)
    chosen = [
        mutant
        for mutant in MUTANTS
        if not options.names or any(name in mutant.name for name in options.names)
    ]
    if options.list:
        for mutant in chosen:
            print(f"{mutant.name:42} {mutant.file}")
        return 0
    if not chosen:
        parser.error(f"no mutant is called {' or '.join(options.names)}")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    _FORKS.set_forkserver_preload(list(_LOADED_ONCE))
    return judge(chosen, max(1, options.jobs))


if __name__ == "__main__":
    sys.exit(main())
