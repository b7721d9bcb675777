"""What equipment asks of trains that it only knows on one track, one way."""

from __future__ import annotations

from collections.abc import Sequence

from rail_corridor.errors import InputError
from rail_corridor.scenario.model import Scenario


def check_one_way(scenario: Scenario, train_fields: Sequence[str], section: str) -> None:
    """Raise InputError for a train that runs over several tracks or turns back."""
    for train, field in zip(scenario.trains, train_fields, strict=True):
        for name, several in (("route", len(train.route) > 1), ("reverse_at", train.reverse_at)):
            if several:
                raise InputError(
                    f"{section} goes with trains that run on one track, one way only",
                    field=f"{field}.{name}",
                    value=len(getattr(train, name)),
                )
