"""Whether the cost of parsers is at most proportional to their input: n, 2n and 4n tokens of each kind.

A module whose name begins with neither `_` nor `test_` lists kinds of tokens. Each kind has a maker of content with
`count` tokens, and a reader. `make test` tries one kind of each parser, `make soak` all of them, up to the allowed
size.
"""
