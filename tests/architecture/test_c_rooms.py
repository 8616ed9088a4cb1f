"""The C core: modules without a circle, and folders that only look down, by their includes and calls."""

from __future__ import annotations

import re
from graphlib import CycleError, TopologicalSorter
from pathlib import Path, PurePosixPath

CORE = Path(__file__).parents[2] / "fmus" / "native" / "core"
#: Folders from the ground up; folders of one floor are independent of each other.
FLOORS = (
    (".",),
    ("motion",),
    ("contact", "measuring", "modes"),
    ("signals",),
    ("body",),
    ("body/modal",),
    ("body/modal/structure",),
    ("door",),
    ("lanes",),
)

INCLUDED = re.compile(r'^#include "([^"]+)"$', re.MULTILINE)
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
NAMED = re.compile(r"\bvi_\w+(?=\()")
DEFINED = re.compile(r"^(?!static)\w[\w *]*?\b(vi_\w+)\([^;{]*\)\n\{", re.MULTILINE)

#: Text of each file without its comments, by its path in the core.
FILES = {
    path.relative_to(CORE).as_posix(): COMMENT.sub("", path.read_text(encoding="utf-8"))
    for path in sorted(CORE.rglob("*.[ch]"))
}
#: The C file of each function that other files may call.
HOMES = {
    function: name
    for name, text in FILES.items()
    if name.endswith(".c")
    for function in DEFINED.findall(text)
}


def module(name: str) -> str:
    """Return the module of a C file or a header, without suffix: `motion/flow`."""
    return str(PurePosixPath(name).with_suffix(""))


def needed() -> dict[str, set[str]]:
    """Return for each module the modules whose header it includes or whose functions it calls."""
    graph: dict[str, set[str]] = {module(name): set() for name in FILES}
    for name, text in FILES.items():
        calls = {HOMES[function] for function in NAMED.findall(text) if function in HOMES}
        graph[module(name)] |= {module(other) for other in (*INCLUDED.findall(text), *calls)} - {module(name)}
    return graph


def floor(name: str) -> int:
    folder = str(PurePosixPath(name).parent)
    return next(number for number, folders in enumerate(FLOORS) if folder in folders)


def test_the_core_includes_only_files_of_the_core() -> None:
    assert [
        (name, other)
        for name, text in FILES.items()
        for other in INCLUDED.findall(text)
        if other not in FILES
    ] == []


def test_no_module_of_the_core_needs_one_that_needs_it() -> None:
    graph = needed()
    assert len(HOMES) > 150
    assert sum(map(len, graph.values())) > 100
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        raise AssertionError(" is needed by ".join(error.args[1])) from None


def test_folders_of_the_core_look_down_only() -> None:
    def is_below(other: str, name: str) -> bool:
        same_folder = PurePosixPath(other).parent == PurePosixPath(name).parent
        return same_folder or floor(other) < floor(name)

    graph = needed()
    assert [(name, other) for name in graph for other in graph[name] if not is_below(other, name)] == []


def test_a_function_is_declared_in_the_header_of_its_file() -> None:
    elsewhere = [
        (name, function)
        for function, name in HOMES.items()
        if function not in NAMED.findall(FILES[str(PurePosixPath(name).with_suffix(".h"))])
    ]
    assert elsewhere == []
