"""The report on spikes as printed tables and sentences."""

from __future__ import annotations

import numpy as np
import xarray as xr
from rich.table import Table

from vibroimpact.analysis.spikes.contact import SHORT_CONTACT
from vibroimpact.analysis.spikes.report import SpikeReport
from vibroimpact.fmus.printing import table, with_error
from vibroimpact.fmus.terminal import Terminal
from vibroimpact.fmus.units import written_unit

#: Largest number of spikes printed; the dataset has all of them.
_MOST_ROWS = 12


def print_spikes(console: Terminal, report: SpikeReport) -> None:
    """Print the method, each spike, and the contact quantities.

    Parameters
    ----------
    console : Terminal
    report : SpikeReport
    """
    data = report.dataset
    count = int(data.sizes["spike"])
    console.print(
        f"{data.attrs['channel']}: {count or 'no'} {'spike' if count == 1 else 'spikes'}; {report.found.verdict}"
    )
    for line in _words(report):
        console.print(line, style="yellow")
    console.print(_settings(report))
    if count:
        shown = [data.isel(spike=place) for place in range(min(count, _MOST_ROWS))]
        console.print(_spikes(data, shown))
        console.print(_contacts(data, shown))
        if count > _MOST_ROWS:
            console.print(f"{count - _MOST_ROWS} more spikes are in the dataset.")
        console.print(_waveforms(data))
        _print_contact(console, data)


def _words(report: SpikeReport) -> list[str]:
    """Return the remarks that a reader needs before the numbers."""
    data, found = report.dataset, report.found
    lines = list(found.remarks)
    if int(data["spikes_cut_off"]):
        lines.append(f"Cut off by an end of the record and left out: {int(data['spikes_cut_off'])}.")
    if found.settled > float(found.time[0]):
        lines.append(
            f"The motion had settled into its cycle at {found.settled:.4g} s; before that nothing is counted."
        )
    if found.short:
        fewest = found.settings.minimum_samples
        lines.append(
            f"Excursions of fewer than {fewest} samples above the threshold, left out: {found.short}."
        )
    return lines


def _settings(report: SpikeReport) -> Table:
    """Return the method and its parameters."""
    found, data = report.found, report.dataset
    unit = str(data["threshold"].attrs["units"])
    shown = "" if unit == "1" else f" {written_unit(unit)}"
    own = "" if found.unit == "1" else f" {written_unit(found.unit)}"
    chosen = found.settings
    is_given = chosen.threshold is not None or chosen.threshold_part is not None
    why = "asked for" if is_given else f"noise passes it {chosen.false_alarms:g} times in such a record"
    rows = table("Identification", "<how", "<value", "<why")
    rows.add_row("method", found.method, found.reason)
    if found.cycle.found:
        period = found.cycle.period * found.interval
        uncertainty = float(data.attrs["interval_uncertainty"])
        within = f" ± {uncertainty:.1%}" if uncertainty else ""
        rows.add_row("excitation", f"{1.0 / period:.6g} Hz{within}", f"{found.cycle.count} cycles")
    rows.add_row("threshold", f"{found.threshold:.4g}{shown}", why)
    rows.add_row("over at", f"{found.lower_threshold:.4g}{shown}", f"hysteresis {chosen.hysteresis:g}")
    rows.add_row("noise", f"{found.noise:.4g}{own}", f"tail shape {found.tail.shape:.2f} (0: normal)")
    rows.add_row(
        "baseline", f"{found.baseline_window * found.interval:.4g} s", "window of the running median"
    )
    rows.add_row("polarity", chosen.polarity, f"at least {chosen.minimum_samples} samples")
    automatic = "2 cycles" if found.method == "cycle_median" else "2 to 10 lengths of the spike"
    merge = automatic if chosen.merge is None else f"{chosen.merge:g} s"
    rows.add_row("ringing", merge, "excursions as close are one spike")
    return rows


def _spikes(data: xr.Dataset, shown: list[xr.Dataset]) -> Table:
    """Return one row for each spike."""
    peak, impulse = (written_unit(str(data[name].attrs["units"])) for name in ("spike_peak", "spike_impulse"))
    heads = [">time (s)", f">peak ({peak})", f">impulse ({impulse})", ">passes"]
    columns = [("spike_peak", "spike_peak_error"), ("spike_impulse", "spike_impulse_error")]
    if "spike_velocity" in data:
        heads.insert(3, ">velocity (m/s)")
        columns.append(("spike_velocity", "spike_velocity_error"))
    rows = table("Spikes", *heads)
    for one in shown:
        clipped = " clipped" if int(one["spike_clipped"]) else ""
        rows.add_row(
            f"{float(one['spike_time']):.6f}{clipped}",
            *(with_error(float(one[value]), float(one[error])) for value, error in columns),
            f"{int(one['spike_excursions'])}",
        )
    return rows


def _contacts(data: xr.Dataset, shown: list[xr.Dataset]) -> Table:
    """Return the table of the lengths of spikes, and of their sums above the threshold, which depend on it."""
    heads = (">time (s)", ">foot to foot (ms)", ">above (ms)")
    sums = f">sum above ({written_unit(str(data['spike_impulse'].attrs['units']))})"
    rows = (
        (
            f"{float(one['spike_time']):.6f}",
            f"{1e3 * float(one['spike_length']):.4g}",
            f"{1e3 * float(one['spike_duration']):.4g}",
            f"{float(one['spike_impulse_above']):.4g}",
        )
        for one in shown
    )
    return table("Contacts, and what is above the threshold", *heads, sums, rows=rows)


def _waveforms(data: xr.Dataset) -> Table:
    """Return the table of the goodness of fit of each curve."""
    rows = table("Waveform", "<curve", ">goodness", ">length (ms)", "<chosen")
    for name in data["waveform"].values:
        fit = data.sel(waveform=name)
        goodness = fit["spike_fit_goodness"].values
        if not np.any(np.isfinite(goodness)):
            continue
        length = 1e3 * float(np.nanmedian(fit["spike_fit_length"].values))
        words = f"{length:.4g}" + (" (standard deviation)" if name == "bell" else "")
        mark = "yes" if name == data.attrs["waveform"] else ""
        rows.add_row(str(name).replace("_", "-"), f"{float(np.nanmedian(goodness)):.4f}", words, mark)
    return rows


def _print_contact(console: Terminal, data: xr.Dataset) -> None:
    if "sensitivity" in data:
        value, error = float(data["sensitivity"]), float(data["sensitivity_error"])
        console.print(
            f"Sensitivity of the load cell {with_error(value, error, 'V/N')}, from the impulses given."
        )
    if "contact_time_measure" not in data:
        return
    measure, error = float(data["contact_time_measure"]), float(data["contact_time_measure_error"])
    verdict = "below" if measure < SHORT_CONTACT else "not below"
    console.print(
        f"Contact-time measure {with_error(measure, error)} above the threshold, "
        f"{float(data['contact_time_measure_feet']):.4g} from foot to foot: "
        f"{verdict} {SHORT_CONTACT:g}, under which rigid impacts are an adequate model."
    )
