"""`python -m mutants`: deliberate faults in the C core, which `hard-cases` and quick tests have to detect.

Each fault patches a copy of the sources, and only its file is compiled again; shipped code contains no trace of it.
"""
