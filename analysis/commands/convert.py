"""The command `vibroimpact convert`."""

from __future__ import annotations

import time

from vibroimpact.analysis.dataset.outputs import refuse_overwriting, writing
from vibroimpact.analysis.dataset.places import dataset_place, given_place
from vibroimpact.analysis.dataset.stores.converting import convert_dataset, refuse_conversion
from vibroimpact.analysis.files.opening import file_attributes
from vibroimpact.analysis.files.stores import size_of
from vibroimpact.analysis.operations.convert import Convert
from vibroimpact.fmus.messages import counted
from vibroimpact.fmus.terminal import Terminal, say


def convert_file(options: Convert) -> None:
    """Convert a dataset, and print the number of its runs and the sizes of both forms."""
    began = time.perf_counter()
    place, output = dataset_place(options.file), given_place(options.output)
    refuse_conversion(place, output)
    attributes = file_attributes(place)
    refuse_overwriting(output, options.force, lambda there: there.items() <= attributes.items())
    with writing(output), Terminal(stderr=True).status("Converting") as status:
        runs = convert_dataset(
            place, output, lambda done, of: status.update(f"Converting: {done:,} of {of:,} runs")
        )
    seconds = time.perf_counter() - began
    say(f"{counted(runs, 'run')} in {seconds:.1f} s: {output}, {_size(output)}; {place} has {_size(place)}.")


def _size(place: object) -> str:
    stored, objects = size_of(str(place))
    return f"{stored / 1e6:.1f} MB in {counted(objects, 'file')}"
