"""ModelStructure of a description: outputs, derivatives and unknowns of initialization, and their dependencies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from vibroimpact.fmus.packaging.model_description.findings import Findings, Grade, listed
from vibroimpact.fmus.packaging.model_description.variables import Variable

#: Place of the lists of unknowns in each version.
_PLACES = {
    2: {
        "outputs": "Outputs/Unknown",
        "derivatives": "Derivatives/Unknown",
        "initial": "InitialUnknowns/Unknown",
    },
    3: {
        "outputs": "Output",
        "derivatives": "ContinuousStateDerivative",
        "initial": "InitialUnknown",
        "clocked": "ClockedState",
        "indicators": "EventIndicator",
    },
}


def amend_structure(root: Any, variables: list[Variable], major: int, findings: Findings) -> None:
    """Amend, in place, the ModelStructure of a schema-valid description, and the derivatives of its variables.

    The variables must be amended before.
    """
    structure = _Structure(root, variables, major, findings)
    structure.amend_derivatives()
    found = {kind: list(structure.unknowns(place)) for kind, place in _PLACES[major].items()}
    structure.look_at_outputs(found["outputs"])
    structure.look_at_initial_unknowns(found["initial"], found["derivatives"])


class _Structure:
    def __init__(self, root: Any, variables: list[Variable], major: int, findings: Findings) -> None:
        self._root, self._variables, self._major, self._findings = root, variables, major, findings
        if major == 2:
            self._by_reference = {str(place): v for place, v in enumerate(variables, 1)}
        else:
            numbered = ((_plain_number(v.reference), v) for v in variables)
            self._by_reference = {number: v for number, v in numbered if number is not None}

    def _named(self, reference: str) -> Variable | None:
        """Return the variable of a reference: its place in FMI 2.0, its value reference in FMI 3.0."""
        number = _plain_number(reference)
        return None if number is None else self._by_reference.get(number)

    def amend_derivatives(self) -> None:
        """Remove references to derivatives of variables that do not exist."""
        for variable in self._variables:
            reference = variable.value.get("derivative")
            if reference is not None and self._named(reference) is None:
                del variable.value.attrib["derivative"]
                text = "expected the derivative of a variable that is there, got that of none. It is not looked at."
                self._findings.add(Grade.remark, text, variable.name)

    def unknowns(self, place: str) -> Iterator[Variable]:
        """Yield the variables that a part of ModelStructure lists; entries without a variable are removed."""
        for element in self._root.findall(f"ModelStructure/{place}"):
            variable = self._named(element.get("index" if self._major == 2 else "valueReference", ""))
            if variable is None:
                element.getparent().remove(element)
                text = f"ModelStructure/{place}: expected variables that are there, got others. They are left out."
                self._findings.add(Grade.doubt, text)
                continue
            self._amend_dependencies(element, place, variable)
            yield variable

    def _amend_dependencies(self, element: Any, place: str, variable: Variable) -> None:
        dependencies = (element.get("dependencies") or "").split()
        kinds = element.get("dependenciesKind")
        if any(self._named(one) is None for one in dependencies):
            del element.attrib["dependencies"]
            element.attrib.pop("dependenciesKind", None)
            text = f"expected dependencies in {place} that are there, got others. Taken to depend on none."
            self._findings.add(Grade.doubt, text, variable.name)
        elif kinds is not None and len(kinds.split()) != len(dependencies):
            del element.attrib["dependenciesKind"]
            text = f"expected a dependenciesKind for each of its dependencies in {place}, got others."
            self._findings.add(Grade.remark, text, variable.name)

    def look_at_outputs(self, found: Iterable[Variable]) -> None:
        """Add findings for outputs missing in ModelStructure, and for other variables listed there."""
        there = [v.name for v in found]
        expected = [v.name for v in self._variables if v.causality == "output"]
        if lacking := _without(expected, there):
            text = f"ModelStructure: expected all outputs, got none of {listed(lacking)}. Taken to depend on no input."
            self._findings.add(Grade.doubt, text)
        if more := _without(there, expected):
            self._findings.add(
                Grade.remark, f"ModelStructure: expected outputs alone, got {listed(more)} too."
            )

    def look_at_initial_unknowns(self, found: Iterable[Variable], derivatives: Iterable[Variable]) -> None:
        """Add findings for missing unknowns of initialization, and for other variables listed there."""
        there = [v.name for v in found]
        expected = [v.name for v in self._variables if _is_unknown(v)]
        for derivative in derivatives:
            reference = derivative.value.get("derivative")
            if reference is None:
                text = "expected the state whose derivative it is, as ModelStructure says, got none."
                self._findings.add(Grade.remark, text, derivative.name)
                continue
            state = self._named(reference)
            expected += [v.name for v in (state, derivative) if v is not None and v.initial in _CALCULATED]
        for what, names in (("none of", _without(expected, there)), ("also", _without(there, expected))):
            if names:
                text = f"ModelStructure: expected its unknowns of initialization, got {what} {listed(names)}."
                self._findings.add(Grade.remark, text)


_CALCULATED = ("approx", "calculated")


def _is_unknown(variable: Variable) -> bool:
    if variable.causality == "calculatedParameter":
        return True
    clocked = variable.element.get("clocks") is not None
    return variable.causality == "output" and variable.initial in _CALCULATED and not clocked


def _without(names: Iterable[str], others: Iterable[str]) -> list[str]:
    left_out = set(others)
    return [name for name in dict.fromkeys(names) if name not in left_out]


def _plain_number(text: str) -> str | None:
    """Return a reference without blanks and leading zeros; None for anything else, or a longer one than any valid."""
    digits = text.strip()
    number = digits.lstrip("0") or digits[:1]
    return number if digits.isdecimal() and len(number) <= 20 else None
