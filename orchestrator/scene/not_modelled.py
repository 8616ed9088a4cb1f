"""Effects that no scene can have, by the words for them: a problem then names the effect (docs/scene.md)."""

from __future__ import annotations

import re
from typing import NamedTuple

LONGEST_WORD = 80
"""Longest key or value that may ask for an effect, in characters; a longer one is a mistake of another kind."""


class _Effect(NamedTuple):
    """An effect that is not modelled: the pattern of its words `table.word`, and what a message says of it."""

    words: re.Pattern[str]
    said: str


def _words(pattern: str) -> re.Pattern[str]:
    return re.compile(pattern, re.VERBOSE)


_EFFECTS = (
    _Effect(
        _words(
            r"""(stop|contact)\.(normal|tangent|angle|direction|inclination)(_.*)?
            | .*\.((rotor|rub|whirl|spin|circular|annular)(_.*)?|rubbing|.*_rotor|.*_rub)"""
        ),
        "Contacts whose direction turns, as in rotor rub, are not modelled: a contact limits one displacement.",
    ),
    _Effect(
        _words(
            r""".*\.((stiffness|stiffnesses|spring|damping|dampings|mass|masses)_(amplitude|angular_frequency|frequency
            |phase|modulation|depth|period|times|values|rate|variation|function)
            | .*(parametric|mathieu|time_varying|time_dependent|modulat).*)"""
        ),
        "Stiffness that varies in time, as in Mathieu's equation, is not modelled: the numbers of bodies are constant.",
    ),
    _Effect(
        _words(
            r""".*\.(geometry|large|.*large_(deflection|displacement|rotation|amplitude|angle)s?
            |.*geometric.*|.*karman.*|.*midplane.*|corotational|inextensible|pendulum)"""
        ),
        "Large deflections are not modelled: a pendulum of small angles has stiffness = mass gravity / length.",
    ),
    _Effect(
        _words(r""".*\.(.*(friction|coulomb|stribeck|stick_slip).*|mu)"""),
        "Friction is not modelled: damping_reciprocal of one body may stand for weak dry friction.",
    ),
    _Effect(
        _words(r"""(?!forcing\.).*\.(.*(cubic|quadratic|quintic|nonlinear|duffing|hardening|softening).*)"""),
        "Springs and dashpots that are not linear are not modelled: a stop that yields is a spring on one side.",
    ),
)


def effect_not_modelled(table: str, word: object) -> str:
    """Return the sentence on the effect that a word of a table asks for, if it is not modelled; else an empty text.

    Examples
    --------
    >>> effect_not_modelled("stop", "friction")
    'Friction is not modelled: damping_reciprocal of one body may stand for weak dry friction.'
    >>> effect_not_modelled("stop", "restitutoin")
    ''
    """
    if not isinstance(word, str) or len(word) > LONGEST_WORD:
        return ""
    text = f"{table}.{re.sub('[^a-z0-9]', '_', word.lower())}"
    return next((effect.said for effect in _EFFECTS if effect.words.fullmatch(text)), "")
