"""The OpenAPI document of the service, as its clients see it."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from vibroimpact.service.api import application
from vibroimpact.service.fmus import FmuStore
from vibroimpact.service.recordings import RecordingStore
from vibroimpact.service.scenes import Shelf
from vibroimpact.service.sessions import Sessions
from vibroimpact.service.store import Store
from vibroimpact.service.supervisor import Supervisor

PHRASES = {
    "Content Too Large": "Request Entity Too Large",
    "Range Not Satisfiable": "Requested Range Not Satisfiable",
    "Unprocessable Content": "Unprocessable Entity",
}
"""Name of an HTTP status in Python 3.13, and its earlier name."""


def openapi() -> str:
    """Return the document in a fixed order, without the version of the package."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        store = Store(folder)
        shelf = Shelf(RecordingStore(store), FmuStore(folder / "fmus", False))
        document = application(store, Supervisor(store), shelf, Sessions("token")).openapi()
        store.close()
    del document["info"]["version"]
    written = json.dumps(document, indent=1, sort_keys=True) + "\n"
    for new, old in PHRASES.items():
        written = written.replace(f'"{new}"', f'"{old}"')
    return written
