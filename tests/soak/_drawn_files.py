"""Shared parts of the grammars of recordings: drawn signals, odd values for any field, and the rules of reading.

A sound file is read back equal to the drawn signals. An odd file has a sound structure with odd values in its fields.
An odd or damaged file is read, or refused in one line that names it; a damaged file with a checksum is read equal.
No file takes more than `MOST_MEMORY`; the runner ends a hanging case.
"""

from __future__ import annotations

import random
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from support.direct_reading import imported_directly

from soak.scenes import wrong_message
from vibroimpact.analysis.recording import Recording, open_recording, write_recording
from vibroimpact.fmus.errors import DatasetError, VibroimpactError
from vibroimpact.hardware.recordings import import_recording

Floats = NDArray[np.float64]
Drawn = TypeVar("Drawn")

CASES, SAMPLE, SECONDS = 10_000, 40, 10.0
MOST_MEMORY = 300_000_000
"""Bytes by which a process may grow while it reads a file of some kilobytes; libraries are loaded before."""
LONGEST_MESSAGE = 5000
LONGEST_FILE = 120
"""Samples of a drawn channel, at most."""
UNITS: Mapping[str, str] = {
    "g": "9.80665 m s-2",
    "m/s^2": "m s-2",
    "N": "N",
    "V": "V",
    "mm": "0.001 m",
    "": "1",
}
"""Units as they stand in files, and in recordings."""
NAMES = ("base", "tip", "board", "rail", "pickup", "mount", "sensor_2", "bench", "strain")
"""Words that mean no quantity: a unit that contradicts a heading is not accepted."""
INTERVALS = (1e-3, 2e-3, 1.0 / 1024.0, 0.01, 0.5, 4e-5)
NUMBERS: tuple[Any, ...] = (
    0, 1, -1, 2, 3, 7, 100, 2**7, 2**8, 2**15, 2**16, 2**31 - 1, 2**31, 2**32 - 1, 2**53, 2**63 - 1, -(2**31), -(2**63),
)  # fmt: skip
FRACTIONS = (
    *(0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, 5e-324, 1e300, 1.7e308, float("inf"), float("-inf"), float("nan")),
    *(9.9e37, 9.91e37, 1e-9, 1e9, 3.0),
)
WORDS = (
    *(
        "",
        " ",
        "a",
        "time",
        "t",
        "Time",
        "fs",
        "dt",
        "units",
        "None",
        "nan",
        "1",
        "-1",
        "1e999",
        "x" * 300,
        "x" * 5000,
    ),
    *(
        "m " * 200,
        "(" * 50,
        "m**999999999",
        "ä",
        "\u202ename",
        "\x1b[31m",
        "a\nb",
        "a\0b",
        "\u0301" * 40,
        "𝄞",
        "[bold]",
    ),
    *(
        "s since 1970-01-01",
        "seconds since yesterday",
        "../a",
        "/etc/passwd",
        "2026-07-30T10:00:00",
        "a/b",
        "'",
        '"',
    ),
)


def number(draw: random.Random, *usual: int) -> int:
    """Return a usual whole number, or an odd one."""
    return draw.choice(usual) if usual and draw.random() < 0.8 else draw.choice(NUMBERS)


def bounded(value: int, bits: int, *, signed: bool = False) -> int:
    """Return a number as `bits` bits store it."""
    value &= (1 << bits) - 1
    return value - (1 << bits) if signed and value >> (bits - 1) else value


def word(draw: random.Random, *usual: str) -> str:
    """Return a usual text, or an odd one."""
    return draw.choice(usual) if usual and draw.random() < 0.7 else draw.choice(WORDS)


@dataclass(frozen=True)
class Signals:
    """Channels of one rate.

    Attributes
    ----------
    names, units : sequence of str
        As the file spells them.
    values : sequence of ndarray, shape (sample,)
    interval, start : float
        s
    """

    names: Sequence[str]
    units: Sequence[str]
    values: Sequence[Floats]
    interval: float
    start: float = 0.0

    @property
    def count(self) -> int:
        """Samples of each channel."""
        return len(self.values[0])

    @property
    def instants(self) -> Floats:
        """Times of the samples, s."""
        return self.start + self.interval * np.arange(self.count)


@dataclass(frozen=True)
class Truth:
    """The expected reading: the channels in their order, with values, CF units and intervals."""

    values: Sequence[Floats]
    units: Sequence[str]
    interval: float
    start: float | None = None
    names: Sequence[str] = field(default_factory=tuple)
    tolerance: float = 0.0


def drawn_signals(draw: random.Random, *, most: int = 5, fewest_rows: int = 12) -> Signals:
    """Return drawn channels: waves, noise, whole numbers, tiny and huge values, constants."""
    many, count = draw.randint(1, most), draw.randint(fewest_rows, LONGEST_FILE)
    return Signals(
        draw.sample(NAMES, many),
        [draw.choice(list(UNITS)) for _ in range(many)],
        [drawn_values(draw, count) for _ in range(many)],
        draw.choice(INTERVALS),
        draw.choice((0.0, 0.0, -0.25, 1.5)),
    )


def drawn_values(draw: random.Random, count: int) -> Floats:
    """Return values of one channel; the first two differ, and the values do not only ascend."""
    noise = np.random.default_rng(draw.randrange(2**32)).normal(size=count)
    scale = draw.choice((1.0, 1.0, 30.0, 1e-6, 1e6))
    values = scale * draw.choice((noise, np.sin(np.arange(count) / 3.0), np.round(10.0 * noise) + 2.0))
    values[:2] = 2.5 * scale, -1.25 * scale
    return np.asarray(values, dtype=np.float64)


def truth_of(signals: Signals, **known: Any) -> Truth:
    """Return the expected reading of drawn signals."""
    units = [UNITS[unit] for unit in signals.units]
    given = {"names": list(signals.names), "start": signals.start, **known}
    return Truth(list(signals.values), units, signals.interval, **given)


def differs(recording: Recording, truth: Truth) -> str | None:
    """Return the first difference between a recording and the drawn signals; None without one."""
    channels = list(recording.channels.values())
    said = f"; remarks: {' | '.join(recording.remarks)[:300]}"
    if recording.events or len(channels) != len(truth.values):
        others = [*recording.events, *recording.scalars]
        return f"{[one.name for one in channels]} and {others} for {len(truth.values)} channels{said}"
    if truth.names and [one.name for one in channels] != list(truth.names):
        return f"names {[one.name for one in channels]} for {list(truth.names)}{said}"
    for channel, values, unit in zip(channels, truth.values, truth.units, strict=True):
        if len(channel.values) != len(values):
            return f"{channel.name}: {len(channel.values)} samples for {len(values)}{said}"
        if not _equal(channel.values, values, truth.tolerance):
            at = int(np.flatnonzero(~_same(channel.values, values, truth.tolerance))[0])
            return f"{channel.name}: sample {at} is {channel.values[at]!r}, not {values[at]!r}{said}"
        if channel.unit != unit:
            return f"{channel.name}: unit {channel.unit!r} for {unit!r}{said}"
        if not np.isclose(channel.axis.interval or 0.0, truth.interval, rtol=1e-5):
            return f"{channel.name}: interval {channel.axis.interval} for {truth.interval}{said}"
        if truth.start is not None and abs(channel.time[0] - truth.start) > 1e-3 * truth.interval:
            return f"{channel.name}: begins at {channel.time[0]} for {truth.start}{said}"
    return None


def _equal(got: Floats, drawn: Floats, tolerance: float) -> bool:
    return bool(np.all(_same(got, drawn, tolerance)))


def _same(got: Floats, drawn: Floats, tolerance: float) -> NDArray[np.bool_]:
    return np.asarray(np.isclose(got, drawn, rtol=tolerance, atol=0.0, equal_nan=True))


def sound(path: Path, truth: Truth, settings: Mapping[str, Any] | None = None) -> str | None:
    """Return the problem of the reading of a sound file; None without one."""
    with bounded_memory() as grown:
        try:
            recording = imported_directly(path, settings)
        except VibroimpactError as refusal:
            return f"a sound file is refused: {str(refusal)[:400]}"
        problem = differs(recording, truth)
    return problem or grown()


def odd(
    path: Path,
    settings: Mapping[str, Any] | None = None,
    *,
    equal: Truth | None = None,
    crashes: bool = False,
) -> str | None:
    """Return the problem of the reading of an odd or damaged file; None without one.

    Parameters
    ----------
    equal : Truth, optional
        The only reading that is right, since the format has checksums.
    crashes : bool
        The compiled library of the format crashes on damaged bytes: another process reads it, as outside of tests.
    """
    with bounded_memory() as grown:
        try:
            recording = import_recording([path], settings) if crashes else imported_directly(path, settings)
        except VibroimpactError as refusal:
            return badly_said(refusal, path) or grown()
        problem = differs(recording, equal) if equal is not None else None
        problem = problem or _unsound(recording, path)
    return problem or grown()


def badly_said(refusal: VibroimpactError, path: Path) -> str | None:
    """Return the problem of a refusal; a good one names the file, is short and has no control characters."""
    text = str(refusal)
    if path.name not in text or len(text) > LONGEST_MESSAGE:
        return f"{len(text)} characters of refusal: {text[:300]!r}"
    return wrong_message(text)


def _unsound(recording: Recording, path: Path) -> str | None:
    """Return the fault of a recording: infinite values, instants in disorder, or other values when written."""
    for channel in recording.channels.values():
        if np.any(np.isinf(channel.values)):
            return f"{channel.name}: an infinite value"
        if not np.all(np.isfinite(channel.time)) or not np.all(np.diff(channel.time) > 0.0):
            return f"{channel.name}: instants that do not ascend"
    target = path.with_name("written.nc")
    try:
        write_recording(recording, target)
    except DatasetError as refusal:  # the recording holds numbers that no measurement has
        return wrong_message(str(refusal))
    back = open_recording(target)
    target.unlink()
    for name, channel in recording.channels.items():
        if not np.array_equal(back.channels[name].values, channel.values, equal_nan=True):
            return f"{name}: other values were written"
    return None


def beginning(recording: Recording, truth: Truth) -> str | None:
    """Return the first wrong sample of a file that was cut off; None where a remark names the cut end."""
    if "the text ends with" in "\n".join(recording.remarks):
        return None
    for channel, known in zip(recording.channels.values(), truth.values, strict=False):
        values = channel.values[: len(known)]
        right = np.isnan(values) | _same(values, known[: len(values)], 1e-9)
        if len(recording.channels) == len(truth.values) and not right.all():
            place = int(np.argmin(right))
            return (
                f"{channel.name}: sample {place} is {values[place]}, not {known[place]}, and nothing is said"
            )
    return None


def damaged(draw: random.Random, content: bytes) -> bytes:
    """Return a file with bits flipped, or with bytes set, taken out, doubled or cut off."""
    changed = bytearray(content)
    for _ in range(draw.choice((1, 1, 2, 5, 20))):
        place = draw.randrange(len(changed) + 1)
        match draw.randrange(6):
            case 0 | 1 if changed:
                changed[place % len(changed)] ^= 1 << draw.randrange(8)
            case 2:
                changed[place : place + 4] = bounded(draw.choice(NUMBERS), 32).to_bytes(4, "little")
            case 3:
                changed[place : place + draw.randint(1, 60)] = b""
            case 4:
                changed[place:place] = changed[place : place + draw.randint(1, 60)]
            case _ if draw.random() < 0.3:
                changed = changed[: max(1, place)]
    return bytes(changed)


def spoiled(draw: random.Random, content: bytes, inserted: Sequence[bytes]) -> bytes:
    """Return a file that is cut off, or damaged and with some of these bytes put in between."""
    if draw.random() < 0.3:
        return content[: draw.randrange(1, len(content))]
    changed = bytearray(damaged(draw, content))
    for _ in range(draw.choice((0, 0, 1, 3))):
        place = draw.randrange(len(changed) + 1)
        changed[place:place] = draw.choice(inserted)
    return bytes(changed) or b"\n"


def flipped(draw: random.Random, content: bytes) -> bytes:
    """Return a file with some bits flipped, none of them at its start, which identifies the format."""
    changed = bytearray(content)
    for _ in range(draw.choice((1, 1, 1, 2, 8))):
        changed[draw.randrange(min(8, len(changed) - 1), len(changed))] ^= 1 << draw.randrange(8)
    return bytes(changed)


@contextmanager
def bounded_memory() -> Iterator[Callable[[], str | None]]:
    """Yield a check to be called at the end: it reports growth of this process by more than `MOST_MEMORY`."""
    before = _peak(reset=True)
    yield lambda: _grown(before)


def _grown(before: int) -> str | None:
    grown = _peak() - before
    return f"{grown / 1e6:.0f} MB of memory" if grown > MOST_MEMORY else None


def _peak(*, reset: bool = False) -> int:
    """Return the largest resident memory since the last reset, bytes; 0 where the system does not report it."""
    if sys.platform != "linux":
        return 0
    if reset:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
    line = next(line for line in status.splitlines() if line.startswith("VmHWM:"))
    return 1024 * int(line.split()[1])
