"""What must be so at the start of a run, and what a scenario is worth a warning for."""

from __future__ import annotations

from collections.abc import Sequence

from rail_corridor.errors import InputError
from rail_corridor.scenario.model import Scenario
from rail_world.trains.motion import TrainMotion
from rail_world.trains.occupancy import Fouling, overlaps
from rail_world.trains.traffic import occupant

_COARSE_TICK_S = 0.5
_LONGEST_CLIMB_S = 7200.0


def check_start(
    scenario: Scenario, motions: Sequence[TrainMotion], train_fields: Sequence[str]
) -> None:
    """Raise InputError for trains in one place at the start, or too fast to stop before another.

    Those that enter later wait at their entrance until it is free.
    """
    fouling = Fouling(scenario.network)
    there = [
        (index, motion)
        for index, motion in enumerate(motions)
        if motion.state != "waiting" or not motion.description.enters_at_departure
    ]
    occupants = [occupant(index, motion, fouling) for index, motion in there]
    for first, second, stretch in overlaps(occupants):
        raise InputError(
            f"{motions[first].name} is in the same place, {stretch.track} at {stretch.low_m:.0f} m",
            field=f"{train_fields[second]}.start_m",
            value=motions[second].description.start_m,
        )
    for index, motion in there:
        if motion.speed_mps == 0.0:
            continue
        mine = occupant(index, motion, fouling, abs(motion.speed_mps))
        for other in occupants:
            if other.train == index or next(overlaps((mine, other)), None) is None:
                continue
            raise InputError(
                f"is too fast to stop before {motions[other.train].name}",
                field=f"{train_fields[index]}.speed_kmh",
                value=motion.description.speed_kmh,
            )


def climbing_troubles(scenario: Scenario) -> list[str]:
    """A line for each train that would come to a stand on a rise, running alone and unhindered."""
    troubles = []
    for train in scenario.trains:
        alone = train.model_copy(
            update={"depart_s": 0.0, "dwell_s": 0.0, "reverse_at": (), "enters_at_departure": False}
        )
        motion = TrainMotion(alone, scenario.network, _COARSE_TICK_S)
        steepest = 1e-3 * max(abs(motion.route.gradients_permil.values).tolist())
        if motion.vehicle.gravity_mps2 * steepest < motion.vehicle.traction_mps2(0.0):
            continue
        while motion.time_s < _LONGEST_CLIMB_S and motion.state != "arrived":
            motion.step()
            if motion.state == "running" and motion.speed_mps == 0.0 and not motion.pulls:
                troubles.append(
                    f"{train.name} cannot climb: alone on the line it comes to a stand at"
                    f" {motion.chainage_m:.0f} m of {motion.track}"
                )
                break
    return troubles
