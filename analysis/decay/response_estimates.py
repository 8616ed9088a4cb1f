"""What a frequency response gave, as estimates and as a dataset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from vibroimpact.analysis.decay.estimate import Estimate, table_of
from vibroimpact.analysis.decay.frequency_response import FrequencyResponse
from vibroimpact.analysis.decay.resonance import Resonance


@dataclass(frozen=True, slots=True)
class ResponseEstimates:
    """A fitted resonance and where it is from.

    Attributes
    ----------
    resonance : Resonance
    response : FrequencyResponse or None
        None where the curve is that of a simulated sweep.
    title : str
    unit : str
        CF unit of the response.
    remarks : tuple of str
    """

    resonance: Resonance
    response: FrequencyResponse | None
    title: str
    unit: str = "1"
    remarks: tuple[str, ...] = ()

    def estimates(self) -> dict[str, dict[str, Estimate]]:
        """Return the estimates by method, then quantity."""
        fit = self.resonance
        found = {
            "natural_angular_frequency": fit.natural_angular_frequency,
            "damping_ratio": fit.damping_ratio,
            "modal_constant": fit.modal_constant,
        }
        if fit.phase is not None:
            found["modal_phase"] = fit.phase
        rough = Estimate(fit.half_power_damping_ratio, float("nan"))
        return {"response": found, "half_power": {"damping_ratio": rough}}

    def words(self) -> tuple[str, ...]:
        """Return what a reader must know, in sentences."""
        said = list(self.remarks)
        fit = self.resonance
        ratio = fit.half_power_damping_ratio / fit.damping_ratio.value
        if not np.isfinite(ratio):
            said.append("the band does not hold both half-power points: there is no cross-check.")
        elif abs(ratio - 1.0) > 0.2:
            said.append(
                f"the half-power bandwidth gives {ratio:.2g} times the fitted damping ratio: another mode, noise, or "
                "lines too far apart."
            )
        return tuple(said)

    def dataset(self) -> xr.Dataset:
        """Return estimates (method, quantity), the fitted lines, and all lines of a measured response."""
        fit = self.resonance

        def described(words: str, unit: str = "1") -> dict[str, str]:
            return {"units": unit, "long_name": words}

        parts = [
            table_of(self.estimates()),
            xr.Dataset(
                {
                    "response": ("line", fit.magnitude, described("magnitude of the response", self.unit)),
                    "response_error": (
                        "line",
                        fit.error,
                        described("standard error of the magnitude", self.unit),
                    ),
                    "fitted_response": (
                        "line",
                        fit.fitted,
                        described("magnitude of the fitted response", self.unit),
                    ),
                },
                {"angular_frequency": ("line", fit.angular_frequency, described("frequency", "rad s-1"))},
            ),
        ]
        if self.response is not None:
            found = self.response
            parts.append(
                xr.Dataset(
                    {
                        "h1_magnitude": ("frequency", np.abs(found.h1), described("|H1|", self.unit)),
                        "h1_phase": ("frequency", np.angle(found.h1), described("phase of H1", "rad")),
                        "h2_magnitude": ("frequency", np.abs(found.h2), described("|H2|", self.unit)),
                        "coherence": ("frequency", found.coherence, described("coherence")),
                    },
                    {"frequency": ("frequency", found.frequency, described("frequency", "Hz"))},
                )
            )
        merged = xr.merge(parts, combine_attrs="override")
        return merged.assign_attrs(
            estimates="response", title=self.title, form=fit.form, remarks="\n".join(self.words())
        )
