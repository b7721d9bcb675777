"""The page of a run: from each clause to its tests, their verdicts, their recordings."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from .bench import Settings
from .results import Results

_TEMPLATE = "page.html"


def page_of(settings: Settings, results: Results, made_at: datetime | None = None) -> str:
    """One HTML page that needs no other file."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(_TEMPLATE).render(
        kind=settings.kind,
        command=" ".join(settings.command),
        scenario=settings.scenario or settings.kind.scenario["name"],
        seed=settings.seed,
        results=results,
        clauses=results.by_clause(),
        made_at=(made_at or datetime.now(timezone.utc)).strftime("%Y-%m-%d %H:%M UTC"),
    )
