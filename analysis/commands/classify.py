"""What `vibroimpact classify` does: the class of each run of a dataset, counted, written and drawn."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from vibroimpact.analysis.commands.found import refuse_places
from vibroimpact.analysis.dataset import dataset_file, open_dataset, read_flat, write_dataset
from vibroimpact.analysis.dataset.outputs import writing
from vibroimpact.analysis.operations.classify import Classify
from vibroimpact.analysis.orbits.classify import RunClass, classify, with_classes
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal

_MADE_BY = "classified_from"


def show_classes(options: Classify) -> None:
    """Classify the runs of a dataset; print how many there are of each class, write and draw them."""
    path, output, figure = options.file, options.output, options.figure
    file = dataset_file(path)
    refuse_places(options, [file], **{_MADE_BY: str(path)})
    with open_dataset(file) as dataset:
        try:
            classes = classify(dataset)
        except DatasetError as problem:
            raise problem.named(file) from problem
        units = dataset.attrs["units_system"]
    _print(classes)
    if output is None and figure is None:
        return
    with TemporaryDirectory() as folder:
        target = output or Path(folder, "classes.nc")
        write_dataset(
            with_classes(read_flat(file), classes, units).assign_attrs({_MADE_BY: str(path)}), target
        )
        if output is not None:
            say(f"Dataset written to {output}.")
        if figure is not None:
            from vibroimpact.analysis import figures  # half a second, which a table needs not

            with open_dataset(target) as dataset, writing(figure):
                figures.save(figures.draw(dataset, "classes"), figure)
            say(f"Figure written to {figure}.")


def _print(classes: list[RunClass]) -> None:
    rows = table("Classes of the runs", "<class", ">runs", "<why")
    for (name, reason), count in Counter((each.name, each.reason) for each in classes).most_common():
        rows.add_row(name, f"{count}", reason)
    wide_terminal().print(rows)
