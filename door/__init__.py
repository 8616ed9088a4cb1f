"""Dynamics of vibrating bodies that hit stops: scenes, runs, campaigns, recordings, estimates and figures.

Everything that the commands do takes a few lines of Python here. A name is loaded when it is first used.

Examples
--------
>>> import vibroimpact as vi
>>> body = {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05}
>>> scene = vi.Scene.from_dict(
...     {
...         "body": body,
...         "forcing": {"amplitude": 1.0, "angular_frequency": 0.9},
...         "stop": [{"position": 1.0, "law": "restitution", "restitution": 0.7}],
...         "record": {"transient_periods": 100, "recorded_periods": 50},
...     }
... )
>>> found = vi.run(scene)
>>> found.vibroimpact.impacts().sizes["impact"]
50
"""

from __future__ import annotations

TYPE_CHECKING = False
if TYPE_CHECKING:  # names for type checkers and editors; a test compares them with `_NAMES`
    from vibroimpact import fmus as fmus
    from vibroimpact.analysis import figures as figures
    from vibroimpact.analysis.dataset import open_dataset as open_dataset
    from vibroimpact.analysis.dataset.reading import open_measured as open_measured
    from vibroimpact.analysis.dataset.results import write_results as write_results
    from vibroimpact.analysis.dataset.stores.converting import convert as convert
    from vibroimpact.analysis.decay import curve_of as curve_of
    from vibroimpact.analysis.decay import decay_samples as decay_samples
    from vibroimpact.analysis.decay import estimate_decay as estimate_decay
    from vibroimpact.analysis.decay import fit_resonance as fit_resonance
    from vibroimpact.analysis.decay import frequency_response as frequency_response
    from vibroimpact.analysis.estimation import Forcing as Forcing
    from vibroimpact.analysis.estimation import Known as Known
    from vibroimpact.analysis.estimation import estimate_bounces as estimate_bounces
    from vibroimpact.analysis.estimation import estimate_impacts as estimate_impacts
    from vibroimpact.analysis.estimation import estimate_modes as estimate_modes
    from vibroimpact.analysis.figures import draw as draw
    from vibroimpact.analysis.intervals import interval_report as interval_report
    from vibroimpact.analysis.orbits.classify import classify as classify
    from vibroimpact.analysis.orbits.energies import residual_restitution as residual_restitution
    from vibroimpact.analysis.orbits.resonances import frequency_shift as frequency_shift
    from vibroimpact.analysis.orbits.resonances import stop_ratio as stop_ratio
    from vibroimpact.analysis.recording import Channel as Channel
    from vibroimpact.analysis.recording import Recording as Recording
    from vibroimpact.analysis.recording import array_of as array_of
    from vibroimpact.analysis.recording import open_recording as open_recording
    from vibroimpact.analysis.recording import open_signals as open_signals
    from vibroimpact.analysis.recording import write_recording as write_recording
    from vibroimpact.analysis.spectral_density import spectral_density as spectral_density
    from vibroimpact.analysis.spikes import Mechanics as Mechanics
    from vibroimpact.analysis.spikes import SpikeSettings as SpikeSettings
    from vibroimpact.analysis.spikes import spike_report as spike_report
    from vibroimpact.campaigns import campaign as campaign
    from vibroimpact.claims import hard_cases as hard_cases
    from vibroimpact.exchange import export_fmu as export_fmu
    from vibroimpact.exchange import export_ssp as export_ssp
    from vibroimpact.exchange import import_ssp as import_ssp
    from vibroimpact.fmus.errors import VibroimpactError as VibroimpactError
    from vibroimpact.hardware.programs.record import record as record
    from vibroimpact.hardware.programs.recover import recover as recover
    from vibroimpact.hardware.programs.sine import drive_sine as drive_sine
    from vibroimpact.hardware.programs.spikes import record_spikes as record_spikes
    from vibroimpact.hardware.programs.sweep import measure_sweep as measure_sweep
    from vibroimpact.hardware.recordings import ImportSettings as ImportSettings
    from vibroimpact.hardware.recordings import import_recording as import_recording
    from vibroimpact.orbits import basins as basins
    from vibroimpact.orbits import control as control
    from vibroimpact.orbits import diagram as diagram
    from vibroimpact.orbits import find_orbits as find_orbits
    from vibroimpact.orbits import follow as follow
    from vibroimpact.orbits import maps as maps
    from vibroimpact.orbits import transients as transients
    from vibroimpact.orchestrator.orbits.energies import energies as energies
    from vibroimpact.orchestrator.orbits.lyapunov import lyapunov as lyapunov
    from vibroimpact.orchestrator.orbits.resonances import resonances as resonances
    from vibroimpact.orchestrator.orbits.seeds import seed_of_run as seed_of_run
    from vibroimpact.orchestrator.scene import Scene as Scene
    from vibroimpact.replays import replay as replay
    from vibroimpact.service.client import Service as Service
    from vibroimpact.simulation import cost_of as cost_of
    from vibroimpact.simulation import run as run
    from vibroimpact.simulation import runner as runner
    from vibroimpact.sobol import sensitivity as sensitivity
    from vibroimpact.structures import modes as modes
    from vibroimpact.studies import accuracy as accuracy
    from vibroimpact.studies import effects as effects

    __version__: str

_NAMES = {
    "analysis.dataset": ("open_dataset",),
    "analysis.dataset.stores.converting": ("convert",),
    "analysis.dataset.reading": ("open_measured",),
    "analysis.dataset.results": ("write_results",),
    "analysis.decay": ("curve_of", "decay_samples", "estimate_decay", "fit_resonance", "frequency_response"),
    "analysis.estimation": ("Forcing", "Known", "estimate_bounces", "estimate_impacts", "estimate_modes"),
    "analysis.figures": ("draw",),
    "analysis.intervals": ("interval_report",),
    "analysis.orbits.classify": ("classify",),
    "analysis.orbits.energies": ("residual_restitution",),
    "analysis.orbits.resonances": ("frequency_shift", "stop_ratio"),
    "analysis.recording": (
        "Channel",
        "Recording",
        "array_of",
        "open_recording",
        "open_signals",
        "write_recording",
    ),
    "analysis.spectral_density": ("spectral_density",),
    "analysis.spikes": ("Mechanics", "SpikeSettings", "spike_report"),
    "campaigns": ("campaign",),
    "claims": ("hard_cases",),
    "exchange": ("export_fmu", "export_ssp", "import_ssp"),
    "fmus.errors": ("VibroimpactError",),
    "hardware.programs.record": ("record",),
    "hardware.programs.recover": ("recover",),
    "hardware.programs.sine": ("drive_sine",),
    "hardware.programs.spikes": ("record_spikes",),
    "hardware.programs.sweep": ("measure_sweep",),
    "hardware.recordings": ("ImportSettings", "import_recording"),
    "orbits": ("basins", "control", "diagram", "find_orbits", "follow", "maps", "transients"),
    "orchestrator.orbits.energies": ("energies",),
    "orchestrator.orbits.lyapunov": ("lyapunov",),
    "orchestrator.orbits.resonances": ("resonances",),
    "orchestrator.orbits.seeds": ("seed_of_run",),
    "orchestrator.scene": ("Scene",),
    "replays": ("replay",),
    "service.client": ("Service",),
    "simulation": ("cost_of", "run", "runner"),
    "sobol": ("sensitivity",),
    "structures": ("modes",),
    "studies": ("accuracy", "effects"),
}
_HOMES = {name: home for home, names in _NAMES.items() for name in names}
_ROOMS = {"figures": "analysis.figures", "fmus": "fmus"}
__all__ = [*_HOMES, *_ROOMS, "__version__"]


if not TYPE_CHECKING:  # a type checker that saw `__getattr__` would accept any name

    def __getattr__(name: str) -> object:
        import importlib

        if name == "__version__":
            from importlib.metadata import version

            return version("vibroimpact")
        if name in _ROOMS:
            return importlib.import_module(f"{__name__}.{_ROOMS[name]}")
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        found = getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted(__all__)
