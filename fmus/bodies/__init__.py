"""Bodies at the points of a sweep, from the parameters of their FMUs: modes, forcing, contacts, observed point."""

from vibroimpact.fmus.bodies.assembled import AssembledPoints
from vibroimpact.fmus.bodies.beam import BeamPoints
from vibroimpact.fmus.bodies.body_points import BodyPoints, Columns, ModalPoints
from vibroimpact.fmus.bodies.chain import ChainPoints
from vibroimpact.fmus.bodies.impacting_body import Contact, ImpactingBody
from vibroimpact.fmus.bodies.oscillator import OscillatorPoints

POINTS_OF_FMU: dict[str, type[BodyPoints]] = {
    "Oscillator": OscillatorPoints,
    "Chain": ChainPoints,
    "Beam": BeamPoints,
    "Structure": AssembledPoints,
}

__all__ = ["POINTS_OF_FMU", "BodyPoints", "Columns", "Contact", "ImpactingBody", "ModalPoints"]
