"""What was measured, and what is read off it: recordings, replays, spectra, spikes, estimates."""
