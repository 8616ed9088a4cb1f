"""One motion: its time series, its planes, its modes."""
