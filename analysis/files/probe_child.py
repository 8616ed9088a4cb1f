"""The process that reads files first: whatever damaged bytes do to the compiled libraries, they do it here.

Run by `probing`, as a file and not as a module: it needs the libraries alone. It answers each line of standard input,
a JSON object, with one line: {"verdict": "sound" | "raised" | "died" | "late", "error": ..., "text": ...}. Each file is
read in a process of its own, made by `fork` from this one, in which the libraries are imported already. A timer of
the system ends that process, also inside a library that never returns.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import select
import signal
import sys
import zlib
from collections.abc import Callable
from typing import Any

#: After this time without a file to read this process ends, s.
IDLE = 30.0
#: Values that are read at a time.
BLOCK = 1 << 20
#: Address space of the process that reads, bytes: what a file of some bytes promises may be any number.
MEMORY = 4 << 30
LONGEST_TEXT = 300


def read_netcdf(path: str, options: dict[str, Any]) -> None:
    """Read every attribute and every value of a NetCDF file; `most_bytes` is what it may promise.

    HDF5 can take values from other files. Where no other file can be opened, such values do not read, or are others.
    """
    values = _netcdf_values(path, options["most_bytes"])
    _let_open_one_more()
    if _netcdf_values(path, options["most_bytes"]) != values:
        raise ValueError("it takes values from another file")


def _netcdf_values(path: str, most: int) -> int:
    """Read a file; return a checksum of its values."""
    import netCDF4

    with netCDF4.Dataset(path, "r") as file:
        file.set_auto_maskandscale(False)
        promised = sum(_size(variable) for variable in file.variables.values())
        if promised > most:
            raise ValueError(f"it promises {promised} bytes of values, at most {most} fit")
        holders: list[Any] = [file, *file.variables.values()]
        for holder in holders:
            for name in holder.ncattrs():
                holder.getncattr(name)
        found = 0
        for variable in file.variables.values():
            found = _read_values(variable, found)
        return found


def _let_open_one_more() -> None:
    """Let this process open one file more at a time than it has open now, where the system can see to that."""
    if not hasattr(os, "fork"):
        return  # this process goes on to read other files
    import resource

    free = os.dup(0)  # the lowest number that no open file has
    os.close(free)
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (free + 1, most))


def _size(variable: Any) -> int:
    return math.prod(int(size) for size in variable.shape) * getattr(variable.dtype, "itemsize", 8)


def _read_values(variable: Any, found: int = 0) -> int:
    """Read all values, block by block; return the checksum `found` with them."""
    if not variable.shape or 0 in variable.shape:
        return _with(found, variable[...])
    rows = max(1, BLOCK // math.prod(variable.shape[1:]))
    for first in range(0, variable.shape[0], rows):
        found = _with(found, variable[first : first + rows])
    return found


def _with(found: int, values: Any) -> int:
    """Return a checksum continued by values; objects (texts) lie in the file itself, and do not count."""
    block = getattr(values, "data", values)
    kind = getattr(getattr(values, "dtype", None), "kind", "O")
    return found if kind == "O" else zlib.crc32(bytes(block), found)


def read_matlab(path: str, options: dict[str, Any]) -> None:
    """Read the arrays of a MATLAB file whose class is among `names`."""
    from scipy.io import loadmat, whosmat

    listed = whosmat(path)
    loadmat(path, variable_names=[name for name, _, kind in listed if kind in options["names"]])


def read_hdf5(path: str, options: dict[str, Any]) -> None:
    """Read the datasets of numbers of an HDF5 file, and attributes among `names`; no link out of it is followed."""
    import h5py

    with h5py.File(path, "r") as file:
        waiting: list[Any] = [file]
        seen, promised = set(), 0
        while waiting:
            item = waiting.pop()
            address = h5py.h5o.get_info(item.id).addr
            if address in seen:
                continue
            seen.add(address)
            for name in item.attrs:
                if name.lower() in options["names"]:
                    item.attrs[name]
            if isinstance(item, h5py.Dataset):
                promised += _read_dataset(item, options["most_bytes"] - promised)
            elif isinstance(item, h5py.Group):
                links = [name for name in item if isinstance(item.get(name, getlink=True), h5py.HardLink)]
                waiting += [item[name] for name in links]


def _read_dataset(item: Any, most: int) -> int:
    """Read a dataset of numbers that are in the file itself; return how many bytes they are."""
    if item.dtype.kind not in "fiub" or item.external or item.is_virtual or item.shape is None:
        return 0
    if max(item.nbytes, math.prod(item.chunks or ()) * item.dtype.itemsize) > most:
        raise ValueError(f"it promises {item.nbytes} bytes of values, at most {most} fit")
    _read_values(item)
    return int(item.nbytes)


def read_parquet(path: str, options: dict[str, Any]) -> None:
    """Read a Parquet file, a group of rows at a time; no more than `most_bytes` of values."""
    import pyarrow.parquet

    with pyarrow.parquet.ParquetFile(path) as file:
        if 8 * file.metadata.num_rows * file.metadata.num_columns > options["most_bytes"]:
            raise ValueError(
                f"it promises {file.metadata.num_rows} rows of {file.metadata.num_columns} columns"
            )
        for group in range(file.metadata.num_row_groups):
            file.read_row_group(group, use_threads=False).validate(full=True)


def read_feather(path: str, options: dict[str, Any]) -> None:
    """Read a Feather file, a batch of rows at a time."""
    import pyarrow.ipc

    with pyarrow.ipc.open_file(pyarrow.OSFile(path)) as file:
        for batch in range(file.num_record_batches):
            file.get_batch(batch).validate(full=True)


READERS: dict[str, tuple[str, Callable[[str, dict[str, Any]], None]]] = {
    "NetCDF": ("netCDF4", read_netcdf),
    "MATLAB": ("scipy.io", read_matlab),
    "HDF5": ("h5py", read_hdf5),
    "Parquet": ("pyarrow.parquet", read_parquet),
    "Feather": ("pyarrow.ipc", read_feather),
}
"""The library that reads each kind of file, and what is done with it."""


def read_here(order: dict[str, Any]) -> dict[str, str]:
    """Read the file of an order in this process."""
    try:
        _, read = READERS[order["kind"]]
        read(order["path"], order["options"])
    # whatever it is, it is what the file does to its reader
    except BaseException as error:
        return {"verdict": "raised", "error": type(error).__name__, "text": str(error)[:LONGEST_TEXT]}
    return {"verdict": "sound"}


def read_in_fork(order: dict[str, Any]) -> dict[str, str]:
    """Read the file of an order in a process of its own; say how that ended."""
    answers, answer = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(answers)
        _limit(order["seconds"])
        os.write(answer, json.dumps(read_here(order)).encode())
        os._exit(0)
    os.close(answer)
    with os.fdopen(answers, "rb") as pipe:
        # standard input speaks only when nobody waits for this answer any more
        if select.select([0, pipe.fileno()], [], [])[0] == [0]:
            os.kill(process, signal.SIGKILL)
        said = pipe.read()
    _, status = os.waitpid(process, 0)
    if os.WIFSIGNALED(status):
        ended_by = os.WTERMSIG(status)
        return {"verdict": "late" if ended_by == signal.SIGALRM else "died", "error": str(ended_by)}
    if status != 0 or not said:
        return {"verdict": "died", "error": ""}
    found: dict[str, str] = json.loads(said)
    return found


def _limit(seconds: float) -> None:
    """Let the system end this process after a time, and give it no more than `MEMORY`."""
    import resource

    ending = {signal.SIGALRM, signal.SIGINT}
    for number in ending:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ending)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    try:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, most))
    except (ValueError, OSError):
        return  # the system allows less already, or knows no such limit


def main() -> None:
    """Answer orders until standard input ends, or none has come for a while."""
    answers = os.dup(1)
    os.dup2(2, 1)  # what a library prints is no answer
    forks = hasattr(os, "fork")
    while not forks or select.select([0], [], [], IDLE)[0]:
        line = sys.stdin.buffer.readline()
        if not line:
            return
        order = json.loads(line)
        library, _ = READERS[order["kind"]]
        importlib.import_module(library)
        found = read_in_fork(order) if forks else read_here(order)
        os.write(answers, json.dumps(found).encode() + b"\n")


if __name__ == "__main__":
    main()
