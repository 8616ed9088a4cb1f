"""Whether parsers cost no more than in proportion to what they read: n, 2n and 4n tokens of each kind.

A module that is neither `_` nor `test_` lists kinds of tokens, each with the content that has `count` of them and with
the reader. `make test` tries one kind of each parser, `make soak` all of them, up to the size that is allowed.
"""
