"""FMUs made by the test suite from the C in `tests/support/fmus`: other people's FMUs, good and bad.

They share no code with the package. Each is compiled once for each content of its sources and compiler; a second call
only writes the file.
"""

from __future__ import annotations

import re
import tempfile
import uuid
import zipfile
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path

from support.kept import compiler_identity, content_of, digest, kept
from vibroimpact.fmus.packaging.build import fmi_headers
from vibroimpact.fmus.packaging.compiler import LANGUAGE, WARNINGS, compile_library, find_compiler
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.packaging.platform_names import binary_folder, library_suffix

SOURCES = Path(__file__).with_name("fmus")
#: The C file of each model. A model exists in a version of FMI if it has a description of that version.
MODELS = {
    "BouncingBall": "ball.c",
    "Buffer": "buffer.c",
    "Clocked": "clocked.c",
    "Exchanged": "exchanged.c",
    "Faulty": "faulty.c",
    "Feedthrough": "feedthrough.c",
    "Gain": "gain.c",
    "Mass": "mass.c",
    "Single": "single.c",
    "StatelessMass": "stateless_mass.c",
    "SteppedBall": "stepped_ball.c",
    "Timed": "timed.c",
    "Typed": "typed.c",
    "UpdatingMass": "updating_mass.c",
}
WEAK = "__attribute__((weak))"
#: First letters of the C files of a model's adapters, without the version.
ADAPTERS = {"Exchanged": "exchange", "Typed": "typed"}
#: Token of an FMU that accepts every token.
ANY_TOKEN = "*"
MADE = tuple(
    (name, fmi) for name in MODELS for fmi in ("2.0", "3.0") if (SOURCES / f"{name}.fmi{fmi[0]}.xml").exists()
)

GAIN_SCENE = """
[component.g]
fmu = "g.fmu"
parameters = { k = 3.0, u = 2.0 }
[record]
recorded_time = 1.0
rate = 10
variables = ["g.y"]
[execution]
guard = false
"""
"""A scene of the FMU `g.fmu` that `gain` makes, for its output `y`."""


def bouncing_ball(folder: Path, fmi: str = "2.0") -> Path:
    """Write a ball that checks for the ground only at the end of a step: it has state, but no events.

    Outputs `h` (m), `v` (m/s), `bounces`; parameters `g`, `e`, and `landing`: the value of `h` after a bounce.
    """
    return _write("BouncingBall", fmi, folder)


def stepped_ball(folder: Path, fmi: str = "3.0") -> Path:
    """Write a ball that bounces inside steps, like the ball of FMI's Reference-FMUs; in FMI 3.0 with event mode.

    Outputs `h` (m), `v` (m/s), `bounces`; parameters `g`, `e`.
    """
    return _write("SteppedBall", fmi, folder)


def buffer(folder: Path, fmi: str = "3.0") -> Path:
    """Write a spring and a dashpot that start at a position and never pull; they answer at the end of a step.

    Inputs `d` (m), `u` (m/s); output `push` (N); parameters `k`, `c`, `gap`.
    """
    return _write("Buffer", fmi, folder)


def clocked(folder: Path) -> Path:
    """Write a sampler of FMI 3.0 with two input clocks; a clock's variables are accessible only while it ticks.

    Input `u`; outputs `y` (10 times the ticks plus `u` at the last tick), `ticks`, `late_ticks`, `sum`. Parameters
    `interval` and `shift` (s) belong to its second clock.
    """
    return _write("Clocked", "3.0", folder)


def timed(folder: Path) -> Path:
    """Write a model of FMI 3.0 with tunable, changing, countdown and triggered clocks; it refuses missed ticks.

    Input `u` (at ticks of `hit`); outputs `beats`, `strides`, `fuses`, `hits`, `sum`, `last`, `gated`; parameters
    `period` (tunable), `shift`, `delay` (s).
    """
    return _write("Timed", "3.0", folder)


def single(folder: Path, fmi: str = "3.0") -> Path:
    """Write an integrator y' = u whose `y` is one variable of the process: a process may have one instance."""
    return _write("Single", fmi, folder)


def exchanged(folder: Path, fmi: str = "3.0") -> Path:
    """Write a model for model exchange alone, whose adapters refuse each call in a wrong mode.

    Outputs `x`, `v`, `count` (events), `steps` (completed), `nominals` (readings); inputs `u` and `d` (discrete);
    parameters `kind` and `at`: its events and faults, as in `exchanged.h`.
    """
    return _write("Exchanged", fmi, folder)


def faulty(folder: Path, fmi: str = "3.0") -> Path:
    """Write an integrator y' = u with the parameters `fault` (kind of fault) and `fault_time`."""
    return _write("Faulty", fmi, folder)


def feedthrough(folder: Path, fmi: str = "3.0") -> Path:
    """Write y = law(u) + l w with directional derivatives, which are wrong by `lie`; laws and parameters: see its XML.

    Output `latched` depends on u until initialization has ended.
    """
    return _write("Feedthrough", fmi, folder)


def gain(folder: Path, token: str = "") -> Path:
    """Write y = k u + b in FMI 2.0: direct feedthrough, and no state that can be saved.

    With `ANY_TOKEN` it makes an instance for every token, like the FMUs of Hopsan and Amesim.
    """
    return _write("Gain", "2.0", folder, token)


def mass(folder: Path, fmi: str = "3.0", *, states: bool = True) -> Path:
    """Write a mass on a spring without contacts, with saveable states or without.

    Outputs `x` (m), `v` (m/s); input `f` (N), constant over a step; parameters `m`, `k`, `load`, and `scheme` with
    `inner_step`: the integration method.
    """
    return _write("Mass" if states else "StatelessMass", fmi, folder)


def typed(folder: Path, fmi: str = "3.0") -> Path:
    """Write parameters of all types that outputs repeat: `p_TYPE` and `y_TYPE`, in FMI 3.0 arrays `a_TYPE`, `b_TYPE`.

    The structural parameters `rows` and `columns` give the sizes of the arrays. FMI 3.0 has z = 2 u and x' = u, too,
    for arrays. `word`, `big` and `mode` change with each step.
    """
    return _write("Typed", fmi, folder)


def updating_mass(folder: Path) -> Path:
    """Write the mass in FMI 3.0 that calls back within its steps, and refuses a step without a callback."""
    return _write("UpdatingMass", "3.0", folder)


def redescribed(source: Path, target: Path, *replacements: tuple[str, str]) -> Path:
    """Write an FMU with another description: each first text, which must occur, becomes the second."""
    with zipfile.ZipFile(source) as archive, zipfile.ZipFile(target, "w") as changed:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "modelDescription.xml":
                text = content.decode()
                for old, new in replacements:
                    assert old in text
                    text = text.replace(old, new)
                content = text.encode()
            changed.writestr(name, content)
    return target


def _write(name: str, fmi: str, folder: Path, token: str = "") -> Path:
    version = f"fmi{fmi[0]}"
    path = folder / f"{name}.{version}.fmu"
    description = (SOURCES / f"{name}.{version}.xml").read_text(encoding="utf-8")
    token = token or _token(name, fmi)
    members = {
        "modelDescription.xml": description.replace("{token}", token).encode(),
        f"binaries/{binary_folder(fmi)}/{name}{library_suffix()}": _binary(name, fmi, token),
    }
    write_fmu(path, members)
    return path


def _token(name: str, fmi: str) -> str:
    return f"{{{uuid.uuid5(uuid.NAMESPACE_DNS, f'{name} {fmi}')}}}"


@cache
def _binary(name: str, fmi: str, token: str) -> bytes:
    adapter, suffix = SOURCES / f"{ADAPTERS.get(name, 'fmi')}{fmi[0]}.c", library_suffix()
    headers = [*SOURCES.glob("*.h"), *fmi_headers().glob("*.h")]
    key = digest(
        *(compiler_identity(find_compiler()), *LANGUAGE, *WARNINGS, token),
        content_of([Path(__file__), adapter, SOURCES / MODELS[name], *headers]),
    )
    return kept(f"{name}.fmi{fmi[0]}{suffix}", key, partial(_compile, name, fmi, adapter, token)).read_bytes()


def _compile(name: str, fmi: str, adapter: Path, token: str, library: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        generated = Path(folder)
        (generated / "token.h").write_text(f'#define TOKEN "{token}"\n', encoding="ascii")
        rest = generated / "rest.c"
        rest.write_text(_functions_left_out([adapter, SOURCES / MODELS[name]], fmi), encoding="ascii")
        # not strict: some compilers warn about the empty parameter lists of the headers
        sources = [adapter, SOURCES / MODELS[name], rest]
        compile_library(library, sources, [SOURCES, generated, fmi_headers()], export_all=True, strict=False)


def _functions_left_out(sources: Sequence[Path], fmi: str) -> str:
    """Return C for the functions of the standard that no source defines: they answer error, or no instance.

    They declare no parameters, since they use none; in C's calling conventions the caller clears the arguments away.
    They are weak: a function that a macro defines goes before them.
    """
    major = fmi[0]
    header = (fmi_headers() / f"fmi{major}Functions.h").read_text(encoding="utf-8", errors="replace")
    declared = re.findall(rf"FMI{major}_Export\s+fmi{major}\w+TYPE\s+(fmi{major}\w+);", header)
    texts = [source.read_text(encoding="utf-8") for source in sources]
    defined = {
        name for text in texts for name in re.findall(rf"^\w.*?\b(fmi{major}\w+)\(", text, re.MULTILINE)
    }
    lines = [_refusal(function) for function in dict.fromkeys(declared) if function not in defined]
    return "\n".join(lines)


def _refusal(function: str) -> str:
    if "Instantiate" in function:
        return f"{WEAK} void *{function}(void);\nvoid *{function}(void) {{ return (void *)0; }}"
    return f"{WEAK} int {function}(void);\nint {function}(void) {{ return 3; }}"
