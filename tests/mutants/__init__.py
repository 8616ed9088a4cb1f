"""`python -m mutants`: faults put into the C core on purpose, which `hard-cases` and quick tests have to notice.

Each fault patches a copy of the sources, whose file alone is compiled again; nothing that is shipped knows of it.
"""
