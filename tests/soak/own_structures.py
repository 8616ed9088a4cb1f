"""Random matrices in files of all formats, as a body of a scene: refused by name, or run by all laws.

Energy balances, and nothing is beyond a rigid stop. Every other structure has the modes of a dense solution.
"""

from __future__ import annotations

import re
import warnings
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import tomli_w
from numpy.typing import NDArray
from scipy import linalg
from scipy.sparse import SparseEfficiencyWarning, csc_array
from support import matrix_files, nastran_files
from support.balances import energy_problem, room_problem
from support.drawn_matrices import EXACT_DECADES, DrawnMatrices, Floats, drawn_matrices, keys_of_body
from support.drawn_structures import ENERGIES, MOST_IMPACTS, law_of, number, pick

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.private_folder import CACHE_VARIABLE
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.structures.matrices import Matrices
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.reduction import reduce

CASES, SAMPLE, SECONDS = 5000, 6, 30.0

Tables = dict[str, Any]
NASTRAN = "model.pch"
SEVERAL = (*matrix_files.SEVERAL, NASTRAN)
DIGITS = (".sti", ".pch")
"""Formats whose numbers have 10 to 14 digits: their rigid-body modes are those of rounded numbers."""
ERROR, UNBOUNDED = 3, 6
REFUSALS = {
    "negative": r"expected stiffness that is positive semi-definite",
    "few": r"expected at least (\d+) modes",
    "tolerance": r"expected a tolerance that 64 modes meet",
    "many": r"expected at most 64 rigid-body modes",
    "loose": r"expected mass or stiffness for each motion",
    "whole": r"expected at most 64 modes in all",
    "still": r"expected a point that a mode moves",
}
"""Refusals of structures that are none of a fault of the program, or of its input."""
PERIODS_LOW, PERIODS_HIGH, PERIODS_PRESSED, SAMPLES = 8.0, 150.0, 3000.0, 60.0
"""Periods of the lowest mode, of the highest one and of the stiffest contact in a run at most; samples of a run."""
EXTREME = 1e13
"""Rate, 1/s, from which powers of a series may be beyond the largest number: the run says so."""
DEEPEST = 100.0
"""Depth of a contact for its stiffness, in clearances."""
SQUARES, REFERENCE, FLEXIBILITY = 1e-8, 1e-12, 1e-7
"""Differences from a dense solution: of squares of frequencies, its own rounding, and of flexibilities at points."""


def check(seed: int) -> str | None:
    """Return the fault of a structure of a seed."""
    random = np.random.default_rng(seed)
    drawn, folder = drawn_matrices(random), Path.cwd()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SparseEfficiencyWarning)  # of many diagonals
        keys = keys_of_body(random, drawn) | _written(random, drawn)
    tables, length = _scene(random, drawn, keys)
    (folder / "scene.toml").write_text(tomli_w.dumps(tables))
    with patch.dict("os.environ", {CACHE_VARIABLE: str(folder / "cache")}):
        try:
            scene = Scene.from_file("scene.toml")
        except SceneError as refusal:
            return _refusal_problem(str(refusal), drawn, keys, len(_points_of(tables, keys)))
    is_rounded = any(str(keys.get(key, "")).endswith(DIGITS) for key in ("file", "stiffness"))
    if drawn.is_loose and drawn.decades <= EXACT_DECADES and not is_rounded:
        return "a structure with a motion without mass and stiffness runs"
    problem = _run_problem(tables, scene, drawn, length)
    return problem or (None if seed % 2 or drawn.decades > EXACT_DECADES else _modes_problem(random, drawn))


def _written(random: np.random.Generator, drawn: DrawnMatrices) -> Tables:
    """Write the matrices in a format, with a table of their unknowns, and return the keys of the files."""
    matrices = {"stiffness": drawn.stiffness, "mass": drawn.mass}
    matrices |= {} if drawn.damping is None else {"damping": drawn.damping}
    name = pick(random, *matrix_files.ONE_MATRIX, *SEVERAL)
    Path("freedoms.csv").write_text("name\n" + "".join(f"{one}\n" for one in drawn.names))
    files = {"freedoms": "freedoms.csv"}
    if name not in SEVERAL:
        for role, matrix in matrices.items():
            Path(f"{role}_{name}").write_bytes(matrix_files.ONE_MATRIX[name](matrix))
        return files | {role: f"{role}_{name}" for role in matrices}
    usual = {"KAA": "stiffness", "MAA": "mass", "BAA": "damping"}
    named = {short: matrices[role] for short, role in usual.items() if role in matrices}
    if name != NASTRAN:
        Path(name).write_bytes(matrix_files.SEVERAL[name](named))
        return files | {"file": name}
    order = sorted(range(len(drawn.names)), key=lambda place: int(drawn.names[place].partition(".")[0]))
    names, square = [drawn.names[place] for place in order], np.ix_(order, order)
    write = partial(nastran_files.dmig, freedoms=names)
    Path(name).write_bytes(b"".join(write(short, matrix[square]) for short, matrix in named.items()))
    return {"file": name}


def _scene(random: np.random.Generator, drawn: DrawnMatrices, keys: Tables) -> tuple[Tables, float]:
    """Return the tables of a scene of the structure, and the length of its clearances, m."""
    used = [drawn.names[place] for place in drawn.used.tolist()]
    places = [f"own.{name}" for name in (*keys.get("points", {}), *(pick(random, *used) for _ in range(2)))]
    length, (stiffness, mass) = float(10.0 ** random.uniform(-5, 0)), drawn.unit
    speed = length * drawn.natural
    own = {"name": "own"} | keys | pick(random, {}, {"velocity_start": [float(speed * np.sqrt(mass))]})
    tables: Tables = {"scene": {"units": "SI"}, "body": [own]}
    if random.random() < 0.6:
        ball = {"name": "ball", "mass": mass * number(random, 0.1, 3.0)}
        ball |= {
            "stiffness": pick(random, 0.0, stiffness),
            "velocity_start": speed * number(random, -1.0, 1.0),
        }
        tables["body"].append(ball)
        between = pick(random, [pick(random, *places), "ball"], ["ball", pick(random, *places)])
        contact = {"between": between, "clearance": length * number(random, 0.0, 0.3)}
        tables["contact"] = [contact | _law(random, drawn)]
        if random.random() < 0.4:
            tables["link"] = [{"between": [pick(random, *places), "ball"]} | _link(random, drawn)]
    if random.random() < 0.3:
        link = {"between": [pick(random, *places), "ground"]} | _link(random, drawn)
        tables.setdefault("link", []).append(link)
    sides = pick(random, (), ("upper",), ("lower",), ("lower", "upper"))
    stops = [
        {"at": pick(random, *places), "side": side, "position": length * number(random, 0.02, 0.5) * sign}
        | _law(random, drawn)
        for side, sign in zip(sides, (1.0 if sides == ("upper",) else -1.0, 1.0), strict=False)
    ]
    tables |= {"stop": stops} if stops else {}
    force = {"signal": "constant", "amplitude": length * stiffness * number(random, -2.0, 2.0)}
    forces = [force | {"at": pick(random, *places)}] if random.random() < 0.5 else []
    if "base" in keys and random.random() < 0.6:
        forces.append(force | {"kind": "base_acceleration", "amplitude": speed * drawn.natural})
    tables |= {"forcing": forces} if forces else {}
    names = [f"energy.{name}" for name in ENERGIES]
    names += [f"contact_displacement[{k}]" for k in range(1, len(stops) + len(tables.get("contact", [])) + 1)]
    record = {"recorded_time": 1.0, "time_series": {"rate": 60.0, "variables": names}, "observed": places[:1]}
    return tables | {"record": record, "execution": {"impact_limit": MOST_IMPACTS}}, length


def _law(random: np.random.Generator, drawn: DrawnMatrices) -> Tables:
    """Return the keys of a law, as hard beside the structure as a law of nondimensional bodies is."""
    found, (stiffness, mass) = law_of(random), drawn.unit
    for key, unit in (("stiffness", stiffness), ("damping", np.sqrt(stiffness * mass))):
        if (key in found and found.get("law") == "kelvin_voigt") or (key == "stiffness" and key in found):
            found[key] = float(found[key] * unit)
    return found


def _link(random: np.random.Generator, drawn: DrawnMatrices) -> Tables:
    stiffness, mass = drawn.unit
    damping = pick(random, 0.0, float(np.sqrt(stiffness * mass)) * number(random, 0.0, 0.3))
    return {"stiffness": stiffness * pick(random, 0.0, number(random, 0.1, 5.0)), "damping": damping}


def _points_of(tables: Tables, keys: Tables) -> set[str]:
    """Return the names of the points of the structure."""
    rows = [*tables.get("stop", []), *tables.get("forcing", []), tables["record"]]
    said = [each for row in rows for each in [row.get("at", ""), *row.get("observed", [])]]
    said += [each for row in (*tables.get("link", []), *tables.get("contact", [])) for each in row["between"]]
    return {each.partition(".")[2] for each in said if each.startswith("own.")} | set(keys.get("points", {}))


def _refusal_problem(said: str, drawn: DrawnMatrices, keys: Tables, points: int) -> str | None:
    """Return the fault of a refusal: of lines without a known reason, or of a structure that is sound."""
    reasons = {
        next((name for name, text in REFUSALS.items() if re.search(text, line)), line)
        for line in said.strip().splitlines()
    }
    reason = reasons.pop()
    if reasons or reason not in REFUSALS:
        return f"refused: {said}"
    if drawn.decades > EXACT_DECADES:
        return None
    needed = re.search(REFUSALS["few"], said)
    wrong = {
        "few": needed is not None and not keys["modes"] < int(needed[1]) <= max(drawn.rigid, 1) + points,
        "many": drawn.rigid <= 64,
        "loose": not drawn.is_loose,
        "negative": True,
        "still": keys.get("residual", True) and drawn.mass.diagonal()[drawn.used].all(),
    }
    return f"refused with {drawn.rigid} rigid-body modes: {said}" if wrong.get(reason) else None


def _run_problem(tables: Tables, scene: Scene, drawn: DrawnMatrices, length: float) -> str | None:
    """Return the law that a run breaks; the run lasts some periods."""
    body = scene.body
    assert isinstance(body, StructureBody)
    natural = np.array(body.assembly.frequencies)
    elastic = natural[natural > 0.0]
    lowest, highest = (elastic.min(), elastic.max()) if len(elastic) else (drawn.natural, drawn.natural)
    # a dashpot at a light unknown is much faster than any period, and coupled damping is followed by series
    highest = max(highest, float(np.linalg.eigvalsh(body.assembly.damping).max()))
    pressed = _pressed_rate(scene, length)
    time = 2.0 * np.pi * min(PERIODS_LOW / lowest, PERIODS_HIGH / highest, PERIODS_PRESSED / pressed)
    timed = {"record.recorded_time": time, "record.time_series.rate": SAMPLES / time}
    scene = scene.with_values(timed)
    found = vi.run(scene)
    outcome = int(found.outcome)
    if highest > EXTREME and "parameters of extreme size" in found.message.item():
        return None
    if outcome >= ERROR and outcome != UNBOUNDED:
        return f"outcome {outcome}: {found.message.item()}"
    least = 1e-14 * drawn.unit[0] * length**2
    return energy_problem(tables, found, least) or room_problem(tables, scene, found, length)


def _pressed_rate(scene: Scene, length: float) -> float:
    """Return the fastest rate of a point on its yielding stop, 1/s: its series go in steps of about a radian of it."""
    floats, found = scene.body.fmu_floats(None, scene.stops, None), [1e-300]
    for place, stop in enumerate(scene.stops, start=1):
        shape = [value for name, value in floats.items() if name.startswith(f"mode.contact_shape[{place},")]
        mobility, deepest = float(np.dot(shape, shape)), DEEPEST * length
        if stop.law == "kelvin_voigt":
            found += [np.sqrt(mobility * stop.stiffness), mobility * stop.damping]
        elif stop.law != "restitution":
            found.append(np.sqrt(mobility * stop.stiffness * 1.5 * np.sqrt(deepest)))
            found.append(mobility * stop.stiffness * deepest**1.5 * getattr(stop, "damping", 0.0))
    return float(max(found))


def _modes_problem(random: np.random.Generator, drawn: DrawnMatrices) -> str | None:
    """Return the difference from the modes of a dense solution, and from its static flexibility at two points."""
    places = sorted({pick(random, *drawn.used.tolist()) for _ in range(2)})
    count = drawn.rigid + len(places) + pick(random, 1, 4, 10)
    if count > 64:
        return None
    given = Matrices(csc_array(drawn.stiffness), csc_array(drawn.mass), None, drawn.names)
    try:
        found = reduce(
            given, {drawn.names[place]: {drawn.names[place]: 1.0} for place in places}, modes=count
        )
    except UsageError as refusal:
        return f"refused with {count} modes: {refusal}"
    rigid = int((found.natural == 0.0).sum())
    if rigid != drawn.rigid:
        return f"{rigid} rigid-body modes, not {drawn.rigid}"
    return _dense_problem(drawn, found, places)


def _dense_problem(drawn: DrawnMatrices, found: Modes, places: list[int]) -> str | None:
    """Compare modes with those of M phi = mu (K + s M) phi, which has no infinite and no zero eigenvalue."""
    elastic = found.natural[drawn.rigid :] ** 2
    if not len(elastic):
        return None
    shift, square = float(elastic[0]), np.ix_(drawn.used, drawn.used)
    stiffness, mass = drawn.stiffness[square], drawn.mass[square]
    held = stiffness + shift * mass
    scale = np.outer(*[1.0 / np.sqrt(held.diagonal())] * 2)
    inverse = linalg.eigh(mass * scale, held * scale, eigvals_only=True)[::-1]
    kept = len(found.natural) - found.residual_vectors
    own = 1.0 / (found.natural[drawn.rigid : kept] ** 2 + shift)
    off = np.abs(own - inverse[drawn.rigid : kept]) / (SQUARES * own + REFERENCE * inverse[0])
    if off.max(initial=0.0) > 1.0:
        return f"squares of frequencies off by {off.max():.3g} times the allowed"
    rows = np.searchsorted(drawn.used, places)
    return None if drawn.rigid else _flexibility_problem(found, stiffness, rows)


def _flexibility_problem(found: Modes, stiffness: Floats, rows: NDArray[np.int64]) -> str | None:
    """Compare the static flexibility of points with K^-1: residual vectors make it exact where mass is."""
    scale = 1.0 / np.sqrt(stiffness.diagonal())
    loads = np.zeros((len(scale), len(rows)))
    loads[rows, range(len(rows))] = scale[rows]
    exact = loads.T @ linalg.solve(stiffness * np.outer(scale, scale), loads, assume_a="pos")
    shapes = np.array(list(found.shapes.values()))
    off = np.abs((shapes / found.natural**2) @ shapes.T - exact)
    worst = float((off / np.sqrt(np.outer(exact.diagonal(), exact.diagonal()))).max())
    is_massless = any("no mass" in remark for remark in found.remarks)
    allowed = FLEXIBILITY + (found.error or 0.0 if is_massless else 0.0)
    return f"flexibility off by {worst:.3g}, of {allowed:.3g} allowed" if worst > allowed else None
