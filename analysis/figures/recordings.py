"""The families of recordings and of replays, with their figures."""

from __future__ import annotations

from functools import partial

from vibroimpact.analysis.figures.families import Drawing, Family, register
from vibroimpact.analysis.figures.measured.recordings import draw_recording
from vibroimpact.analysis.figures.measured.replay import draw_replay
from vibroimpact.analysis.figures.measured.spectra import draw_recording_spectrum, draw_replay_spectrum
from vibroimpact.analysis.recording import Recording

_OF_REPLAY = ("recording", "window")

register(
    Family(
        "recording",
        "a recording",
        {
            "spectrum": Drawing(draw_recording_spectrum, takes=("window",)),
            "density": Drawing(partial(draw_recording_spectrum, density=True), takes=("window", "segment")),
            "recording": Drawing(lambda data, view: draw_recording(data, view.window), takes=("window",)),
        },
        usual="recording",
        type=Recording,
        is_of_results=False,
    )
)
register(
    Family(
        "replay",
        "a replay",
        {
            "spectrum": Drawing(draw_replay_spectrum, takes=_OF_REPLAY),
            "density": Drawing(partial(draw_replay_spectrum, density=True), takes=(*_OF_REPLAY, "segment")),
            "replay": Drawing(
                lambda data, view: draw_replay(data, view.recording, view.window), takes=_OF_REPLAY
            ),
        },
        usual="replay",
    )
)
