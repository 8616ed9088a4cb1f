"""Damage to the files of a campaign: the dataset equals the undisturbed one bit for bit, or one clear error refuses it.

A campaign of a few points is damaged at a seeded place of one file, then the same command is given. The file is a
part, the rows kept from an earlier sweep, the manifest or the dataset. A damaged part must be computed again, and a
damaged manifest made again; a damaged dataset may be refused.
"""

from __future__ import annotations

import os
import random
import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import xarray as xr
from support.campaign_scenes import TIMING, frequency_text
from support.serial_pool import campaign_here

import vibroimpact.orchestrator.campaign.schedule as schedule
from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import read_flat
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.orchestrator.campaign import CampaignInterrupted

TEXT = frequency_text(6, "up", milliseconds=0.001)
LONGER = frequency_text(6, "up-down", milliseconds=0.001)
RUNNER = "support.busy_runner:SceneRunner"

Files = dict[str, bytes]


@lru_cache(maxsize=1)
def folders() -> dict[str, tuple[str, Files]]:
    """Return the files of a campaign at different times of its life, each with the scene of its next command."""
    with TemporaryDirectory() as place, pytest.MonkeyPatch.context() as patch:
        patch.setattr(schedule, "FIRST_POINTS", 2)
        patch.setattr(schedule, "MOST_POINTS", 2)
        half, done = Path(place, "half"), Path(place, "done")
        _interrupt(patch, TEXT, half, 2)
        found = {"half done": (TEXT, _files(half))}
        campaign_here(patch, TEXT, done, runner=RUNNER)
        found["done"] = (TEXT, _files(done))
        _interrupt(patch, LONGER, done, 1)
        found["extended"] = (LONGER, _files(done))
        return found


@lru_cache(maxsize=2)
def undisturbed(text: str) -> xr.Dataset:
    """Return the dataset of a scene without any disturbance."""
    with TemporaryDirectory() as place, pytest.MonkeyPatch.context() as patch:
        campaign_here(patch, text, Path(place, "campaign"), runner=RUNNER)
        return read_flat(Path(place, "campaign", "dataset.nc"))


def check(seed: int) -> str | None:
    """Damage one file of a campaign and resume the campaign."""
    draw = random.Random(seed)
    text, files = folders()[draw.choice(sorted(folders()))]
    name = draw.choice(sorted(files))
    how = draw.choice(sorted(DAMAGES))
    damaged = DAMAGES[how](draw, files[name])
    folder = Path("campaign").absolute()
    for file, content in (files | {name: damaged}).items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_bytes(content)
    problem = _opened(folder, files, name) or _gone_on(folder, text, name)
    return problem and f"{how} in {name}: {problem}"


def _opened(folder: Path, files: Files, name: str) -> str | None:
    """Open a damaged dataset as a reader would."""
    if name != "dataset.nc":
        return None
    try:
        with open_dataset(folder) as opened:
            values = opened.impact_time.values
    except VibroimpactError:
        return None
    (folder / "sound.nc").write_bytes(files[name])
    sound = read_flat(folder / "sound.nc").impact_time.values
    return None if values.tobytes() == sound.tobytes() else "other values were opened"


def _gone_on(folder: Path, text: str, name: str) -> str | None:
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            campaign_here(patch, text, folder, runner=RUNNER)
        except VibroimpactError as error:
            if name.startswith(("parts", "campaign.json")):
                return f"refused: {error}"
            return None if len(str(error).splitlines()) == 1 else f"more than a line: {error}"
    return _difference(read_flat(folder / "dataset.nc"), undisturbed(text))


def _difference(got: xr.Dataset, expected: xr.Dataset) -> str | None:
    if got.attrs != expected.attrs or set(got.variables) != set(expected.variables):
        return "other attributes or variables"
    for name, variable in expected.variables.items():
        if name not in TIMING and not _same(got.variables[name].values, variable.values):
            return f"other values of {name}"
    return None


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    if one.dtype != other.dtype or one.shape != other.shape:
        return False
    return bool((one == other).all()) if one.dtype == object else one.tobytes() == other.tobytes()


def _interrupt(patch: pytest.MonkeyPatch, text: str, folder: Path, chunks: int) -> None:
    try:
        campaign_here(patch, text, folder, runner=RUNNER, most_chunks=chunks)
    except CampaignInterrupted:
        return
    raise AssertionError("the campaign was not interrupted")


def _files(folder: Path) -> Files:
    paths = [path for path in folder.rglob("*") if path.is_file() and path.name != ".lock"]
    return {os.fspath(path.relative_to(folder)): path.read_bytes() for path in paths}


# ---- damages ----


def _flip(draw: random.Random, content: bytes) -> bytes:
    damaged = bytearray(content)
    for _ in range(draw.choice([1, 1, 1, 2, 5, 40])):
        damaged[draw.randrange(len(damaged))] ^= 1 << draw.randrange(8)
    return bytes(damaged)


def _flip_at_an_end(draw: random.Random, content: bytes) -> bytes:
    """Flip a bit in the first or last bytes, which identify the file."""
    damaged = bytearray(content)
    place = draw.randrange(100)
    damaged[place if draw.random() < 0.5 else -1 - place] ^= 1 << draw.randrange(8)
    return bytes(damaged)


def _zero(draw: random.Random, content: bytes) -> bytes:
    first = draw.randrange(len(content))
    length = draw.choice([1, 8, 47, 512, 4096])
    return content[:first] + bytes(len(content[first : first + length])) + content[first + length :]


def _zero_the_end(draw: random.Random, content: bytes) -> bytes:
    length = min(draw.choice([1, 86, 512, 4096]), len(content))
    return content[:-length] + bytes(length)


def _truncate(draw: random.Random, content: bytes) -> bytes:
    near = draw.random() < 0.5
    return content[: -draw.randrange(1, 200)] if near else content[: draw.randrange(len(content))]


def _append(draw: random.Random, content: bytes) -> bytes:
    return content + draw.randbytes(draw.choice([1, 86, 512]))


def _repeat(draw: random.Random, content: bytes) -> bytes:
    """Write one block of a disk over another one."""
    blocks = max(len(content) // 512, 1)
    source, target = (512 * draw.randrange(blocks) for _ in range(2))
    block = content[source : source + 512]
    return content[:target] + block + content[target + len(block) :]


def _digit(draw: random.Random, content: bytes) -> bytes:
    """Change a digit, which leaves a text readable."""
    places = [place for place, byte in enumerate(content) if chr(byte).isdigit()]
    damaged = bytearray(content)
    if places:
        damaged[draw.choice(places)] = ord(draw.choice("0123456789"))
    return bytes(damaged)


DAMAGES: dict[str, Callable[[random.Random, bytes], bytes]] = {
    "flipped bits": _flip,
    "a flipped bit at an end": _flip_at_an_end,
    "zeros": _zero,
    "zeros at the end": _zero_the_end,
    "truncation": _truncate,
    "appended bytes": _append,
    "a repeated block": _repeat,
    "another digit": _digit,
}
