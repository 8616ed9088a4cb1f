"""What is long: thousands of random cases of each kind, run by `make soak`.

`make test` takes a sample of each kind but the dear ones (`test_sample.py`).

A kind is a module of this folder whose name does not begin with `_` or `test_`:

    CASES = 5000      # how many `make soak` runs (5,000 where it is left out)
    SAMPLE = 40       # how many `make test` runs; all kinds together take less than a minute
    SECONDS = 20.0    # processor time after which a case counts as hanging; 5 times this of wall time does, too

    def check(seed: int) -> str | None:
        '''Make the case of this seed and try it; None where all is well, else the problem in one line.'''

Kinds `grammar_*` draw files, documents and requests by the grammar of each format (`_drawn_files`): what is sound is
read back equal, what is odd in some field or damaged is read or refused in one line.

The case follows from the seed alone. `check` runs in a process of its own in which warnings are errors; the current
folder is empty, belongs to the case, and is removed with all that is in it (`tempfile` uses it too). An exception,
a process that dies and one that does not answer are problems as well; the runner says where. One case again, in a
debugger if need be: `PYTHONPATH=tests python -m soak KIND SEED`; some kinds: `python -m soak KIND ...`.
"""
