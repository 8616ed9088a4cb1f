"""Each contact law is named once: only the C file of the table names one, and scenes have the laws of the table."""

from __future__ import annotations

import re
from pathlib import Path

from vibroimpact.fmus.core import contact_laws
from vibroimpact.fmus.packaging.build import NATIVE, read_components
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.models import STOP_MODELS

TABLE = ("core/contact/contact_law.c", "core/contact/contact_law.h")
#: Names of laws that mean nothing else in the C: constants, names, and a number next to a comparison sign.
CONSTANT, NUMBER = re.compile(r"\bVI_LAW_[A-Z_]+\b(?<!_H)"), re.compile(r"\blaw *(?:[=!<>]=?) *[0-9]")
COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)


def naming_a_law(text: str) -> list[str]:
    """Return the places of a C file that name a law."""
    names = "|".join(law for law in contact_laws() if "_" in law or law == "hertz")
    code = COMMENT.sub("", text)
    quoted = re.compile(rf'"(?:{"|".join(law for law in contact_laws() if law != "none")})"')
    found = [*CONSTANT.findall(code), *NUMBER.findall(code), *quoted.findall(code)]
    return found + re.findall(rf"\b(?:{names})\b", text, re.IGNORECASE)


def test_no_c_file_but_that_of_the_table_names_a_contact_law() -> None:
    files = {path.relative_to(NATIVE).as_posix(): path for path in sorted(NATIVE.rglob("*.[ch]"))}
    assert len(files) > 150
    naming = {name: naming_a_law(path.read_text(encoding="utf-8")) for name, path in files.items()}
    assert {name: found for name, found in naming.items() if found and name not in TABLE} == {}
    assert naming[TABLE[0]]


def test_a_name_of_a_law_would_be_found() -> None:
    for line in (
        "if (law == VI_LAW_HERTZ) {",
        "if (contact->law.law == 3) {",
        "if (law >= 5) {",
        'vi_contact_law_number("restitution")',
        "/* as hunt_crossley has it */",
        "case HERTZ: break;",
    ):
        assert naming_a_law(line), line
    assert (
        naming_a_law("#define VIBROIMPACT_CONTACT_LAW_H\nlaw.restitution = 1.0; /* pair of contacts */") == []
    )


def test_scenes_have_the_laws_that_a_stop_evaluates_itself() -> None:
    own = {law.name: law.stop for law in contact_laws().values() if law.stop != "none" and not law.external}
    assert set(STOP_MODELS) == set(LAWS) == set(own)
    assert {name for name, law in LAWS.items() if law.is_rigid} == {
        name for name, stop in own.items() if stop == "rigid"
    }


def test_descriptions_have_the_laws_of_the_table() -> None:
    own = {law.name: law.number for law in contact_laws().values() if law.stop != "none" and not law.external}
    known = {law.name: law.number for law in contact_laws().values()}
    found = {
        component.name: {item.name: item.value for item in enumeration.items}
        for component in read_components()
        for enumeration in component.enumerations
        if enumeration.name == "ContactLaw"
    }
    bodies = ("Beam", "Chain", "Oscillator", "Structure")
    assert found == {**dict.fromkeys(bodies, known), "ImpactStop": own}


def test_contributing_names_two_files_for_a_law() -> None:
    text = Path(NATIVE.parents[1], "CONTRIBUTING.md").resolve().read_text(encoding="utf-8")
    law = text.split("**A contact law**", 1)[1].split("\n\n", 1)[0]
    named = re.findall(r"`((?:fmus|orchestrator|analysis)/[\w/]+\.\w+)`", law)
    assert named == ["fmus/native/core/contact/contact_law.c", "orchestrator/scene/models.py"]
