"""Errors of a description against FMI's schema, graded; attributes and elements without a use here are left out."""

from __future__ import annotations

import difflib
import re
from collections.abc import Generator
from contextlib import closing
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from lxml import etree

from vibroimpact.fmus.packaging.model_description.findings import Findings, Grade

_XSD = "{http://www.w3.org/2001/XMLSchema}"
_XSI = "{http://www.w3.org/2001/XMLSchema-instance}"
#: Elements whose content belongs to a tool.
_FREE = {"VendorAnnotations", "Annotations"}
#: Attributes without influence on any number, here or in an FMU.
INCONSEQUENTIAL = {
    *("modelName", "description", "author", "version", "copyright", "license", "generationTool", "quantity"),
    *("generationDateAndTime", "variableNamingConvention", "displayUnit", "nominal", "unbounded"),
    *("relativeQuantity", "startTime", "stopTime", "dependenciesKind", "numberOfEventIndicators"),
}
#: Attributes that can be ignored; the finding states what is assumed then.
DISPENSABLE = {
    *("min", "max", "start", "unit", "tolerance", "stepSize", "dependencies", "variability", "initial"),
    *("reinit", "derivative", "fixedInternalStepSize", "maxOutputDerivativeOrder"),
    "recommendedIntermediateInputSmoothness",
}
#: Children of the root that are accepted at any place.
_ANYWHERE = {
    *("UnitDefinitions", "TypeDefinitions", "LogCategories", "DefaultExperiment"),
    *("ModelExchange", "CoSimulation", "ScheduledExecution"),
}
#: Lists that need not be there: an empty one, which the schema forbids, is no list.
_LISTS = {
    *("Outputs", "Derivatives", "DiscreteStates", "InitialUnknowns"),
    *("UnitDefinitions", "TypeDefinitions", "LogCategories", "SourceFiles"),
}
#: Rounds of validation, in each of which elements may be left out; errors that are graded one by one.
_MOST_ROUNDS, _MOST_ERRORS = 20, 1000
#: Number of an element's children that the schema checks at a time.
_WINDOW = 500
#: Number of refusals in the answer; characters of a name for comparison with the schema, or of a quoted value.
_MOST_REFUSALS, _LONGEST = 10, 80
_BOOLEAN = "'xs:boolean'"
_ATTRIBUTE = re.compile(r"attribute '([^']+)'")


def amend_by_schema(root: Any, version: str, schemas: Path, findings: Findings) -> None:
    """Amend a description, in place, until the schema of its version accepts it, or add the reasons of its refusal."""
    folder = schemas / f"fmi{version[0]}"
    _drop_annotations(root)
    _drop_unknown_attributes(root, version, folder, findings)
    _Amendments(root, folder, findings).make()


def build_problems(content: bytes, schemas: Path) -> tuple[str, ...]:
    """Return the errors of a `sources/buildDescription.xml` against FMI 3.0's schema; no run uses this file."""
    try:
        root = etree.fromstring(content, etree.XMLParser(resolve_entities=False, no_network=True))
    except etree.XMLSyntaxError as error:
        return (f"expected well-formed XML, got: {error}.",)
    schema = _schema(schemas / "fmi3", "BuildDescription")
    if schema.validate(root):
        return ()
    return tuple(f"line {e.line}: {_cut_message(e.message)}" for e in list(schema.error_log)[:_MOST_REFUSALS])


@cache
def _schema(folder: Path, kind: str = "ModelDescription") -> Any:
    return etree.XMLSchema(etree.parse(folder / f"{folder.name}{kind}.xsd"))


@cache
def _names(folder: Path, kind: str) -> frozenset[str]:
    files = [etree.parse(path) for path in folder.glob("*.xsd")]
    return frozenset(e.get("name", "") for file in files for e in file.iter(f"{_XSD}{kind}"))


def _drop_annotations(root: Any) -> None:
    """Remove the content of annotations: FMI's schema allows one element there, and tools write several."""
    for element in list(root.iter(*_FREE)):
        if element.getparent() is not None:
            element.getparent().remove(element)


def _drop_unknown_attributes(root: Any, version: str, folder: Path, findings: Findings) -> None:
    """Remove attributes with names unknown to the schema, which lets some pass in any spelling."""
    known = _names(folder, "attribute")
    for element in root.iter(etree.Element):
        for name in [name for name in element.attrib if name not in known and not name.startswith(_XSI)]:
            del element.attrib[name]
            near = "" if name.startswith("{") else _nearest(name[:_LONGEST], known)
            hint = f" Did you mean {near}?" if near else ""
            got = f"{element.tag}: expected an attribute of FMI {version}'s schema, got {_cut(name)}.{hint}"
            findings.add(Grade.doubt if near else Grade.remark, got)


@lru_cache(maxsize=1024)
def _nearest(name: str, known: frozenset[str]) -> str:
    """Return the nearest of the known names, in 2 ms of processor time; empty if none is near."""
    return next(iter(difflib.get_close_matches(name, known, n=1)), "")


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def _windows(root: Any) -> Generator[None, None, None]:
    """Show a few children of each name at a time in large elements; each window begins with the last of the one before.

    The library walks through all children before the child of an error: 100,000 errors would take minutes.
    """
    many = [_Children(one) for one in root.iter(etree.Element) if len(one) > _WINDOW]
    try:
        for first in range(0, max((one.most for one in many), default=1), _WINDOW):
            for one in many:
                one.show(first)
            yield
    finally:
        for one in many:
            one.show_all()


class _Children:
    """The children of an element by name; few children of a name always stay, since the schema may require them."""

    def __init__(self, parent: Any) -> None:
        self._parent, self._all = parent, list(parent)
        places: dict[Any, list[int]] = {}
        for place, child in enumerate(self._all):
            places.setdefault(child.tag, []).append(place)
        self._places = list(places.values())
        self.most = max(map(len, self._places))

    def show(self, first: int) -> None:
        """Show the children from a number on, in their order."""
        shown: list[int] = []
        for places in self._places:
            few = len(places) <= _WINDOW
            shown += places if few else places[max(first - 1, 0) : first + _WINDOW] or places[:1]
        self._parent[:] = [self._all[place] for place in sorted(shown)]

    def show_all(self) -> None:
        """Put all children back."""
        self._parent[:] = self._all


class _Amendments:
    """Changes to a description until the schema accepts it."""

    def __init__(self, root: Any, folder: Path, findings: Findings) -> None:
        self._root, self._folder, self._findings = root, folder, findings
        self._moved: list[Any] = []
        self._accepted: set[str] = set()

    def make(self) -> None:
        """Amend the description; refuse the faults that cannot be amended."""
        for _ in range(_MOST_ROUNDS):
            errors = self._errors()
            left = [error for error, element in errors if not self._amend(error, element)]
            if left or not errors:
                break
        else:
            left = [error for error, _ in self._errors()]
        for error in left[:_MOST_REFUSALS]:
            self._findings.add(Grade.refused, f"line {error.line}: {_cut_message(error.message)}")
        self._root.extend(self._moved)

    def _errors(self) -> list[tuple[Any, Any]]:
        """Return errors with their elements, before any element is removed: removals change the places."""
        schema = _schema(self._folder)
        found: dict[tuple[Any, str, int], tuple[Any, Any]] = {}
        with closing(_windows(self._root)) as windows:
            for _ in windows:
                if schema.validate(self._root):
                    continue
                for error in list(schema.error_log)[:_MOST_ERRORS]:
                    if error.message not in self._accepted:
                        element = self._element(error)
                        found.setdefault((element, error.message, error.line), (error, element))
                if len(found) >= _MOST_ERRORS:
                    break
        return list(found.values())[:_MOST_ERRORS]

    def _element(self, error: Any) -> Any:
        """Return the element of an error; None if the schema does not name it."""
        found = self._root.getroottree().xpath(error.path) if error.path else []
        return found[0] if found else None

    def _amend(self, error: Any, element: Any) -> bool:
        """Amend the fault behind one error; return whether that was possible."""
        attribute = _ATTRIBUTE.search(error.message)
        if element is None:
            return False
        if attribute is None:
            return self._amend_element(error, element)
        if element.get(attribute[1]) is None:
            return self._accept_missing(error, element, attribute[1])
        return self._drop_attribute(error, element, attribute[1])

    def _accept_missing(self, error: Any, element: Any, name: str) -> bool:
        """Accept a missing attribute that nothing needs, or that an earlier error was about."""
        if "is required but missing" not in error.message:
            return True
        if name not in INCONSEQUENTIAL:
            return False
        self._accepted.add(error.message)
        self._findings.add(Grade.remark, f"{element.tag}: expected an attribute {name}, got none.")
        return True

    def _drop_attribute(self, error: Any, element: Any, name: str) -> bool:
        if _BOOLEAN in error.message and element.get(name).strip().lower() in ("true", "false"):
            element.set(name, element.get(name).strip().lower())
            text = (
                f"{element.tag}: {name}: expected true or false in small letters, got others. Read as them."
            )
            self._findings.add(Grade.remark, text)
            return True
        misplaced = "is not allowed" in error.message and "attribute" in error.message
        if not misplaced and name not in INCONSEQUENTIAL | DISPENSABLE:
            return False
        value = element.attrib.pop(name)
        grade = Grade.remark if name in INCONSEQUENTIAL else Grade.doubt
        expected = f"no attribute {name}" if misplaced else "a value that FMI allows"
        got = f"{element.tag}: {name}: expected {expected}, got {_cut(value)!r}. It is not looked at."
        self._findings.add(grade, got)
        return True

    def _amend_element(self, error: Any, element: Any) -> bool:
        """Remove an empty list or an element unknown to FMI; collect a misplaced one, put in its place at the end."""
        tag = str(element.tag)
        if "Missing child element" in error.message and tag in _LISTS and not len(element):
            self._findings.add(
                Grade.remark, f"{tag}: expected a list with entries, got an empty one. Read as none."
            )
            element.getparent().remove(element)
            return True
        if "This element is not expected" not in error.message or element is self._root:
            return False
        if element.getparent() is None:  # removed before
            return True
        if element.getparent() is self._root and tag in _ANYWHERE and tag not in {e.tag for e in self._moved}:
            self._moved.append(element)
            got = (
                f"{tag}: expected it in the order of FMI's schema, got it at another place. It is read there."
            )
        elif tag not in _names(self._folder, "element"):
            got = f"{_cut(tag)}: expected an element of FMI's schema, got another. It is not looked at."
        else:
            return False
        self._findings.add(Grade.remark, got)
        element.getparent().remove(element)
        return True


def _cut_message(message: str) -> str:
    return message if len(message) <= 5 * _LONGEST else f"{message[: 5 * _LONGEST]}..."
