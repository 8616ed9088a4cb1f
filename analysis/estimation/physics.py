"""What is known and what is asked of an oscillator that hits a stop.

Per unit mass, in the unit of the displacement: y'' + 2 zeta wn y' + wn^2 (y - y0) = wn^2 y_st cos(Omega t + psi)
for y below the stop y_s; at the stop the velocity V becomes -r V. zeta damping ratio, wn natural angular frequency, y0
offset (where the channel reads at rest), y_st static deflection, Omega and psi of the force, r restitution.
"""

from __future__ import annotations

from dataclasses import dataclass

from vibroimpact.fmus.core import Oscillator


@dataclass(frozen=True, slots=True)
class Forcing:
    """The harmonic force, on the clock of the recording: wn^2 static_deflection cos(angular_frequency t + phase).

    Attributes
    ----------
    angular_frequency : float
        rad/s.
    static_deflection : float or None
        Force amplitude over stiffness, in the unit of the displacement; None: not known, estimated.
    phase : float or None
        At time 0 of the recording, rad; None: not known, estimated.
    clock_drifts : bool
        The recording's clock and the generator's do not agree: the angular frequency is only a start value.
    """

    angular_frequency: float
    static_deflection: float | None = None
    phase: float | None = None
    clock_drifts: bool = False


@dataclass(frozen=True, slots=True)
class Known:
    """What is known beforehand, and so held instead of estimated; None: not known.

    Attributes
    ----------
    damping_ratio : float or None
    natural_frequency : float or None
        Angular, rad/s.
    stop_position : float or None
        In the unit of the displacement.
    offset : float or None
        What the channel reads at rest, in the unit of the displacement.
    side : str or None
        `upper` or `lower`; None: as the signal shows.
    """

    damping_ratio: float | None = None
    natural_frequency: float | None = None
    stop_position: float | None = None
    offset: float | None = 0.0
    side: str | None = None


@dataclass(frozen=True, slots=True)
class Parameters:
    """All numbers of the model; the stop is an upper one (a lower one is mirrored before).

    Attributes
    ----------
    restitution, damping_ratio : float
    natural_frequency, angular_frequency : float
        rad/s.
    static_deflection, phase : float
        Unit of the displacement, and rad.
    stop_position, offset : float
        Unit of the displacement.
    """

    restitution: float
    damping_ratio: float
    natural_frequency: float
    angular_frequency: float
    static_deflection: float
    phase: float
    stop_position: float
    offset: float = 0.0

    def oscillator(self) -> Oscillator:
        """Return the oscillator of unit mass whose flow this is, about the offset."""
        stiffness = self.natural_frequency**2
        damping = 2.0 * self.damping_ratio * self.natural_frequency
        force = stiffness * self.static_deflection
        return Oscillator(1.0, damping, stiffness, force, self.angular_frequency)

    def phase_at(self, time: float) -> float:
        """Return the phase of the force at a time, rad."""
        return self.angular_frequency * time + self.phase
