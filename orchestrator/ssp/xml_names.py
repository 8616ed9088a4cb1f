"""The XML of SSP; a prefix that a file uses without a declaration has SSP's own meaning, as in tools that ignore it."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree.ElementTree import Element
from xml.parsers import expat
from xml.parsers.expat import errors

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.safe_xml import root_of
from vibroimpact.orchestrator.ssp.names import NAMESPACES

_UNBOUND = errors.codes[errors.XML_ERROR_UNBOUND_PREFIX]
_XMLNS = "xmlns"


def ssp_root(content: bytes, where: str) -> tuple[Element, tuple[str, ...]]:
    """Parse a file of SSP.

    Parameters
    ----------
    content : bytes
    where : str
        Its name, for messages.

    Returns
    -------
    root : Element
        Names have their namespace in braces.
    undeclared : tuple of str
        Prefixes that the file does not declare; they have their namespaces of `NAMESPACES`.

    Raises
    ------
    ComponentFileError
        As `safe_xml.root_of`: an undeclared prefix is an error if `NAMESPACES` lacks it.
    """
    try:
        return root_of(content, where, namespaces=True), ()
    except ComponentFileError as error:
        cause = error.__cause__
        if not isinstance(cause, expat.ExpatError) or cause.code != _UNBOUND:
            raise
        plain, undeclared = root_of(content, where), dict[str, None]()
        try:
            return _resolved(plain, undeclared), tuple(undeclared)
        except _UnknownPrefixError:
            raise error from None


class _UnknownPrefixError(Exception):
    """A prefix that neither the file nor SSP knows."""


def _resolved(root: Element, undeclared: dict[str, None]) -> Element:
    """Put namespaces in place of prefixes, without recursion; undeclared prefixes are added."""
    pending: list[tuple[Element, Mapping[str, str]]] = [
        (root, {"xml": "http://www.w3.org/XML/1998/namespace"})
    ]
    while pending:
        element, outer = pending.pop()
        own = {
            name.partition(":")[2]: value
            for name, value in element.attrib.items()
            if name.partition(":")[0] == _XMLNS
        }
        spaces = {**outer, **own} if own else outer
        element.tag = _expanded(element.tag, spaces, undeclared, default=spaces.get("", ""))
        element.attrib = {
            _expanded(name, spaces, undeclared): value
            for name, value in element.attrib.items()
            if name.partition(":")[0] != _XMLNS
        }
        pending += [(child, spaces) for child in element]
    return root


def _expanded(name: str, spaces: Mapping[str, str], undeclared: dict[str, None], default: str = "") -> str:
    prefix, colon, local = name.rpartition(":")
    if not colon:
        return f"{{{default}}}{name}" if default else name
    if prefix not in spaces:
        if prefix not in NAMESPACES:
            raise _UnknownPrefixError
        undeclared[prefix] = None
    return f"{{{spaces.get(prefix, NAMESPACES.get(prefix, ''))}}}{local}"
