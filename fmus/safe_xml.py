"""Parser for untrusted XML: no document type and no entities, so nothing to expand and nothing to fetch.

A document is limited in size, and the parser gets it whole. The time of expat 2.5 grows with the square of a
token's size. A token of 16 MiB takes 1.5 s in pieces and 0.1 s in one.
"""

from __future__ import annotations

from typing import NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from vibroimpact.fmus.errors import ComponentFileError

LARGEST_XML = 1 << 24
"""Largest size of a document, bytes; a description of thousands of variables is below a million."""


def refuse_large(size: int, where: str) -> None:
    """Raise ComponentFileError if a document has more than `LARGEST_XML` bytes; the message begins with `where`."""
    if size > LARGEST_XML:
        raise ComponentFileError(
            f"{where}: expected XML of at most {LARGEST_XML} bytes, got {size}. It was not read."
        )


def root_of(content: bytes, where: str, *, namespaces: bool = False) -> Element:
    """Parse a document and return its root; messages begin with `where`.

    The parser itself reports declarations, so they are found in every encoding that it reads.

    Parameters
    ----------
    content : bytes
    where : str
    namespaces : bool
        Whether to put the namespace in braces before each name that has one, whatever its prefix: `{http://...}System`.

    Raises
    ------
    ComponentFileError
        The document is larger than `LARGEST_XML`, not well-formed, or declares a document type or an entity.
    """
    refuse_large(len(content), where)
    builder = TreeBuilder()
    parser = expat.ParserCreate(namespace_separator="}" if namespaces else None)
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    if namespaces:
        parser.StartElementHandler = lambda name, attributes: builder.start(
            _braced(name), {_braced(key): value for key, value in attributes.items()}
        )
        parser.EndElementHandler = lambda name: builder.end(_braced(name))
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = _refuse_doctype
    parser.EntityDeclHandler = _refuse_entity
    try:
        parser.Parse(content, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise ComponentFileError(f"{where}: expected well-formed XML, got: {error}.") from error
    except _DeclarationError as error:
        raise ComponentFileError(
            f"{where}: expected XML without {error}, got one with it. It was not read."
        ) from None
    return builder.close()


def _braced(name: str) -> str:
    # a name in no namespace has no brace
    return f"{{{name}" if "}" in name else name


class _DeclarationError(Exception):
    """Carries the kind of a declaration out of the parser's callback."""


def _refuse_doctype(*_: object) -> NoReturn:
    raise _DeclarationError("a document type declaration (which can hide entities)")


def _refuse_entity(*_: object) -> NoReturn:
    raise _DeclarationError("entity declarations")
