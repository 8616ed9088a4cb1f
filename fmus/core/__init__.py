"""The C core, called from Python: exact motion of an oscillator, modes of beams, near pairs of delay vectors."""

from vibroimpact.fmus.core.contact_laws import ContactLaw, contact_law, contact_laws, numbered_contact_law
from vibroimpact.fmus.core.correlation import (
    MOST_EMBEDDING,
    MOST_RADII,
    RADII_PER_OCTAVE,
    near_pairs,
    radius_ladder,
)
from vibroimpact.fmus.core.library import core_library
from vibroimpact.fmus.core.modes import BeamModes, Boundary, beam_modes
from vibroimpact.fmus.core.oscillator import Contact, Oscillator, flow, motion, next_contact

__all__ = [
    "MOST_EMBEDDING",
    "MOST_RADII",
    "RADII_PER_OCTAVE",
    "BeamModes",
    "Boundary",
    "Contact",
    "ContactLaw",
    "Oscillator",
    "beam_modes",
    "contact_law",
    "contact_laws",
    "core_library",
    "flow",
    "motion",
    "near_pairs",
    "next_contact",
    "numbered_contact_law",
    "radius_ladder",
]
