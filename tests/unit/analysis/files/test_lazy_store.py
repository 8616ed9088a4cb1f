from __future__ import annotations

import gc
from pathlib import Path

import numpy as np
from harness import warm
from support.dataset_examples import dataset_of, record

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import write_dataset
from vibroimpact.analysis.files import open_files

THREADS = """
import sys, threading
from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import read_flat, write_dataset

failed = []

def work(number):
    try:
        for turn in range(25):
            runs = open_dataset(sys.argv[1]).vibroimpact.runs  # dropped, not closed
            assert runs.final_displacement.values.size == 3000
            if turn % 5 == number:
                write_dataset(read_flat(sys.argv[1]), f"{sys.argv[1]}-{number}")
    except BaseException as error:
        failed.append(error)
        raise

threads = [threading.Thread(target=work, args=(number,)) for number in range(3)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
sys.exit(len(failed))
"""


def test_threads_read_and_write_side_by_side(tmp_path: Path) -> None:
    write_dataset(
        dataset_of([record(float(value), impacts=1) for value in range(3000)]), tmp_path / "runs.nc"
    )
    # in a separate process, which such a fault would end
    ended = warm.run(THREADS, tmp_path / "runs.nc")
    assert ended.returncode == 0, ended.stderr[-2000:]


def test_a_dropped_dataset_reads_on_where_something_of_it_is_left(tmp_path: Path) -> None:
    write_dataset(dataset_of([record(1.0), record(2.0)]), tmp_path / "runs.nc")
    final = open_dataset(tmp_path / "runs.nc").final_displacement
    gc.collect()
    assert np.array_equal(final.values, [1.0, 2.0])


def test_a_closed_dataset_is_closed_once(tmp_path: Path) -> None:
    write_dataset(dataset_of([record(1.0)]), tmp_path / "runs.nc")
    first, second = open_dataset(tmp_path / "runs.nc"), open_dataset(tmp_path / "runs.nc")
    first.close()
    first.close()
    assert second.final_displacement.values == 1.0  # the file is still open for the other
    second.close()
    assert str(tmp_path / "runs.nc") not in [path for path, _ in open_files._open]
