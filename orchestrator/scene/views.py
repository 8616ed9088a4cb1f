"""The view of a scene in a notebook: one line of text, and a table of its keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from vibroimpact.fmus.html_view import html_table
from vibroimpact.fmus.printable import printable
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.scene.sweep import run_count


class ViewedScene:
    """A scene with its view in notebooks."""

    def __repr__(self) -> str:
        return _short_text(self)

    __str__ = __repr__

    def _repr_html_(self) -> str:
        scene: Any = self
        return html_table(_short_text(scene), (), _keys(parse_toml(scene.text)))


def _short_text(scene: Any) -> str:
    """Return a scene in one line: its name, its bodies and contacts, its points."""
    said = f"{scene.title or Path(scene.source).stem}: {_parts(parse_toml(scene.text))}"
    if scene.sweep:
        said += f"; {run_count(scene.sweep)} points over {', '.join(axis.key for axis in scene.sweep)}"
    return printable(f"<Scene {said}>")


def _parts(document: Mapping[str, Any]) -> str:
    """Return the bodies and the numbers of stops, contacts and connections, in words.

    Examples
    --------
    >>> _parts({"body": {"mass": 1.0}, "stop": [{}, {}], "forcing": {}})
    'oscillator, forced, 2 stops'
    """
    if "component" in document:
        said = [f"components {', '.join(document['component'])}"]
    elif isinstance(document["body"], list):
        said = [f"bodies {', '.join(str(body['name']) for body in document['body'])}"]
    else:
        said = [str(document["body"].get("kind", "oscillator"))]
    forces = document.get("forcing")
    said += (
        [f"{len(forces)} forces"] if isinstance(forces, list) else ["forced"] if "forcing" in document else []
    )
    said += ["driven by recordings"] if "replay" in document else []
    for name in ("link", "stop", "contact", "connection"):
        count = len(document.get(name, ()))
        said += [f"{count} {name}{'' if count == 1 else 's'}"] if count else []
    return ", ".join(said)


def _keys(value: Any, key: str = "") -> Iterator[tuple[str, object]]:
    """Yield the keys in a document with their values; tables of an array are numbered from 1."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _keys(inner, f"{key}.{name}" if key else name)
    elif isinstance(value, list) and value and all(isinstance(each, dict) for each in value):
        for number, inner in enumerate(value, start=1):
            yield from _keys(inner, f"{key}[{number}]")
    else:
        yield key, value
