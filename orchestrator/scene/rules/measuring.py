"""Rules of the measuring chain: scenes that can have one, and dependencies between its tables and the stops."""

from __future__ import annotations

from collections.abc import Iterator

from vibroimpact.orchestrator.scene.draft import Draft
from vibroimpact.orchestrator.scene.keys import CHAIN_TABLES
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.measuring_models import MOST_INSTANTS, RING_INSTANTS
from vibroimpact.orchestrator.scene.problems import Problem, quoted

NOISY = {"sensor": "sensor", "load_cell": "load_cell", "drive": "exciter"}
"""Keys of `[noise]`, each with the table that it needs."""


def _written(draft: Draft) -> tuple[str, ...]:
    """Return the tables of a chain in a scene; a sensor counts as one of them if it has a range."""
    tables = tuple(name for name in CHAIN_TABLES if name in draft.document)
    return (*tables, "sensor.range") if "range" in draft.written("sensor") else tables


def chain_suits_the_scene(draft: Draft) -> Iterator[Problem]:
    """Only oscillators and beams in SI units can have a measuring chain, and only in fused runs."""
    tables = _written(draft)
    first = next((name for name in draft.channels if name.startswith("sensor.")), "")
    for where in tables or ((f"record.time_series: {first}",) if first else ()):
        if draft.body is not None and not draft.body.CAN_BE_MEASURED:
            name = draft.body.NAME
            hint = f"Its place on {name} is not known: remove it."
            yield Problem(where, "a measuring chain of an oscillator or a beam", f"one beside {name}", hint)
        elif draft.header and draft.header.units == "nondimensional":
            hint = 'Volts are SI: give the scene in units = "SI".'
            yield Problem(where, "a scene in SI units beside it", "a nondimensional one", hint)
        elif draft.written("execution").get("how") == "coupled":
            yield Problem(where, 'how = "fused" beside it', '"coupled"', "Remove execution.how.")


def replays_measure_nothing(draft: Draft) -> Iterator[Problem]:
    """A replay has no measuring chain, since its recording has been through a chain of its own."""
    if draft.replay is None:
        return
    for name in _written(draft):
        if name != "exciter":
            hint = "A recording has been through a chain of its own: remove it."
            yield Problem(name, "none beside [replay]", "one", hint)
    if "exciter" in draft.document and draft.replay.drive != "force":
        hint = "The channel that drives is then the voltage of the exciter."
        yield Problem("exciter", 'drive = "force" beside it in [replay]', quoted(draft.replay.drive), hint)
    span = draft.span("exciter.distance") if draft.exciter else None
    if span and span[1] > 0.0:
        hint = "The force that a recording drives is linear between its samples: use 0."
        yield Problem("exciter.distance", "none beside [replay]", quoted(span[1]), hint)


def load_cell_has_a_stop(draft: Draft) -> Iterator[Problem]:
    """A load cell is behind a stop; behind a rigid stop, it needs a duration of its impacts."""
    cell = draft.load_cell
    if cell is None:
        return
    if cell.stop > len(draft.stops):
        expected = f"a stop of the scene, 1 to {len(draft.stops)}" if draft.stops else "a scene with [[stop]]"
        yield Problem("load_cell.stop", expected, str(cell.stop), "Stops count from 1.")
        return
    stop, given = draft.stops[cell.stop - 1], draft.span("load_cell.contact_duration")
    if stop is None:
        return
    rigid = LAWS[stop.law].is_rigid
    if rigid and given is None:
        hint = "An impact on a rigid stop is seen as a half sine of this duration, s."
        yield Problem("load_cell.contact_duration", "a number > 0 of a rigid stop", "nothing", hint)
    elif not rigid and given is not None:
        hint = "The force of a stop that yields has a duration of its own: remove it."
        yield Problem("load_cell.contact_duration", f"none of a {stop.law} stop", quoted(given[1]), hint)


def cell_has_numbers_of_a_cell(draft: Draft) -> Iterator[Problem]:
    """The numbers of a load cell are within the limits of its component at every point."""
    if draft.load_cell is None:
        return
    # only scenes with a chain need this import
    from vibroimpact.fmus.core.measuring import CELL_LEAST, CELL_LIMITS

    for name, largest in CELL_LIMITS.items():
        span = draft.span(f"load_cell.{name}")
        least = 0.0 if name == "damping_ratio" else CELL_LEAST
        for value in dict.fromkeys(span or ()):
            if value != 0.0 and not least <= value <= largest:
                hint = "Such a cell measures nothing."
                yield Problem(f"load_cell.{name}", f"{least:g} to {largest:g}", quoted(value), hint)


def cell_rings_within_reach(draft: Draft) -> Iterator[Problem]:
    """The ring of a load cell is slow enough to be followed at `MOST_INSTANTS` in a sample."""
    ring, rate = draft.load_cell and draft.span("load_cell.natural_frequency"), draft.sampling_span()
    if "load_cell" in draft.channels and ring and rate and ring[1] * RING_INSTANTS > rate[0] * MOST_INSTANTS:
        most = rate[0] * MOST_INSTANTS / RING_INSTANTS
        hint = (
            "Its ring is followed within each sample: sample faster, or use 0 for a cell that does not ring."
        )
        yield Problem(
            "load_cell.natural_frequency", f"at most {most:g} Hz at this rate", quoted(ring[1]), hint
        )


def exciter_drives_a_force(draft: Draft) -> Iterator[Problem]:
    """An exciter needs a force at a point, and the clock of `[daq]` if the force falls with the distance."""
    if "exciter" not in draft.document:
        return
    if draft.forcing is not None and draft.forcing.kind != "force":
        hint = "An exciter pushes the body where the force acts: remove [exciter], or kind."
        yield Problem("forcing.kind", '"force" beside [exciter]', quoted(draft.forcing.kind), hint)
    span = draft.span("exciter.distance") if draft.exciter else None
    if span and span[1] > 0.0 and "daq" not in draft.document:
        hint = "A force that falls with the distance is held from sample to sample: add [daq] with its rate."
        yield Problem("exciter.distance", "[daq] beside it", "a scene without one", hint)
    series = draft.record.time_series if draft.record else None
    for place, name in enumerate(series.variables if series else (), start=1):
        if name == "forcing":
            where = f"record.time_series.variables[{place}]"
            yield Problem(where, '"drive" beside [exciter]', quoted(name), "It is the voltage that drives.")


def noise_has_its_channel(draft: Draft) -> Iterator[Problem]:
    """Noise belongs to channels whose tables are in the scene."""
    for key, table in NOISY.items():
        if key in draft.written("noise") and table not in draft.document:
            hint = f"Add [{table}], or remove {key}."
            yield Problem(f"noise.{key}", f"[{table}] beside it", "a scene without one", hint)


def one_clock_samples_the_channels(draft: Draft) -> Iterator[Problem]:
    """`[daq]`, if given, samples the channels at its rate, one after the other within a sample."""
    series = draft.record.time_series if draft.record else None
    if series is None or not draft.samples_channels:
        return
    rate, skew = (draft.span(f"daq.{name}") if draft.daq else None for name in ("rate", "skew"))
    if rate is None or skew is None:
        return
    if series.rate is not None and rate != (series.rate, series.rate):
        hint = "[daq] says how fast its channels are sampled: remove rate."
        yield Problem("record.time_series.rate", f"daq.rate, {rate[0]:g}", quoted(series.rate), hint)
    count = len(draft.channels)
    if (count - 1) * skew[1] * rate[1] >= 1.0:
        expected = f"{count} channels, one after the other, within a sample of {1.0 / rate[1]:g} s"
        yield Problem("daq.skew", expected, f"{quoted(skew[1])} between two", "Lower skew or rate.")


MEASURING_RULES = (
    chain_suits_the_scene,
    replays_measure_nothing,
    load_cell_has_a_stop,
    cell_has_numbers_of_a_cell,
    cell_rings_within_reach,
    exciter_drives_a_force,
    noise_has_its_channel,
    one_clock_samples_the_channels,
)
