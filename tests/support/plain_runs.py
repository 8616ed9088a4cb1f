"""Runs of an importer with plain steps in C and without, and all their observable facts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.events import LateEvents
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec


class Run:
    """A run of an importer, by plain steps in C or without, and all its observable facts."""

    def __init__(
        self,
        parts: Sequence[ComponentSpec],
        links: Sequence[ConnectionSpec],
        *,
        in_c: bool,
        room: Callable[[int], int] = lambda seen: 1000,
        **options: Any,
    ) -> None:
        self.importer = Importer(parts, links, **options)
        self.importer.steps_in_c = in_c
        self.events: list[tuple[float, int, str]] = []
        self.pauses: list[float] = []
        names = list(self.importer.components)
        self.importer.on_event = lambda e: self.events.append((e.time, e.index, e.component))
        self.importer.on_pause = lambda: self.pauses.append(self.importer.time)
        self.importer.late_events = LateEvents(
            lambda: room(len(self.events)),
            lambda rows: self.events.extend((t, int(i), names[int(k)]) for t, i, k in rows.tolist()),
        )
        self.failure = ""

    def go(self, *ends: float) -> Run:
        """Initialize, and advance to each of these times; a failure ends the run."""
        self.importer.begin()
        try:
            for end in ends:
                self.importer.advance(end)
        except ComponentError as error:
            self.failure = str(error)
        return self

    def facts(self) -> dict[str, Any]:
        """Return all facts that another run must share."""
        importer = self.importer
        found: dict[str, Any] = {
            "events": self.events,
            "pauses": self.pauses,
            "failure": self.failure,
            "steps": (importer.steps, importer.repeated_steps),
            "ends": (importer.time.hex(), importer.wants_to_end, importer.overrun),
        }
        for name, component in importer.components.items():
            instance = component.instance
            found[name, "is"] = instance.time.hex(), instance.changed_rounding, instance.is_fatal
            if not self.failure:
                found[name, "said"] = (
                    instance.returned_early, instance.needs_event_mode, instance.wants_to_end, instance.is_flagged
                )  # fmt: skip
                real = [v for v, known in component.variables.items() if known.type in ("Float64", "Real")]
                scalar = [v for v in real if not component.variables[v].dimensions]
                found[name, "values"] = component.group("Float64", scalar).get().tobytes()
        return found


def both(
    parts: Sequence[ComponentSpec], links: Sequence[ConnectionSpec], *ends: float, **options: Any
) -> Run:
    """Run in C and without; return the run in C, whose facts equal those of the other."""
    runs = [Run(parts, links, in_c=in_c, **options).go(*ends) for in_c in (True, False)]
    facts = [run.facts() for run in runs]
    assert facts[0] == facts[1]
    for run in runs:
        run.importer.free()
    assert runs[0].importer._plan.plain_loop is not None
    return runs[0]
