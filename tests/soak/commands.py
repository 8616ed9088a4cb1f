"""Any misuse of any command: one clear message, exit code 0, 1 or 2, and no unrequested file."""

from __future__ import annotations

import functools
import random
import unicodedata
from pathlib import Path
from typing import Any

import typer
from support.command_line import in_this_process
from support.dataset_examples import up_down

from vibroimpact.analysis import write_dataset
from vibroimpact.orchestrator.commands.cli import app, load_commands

SAMPLE = 12
SECONDS = 30.0

SCENE = """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = 1.0
restitution = 0.7
[record]
transient_periods = 2
recorded_periods = 3
samples_per_period = 8
"""
TABLE = "time\tbase (g)\n" + "".join(f"{0.01 * k:.3f}\t{(k * k) % 7 - 3:.4f}\n" for k in range(60))
FILES: dict[str, bytes] = {
    "scene.toml": SCENE.encode(),
    "broken.toml": b"[body]\nmass = = 1\n",
    "unknown.toml": SCENE.replace("mass", "mas").encode(),
    "replay.toml": SCENE.encode() + b'[replay]\ndrive = "base"\n',
    "table.txt": TABLE.encode(),
    "cut.txt": TABLE.encode()[:500],
    "law.py": b"def force(displacement, velocity):\n    return 0.0\n",
    "empty": b"",
    "empty.nc": b"",
    "noise.nc": bytes(range(256)) * 8,
    "noise.fmu": b"PK\x03\x04" + bytes(range(256)),
    "old.png": b"a figure of long ago",
    "with space.toml": SCENE.encode(),
    "-o": b"",
}
FOLDERS = ("folder", "folder.nc", "folder.toml", "folder.png")
MISSING = (
    "missing.toml",
    "missing.nc",
    "no/such/folder/x.nc",
    "no/such.png",
    "",
    "\udcff.toml",
    "\x1b[31mred.nc",
)
MISSING_ENDLESS = ("x" * 300 + ".nc", "scene.toml/x.nc", "/", ".", "..", "~")
OUTPUTS = ("out.nc", "out.png", "out.svg", "out.fmu", "out", "out.xyz", "folder/out.nc", "folder/out.png")
NUMBERS = (
    "0",
    "1",
    "-1",
    "2",
    "16",
    "0.5",
    "1e308",
    "-1e308",
    "1e999",
    "nan",
    "inf",
    "-inf",
    "1e-320",
    "9" * 40,
)
WORDS = (
    *(
        "auto",
        "run",
        "decay",
        "impacts",
        "response",
        "base",
        "displacement",
        "none",
        "all",
        "viscous+coulomb",
        "g",
        "m/s^2",
    ),
    *(
        "3.0",
        "2.0",
        "1.0",
        "oscillator",
        "beam",
        "chain",
        "impact-stop",
        "user-contact-law",
        "fused",
        "coupled",
    ),
    *(
        "half_sine",
        "tab",
        "comma",
        ",",
        "0:1",
        "1:0",
        ":",
        "nan:nan",
        "body.mass",
        "body.mass,body.mass",
        "5%",
        "-5%",
    ),
    *(
        "",
        " ",
        "\n",
        "ä",
        "\u202e",
        "\x07",
        "[red]x[/",
        "x" * 5000,
        "1,2",
        "1,,2",
        "tcp://127.0.0.1:1",
        "tcp://",
        "[a",
        "{",
        "%s",
        "$HOME",
    ),
)
# Each of these would work for minutes if used well; another kind or test covers that.
ONLY_MISUSED = {("campaign",), ("demo",), ("fmu", "build")}


@functools.cache
def commands() -> dict[tuple[str, ...], Any]:
    """Return every command by its path, from the command line's own table."""
    load_commands()
    found: dict[tuple[str, ...], Any] = {}

    def collect(path: tuple[str, ...], command: Any) -> None:
        for name, inner in getattr(command, "commands", {}).items():
            collect((*path, name), inner)
        if not hasattr(command, "commands"):
            found[path] = command

    collect((), typer.main.get_command(app))
    return found


@functools.cache
def dataset() -> bytes:
    """Return a small dataset of a sweep."""
    path = Path("made.nc")
    write_dataset(up_down(), path)
    image = path.read_bytes()
    path.unlink()
    return image


def invocation(draw: random.Random) -> list[str]:
    """Return a command with arguments, some of them right."""
    path = draw.choice(sorted(commands()))
    words: list[str] = []
    for parameter in commands()[path].params:
        if parameter.param_type_name == "argument":
            words += [_path(draw) for _ in range(draw.choice((0, 1, 1, 1, 1, 1, 2)))]
        elif parameter.name != "help" and draw.random() < (0.8 if parameter.name == "output" else 0.15):
            words += _option(draw, parameter)
    if path in ONLY_MISUSED:
        # an existing file cannot be the output folder
        return [*path, *(word for word in words if word != "scene.toml"), "--output", "empty"]
    if path == ("serve",):
        return [*path, *words, "--data", "empty"]  # used well it never ends
    if path == ("fmu", "check"):
        words.append("noise.fmu")  # without a file it checks all of the package
    if draw.random() < 0.1:
        words.insert(
            draw.randrange(len(words) + 1),
            draw.choice(("--nonsense", "--", "-x", "--help", "--output", "--version")),
        )
    if draw.random() < 0.1:
        draw.shuffle(words)
    return [*path, *words]


def _option(draw: random.Random, parameter: Any) -> list[str]:
    name = draw.choice(parameter.opts)
    if parameter.is_flag:
        return [name]
    if parameter.name in ("output", "figure"):
        return [name, draw.choice(OUTPUTS) if draw.random() < 0.7 else _path(draw)]
    pool = draw.choice((NUMBERS, WORDS, WORDS))
    return [
        name,
        *(draw.choice(pool) for _ in range(parameter.nargs)),
        *([] if draw.random() < 0.98 else ["more"]),
    ]


def _path(draw: random.Random) -> str:
    usual = [*FILES, "runs.nc", "runs.nc", "scene.toml", "table.txt", "oscillator", *FOLDERS]
    return draw.choice(usual if draw.random() < 0.7 else [*MISSING, *MISSING_ENDLESS, *WORDS])


def check(seed: int) -> str | None:
    """Call one command in this process and check its message, its exit code and its files."""
    draw = random.Random(seed)
    words = invocation(draw)
    image = dataset()
    for name, content in (FILES | {"runs.nc": image}).items():
        Path(name).write_bytes(content)
    for name in FOLDERS:
        Path(name).mkdir()
    before = _contents()
    result = in_this_process(*words)
    problem = _said_badly(result.returncode, result.stderr) or _left(before, words, result.returncode)
    return None if problem is None else f"vibroimpact {words!r}: {problem}"


def _contents() -> dict[str, bytes | None]:
    return {str(path): path.read_bytes() if path.is_file() else None for path in sorted(Path().rglob("*"))}


def _said_badly(code: int, text: str) -> str | None:
    if code not in (0, 1, 2):
        return f"exit code {code}"
    for sign in ("Traceback", "Unexpected error", "Warning: "):
        if sign in text:
            return text.strip()[-600:]
    if code and not text.strip():
        return f"exit code {code} without a word"
    if len(text) > 20_000:
        return f"{len(text)} characters of message: {text[:200]}"
    if strange := {
        name for c in set(text) - {"\n"} if (name := unicodedata.category(c)) in ("Cc", "Cf", "Zl", "Zp")
    }:
        return f"characters of categories {sorted(strange)} in {text[:300]!r}"
    return None


def _left(before: dict[str, bytes | None], words: list[str], code: int) -> str | None:
    """Return the files that came, went or changed without a request."""
    after = _contents()
    changed = sorted(
        name for name in before.keys() | after.keys() if before.get(name, b"") != after.get(name, b"")
    )
    if code:
        return f"exit code {code}, yet changed: {changed}" if changed else None
    requested = {str(Path(word.partition("=")[2] or word)) for word in words}
    # without --output an export is named after its component
    strange = [
        name
        for name in changed
        if name not in requested and not (words[0] == "fmu" and name.endswith(".fmu"))
    ]
    return f"changed without being asked for: {strange}" if strange else None
