"""The table of variables in a component's README, between two marker comments."""

from __future__ import annotations

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.description.model import ComponentDescription, Variable
from vibroimpact.fmus.packaging.description.model_xml import literal

BEGIN = "<!-- variables: generated from variables.toml -->"
END = "<!-- end of variables -->"


def readme_table(component: ComponentDescription) -> str:
    """Return the Markdown table; a repeated block is shown once, with index k."""
    head = ["| variable | causality | unit | start | meaning |", "|---|---|---|---|---|"]
    return "\n".join(head + [_row(component, v) for v in component.variables if v.repeat_index <= 1])


def with_table(readme: str, component: ComponentDescription) -> str:
    """Return a README with its table up to date; raise ComponentFileError without a pair of marker comments."""
    before, begin, rest = readme.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not (begin and end):
        raise ComponentFileError(
            f"{component.folder}/README.md: expected the lines {BEGIN} and {END}, got none."
        )
    return f"{before}{BEGIN}\n{readme_table(component)}\n{END}{after}"


def _row(component: ComponentDescription, variable: Variable) -> str:
    only = " (FMI 3.0 only)" if variable.versions == (3,) and variable.causality != "independent" else ""
    if not variable.versions:
        only = f" (FMI 3.0, with `fmu export --{variable.ports}`)"
    kind = f"{variable.causality}, {variable.variability}"
    meaning = variable.shown_description.replace("|", "\\|")
    cells = (
        f"`{variable.shown_name}`",
        kind,
        variable.unit or "-",
        _start(component, variable),
        meaning + only,
    )
    return f"| {' | '.join(cells)} |"


def _start(component: ComponentDescription, variable: Variable) -> str:
    if variable.start is None:
        return "-"
    items = (item for e in component.enumerations if e.name == variable.enumeration for item in e.items)
    return next((item.name for item in items if item.value == variable.start), literal(variable.start))
