"""Long tests: thousands of random cases of each kind, run by `make soak`.

`make test` takes a sample of each kind except the slow ones (`test_sample.py`).

A kind is a module of this folder whose name does not begin with `_` or `test_`:

- `CASES = 5000`: number of cases of `make soak`; 5,000 where it is left out
- `SAMPLE = 40`: number of cases of `make test`; all kinds together take less than a minute
- `SECONDS = 20.0`: processor time after which a case counts as hanging; five times as much wall time does as well
- `check(seed: int) -> str | None`: makes and tries the case of a seed; returns None, or the problem in one line

Kinds `grammar_*` draw files, documents and requests by the grammar of each format (`_drawn_files`). Sound input is
read back equal. Damaged input, or input with an odd field, is read or refused in one line.

The case follows from the seed alone. `check` runs in a process of its own, in which warnings are errors. The current
folder is empty, belongs to the case, and is removed with its content (`tempfile` uses it too). An exception, a dead
process and a process without an answer are problems as well; the runner says where. `PYTHONPATH=tests python -m soak
KIND SEED` repeats one case, in a debugger if need be; `python -m soak KIND ...` runs some kinds.
"""
