"""The runs of a study: cells, and in each the runs from its seeds."""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from .model import Study


@dataclass(frozen=True)
class Case:
    """One run.

    Parameters
    ----------
    cell, run : int
        Its place: numbers from 0.
    seed : int
    values : mapping
        Fields and the values that they have in it.
    """

    cell: int
    run: int
    seed: int
    values: Mapping[str, Any]


def cells_of(study: Study) -> list[dict[str, Any]]:
    """Values of the varied fields, cell by cell, the last field fastest."""
    names = list(study.vary)
    return [
        {**given, **dict(zip(names, values, strict=True))}
        for given in study.cells or ({},)
        for values in itertools.product(*study.vary.values())
    ]


def case_of(study: Study, cells: list[dict[str, Any]], cell: int, run: int) -> Case:
    """Run of a cell; what is drawn depends on its seed and the field alone."""
    seed = study.first_seed + run
    drawn = {
        name: law.value(np.random.default_rng([seed, zlib.crc32(name.encode())]))
        for name, law in study.draw.items()
    }
    return Case(cell, run, seed, {**cells[cell], **drawn})
