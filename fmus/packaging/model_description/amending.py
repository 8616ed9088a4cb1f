"""From the description of an FMU of any tool to one that FMPy reads, with all that is wrong in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lxml import etree

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.model_description.findings import Finding, Findings, Grade
from vibroimpact.fmus.packaging.model_description.schema import amend_by_schema
from vibroimpact.fmus.packaging.model_description.structure import amend_structure
from vibroimpact.fmus.packaging.model_description.variables import amend_variables, variables_of
from vibroimpact.fmus.safe_xml import root_of


@dataclass(frozen=True, slots=True)
class Amended:
    """A description whose faults are mended, as far as they can be."""

    content: bytes
    """The XML; the very bytes that were given where nothing was mended."""
    findings: tuple[Finding, ...]
    """All that is wrong with it."""

    @property
    def refusals(self) -> tuple[str, ...]:
        """What has no way round; empty for a description that can be read."""
        return tuple(finding.text for finding in self.findings if finding.grade is Grade.refused)


def amended(content: bytes, schemas: Path) -> Amended:
    """Return a modelDescription.xml as FMPy reads it, with what was wrong in it, by FMI's schemas in `fmi2` and `fmi3`.

    No XML, a document type, or an unknown version raises ComponentFileError.
    """
    version = root_of(content, "modelDescription.xml").get("fmiVersion", "")
    if version != "2.0" and not version.startswith("3.0"):
        raise ComponentFileError(
            f"modelDescription.xml: expected FMI 2.0 or 3.0, got FMI {version[:20] or 'of no version'}."
        )
    parser = etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True, remove_pis=True)
    try:
        root = etree.fromstring(content, parser)
    except etree.XMLSyntaxError as error:
        raise ComponentFileError(f"modelDescription.xml: expected well-formed XML, got: {error}.") from error
    findings = Findings()
    amend_by_schema(root, version, schemas, findings)
    if not any(finding.grade is Grade.refused for finding in findings.taken()):
        variables = variables_of(root, int(version[0]))
        amend_variables(root, variables, findings)
        amend_structure(root, variables, int(version[0]), findings)
    found = findings.taken()
    return Amended(etree.tostring(root) if found else content, found)
