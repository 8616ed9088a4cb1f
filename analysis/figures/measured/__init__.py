"""Figures of measurements and of results from them: recordings, replays, spectra, spikes, estimates."""
