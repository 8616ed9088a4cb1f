"""Exports in the style of instruments, with drawn content; each writer returns the expected reading."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SINCE = datetime(2019, 3, 12, 10, 11, 12)


@dataclass(frozen=True)
class Drawn:
    """Channels of one rate: their values with five decimals, the instants, the interval (s)."""

    interval: float
    start: float
    values: Sequence[Floats]

    @property
    def count(self) -> int:
        return len(self.values[0])

    @property
    def instants(self) -> Floats:
        return self.start + self.interval * np.arange(self.count)

    def clocks(self, form: str = "%H:%M:%S.%f", digits: int = 3) -> list[str]:
        """Return times of day of the samples with a number of decimal places of a second (of 6)."""
        steps = [SINCE + timedelta(seconds=self.interval * place) for place in range(self.count)]
        return [
            step.strftime(form)[: digits - 6 or None] if "%f" in form else step.strftime(form)
            for step in steps
        ]

    def rows(self, instants: Sequence[str], mark: str = ",", form: str = "{:.5f}") -> list[str]:
        """Return the rows of a table: instants, then the values of all channels."""
        cells = zip(instants, *(map(form.format, one) for one in self.values), strict=True)
        return [mark.join(row) for row in cells]


@dataclass(frozen=True)
class Export:
    """A text and its expected reading: names, units (CF) and values of the channels, one interval for each."""

    lines: Sequence[str]
    names: Sequence[str]
    units: Sequence[str]
    values: Sequence[Floats]
    intervals: Sequence[float]
    start: float | None = None
    encoding: str = field(default="utf-8")


def drawn(seed: int, interval: float | None = None, channels: int | None = None) -> Drawn:
    """Return drawn channels; an export may prescribe the interval or the number of channels."""
    generator = np.random.default_rng(seed)
    count = int(generator.integers(40, 90))
    many = channels or int(generator.integers(1, 4))
    step = interval or float(generator.choice([1e-3, 2e-3, 4e-4, 1e-4]))
    phase = generator.uniform(0.0, 6.0, many)
    values = [
        np.round(np.sin(0.3 * np.arange(count) + shift) + 0.1 * generator.normal(size=count), 5)
        for shift in phase
    ]
    return Drawn(step, float(-20 * step), values)


def _export(
    lines: Sequence[str], data: Drawn, names: Sequence[str], unit: str, start: float | None = None
) -> Export:
    many = len(data.values)
    return Export(lines, names, [unit] * many, data.values, [data.interval] * many, start)


def _seconds(data: Drawn) -> list[str]:
    return [f"{instant:.9f}" for instant in data.instants]


def _commas(lines: Sequence[str]) -> list[str]:
    return [line.replace(".", ",") for line in lines]


def tektronix_tds(seed: int) -> Export:
    data = drawn(seed, channels=1)
    settings = [
        f"Record Length,{data.count:.6e},", f"Sample Interval,{data.interval:.6e},", "Trigger Point,20,", ",,",
        "Source,CH2,", "Vertical Units,V,", "Vertical Scale,5.0e-01,", "Horizontal Units,s,", "Pt Fmt,Y,",
    ]  # fmt: skip
    rows = data.rows(_seconds(data))
    lines = [f"{settings[at] if at < len(settings) else ',,'},{row}," for at, row in enumerate(rows)]
    return _export(lines, data, ["ch2"], "V", data.start)


def tektronix_mdo(seed: int) -> Export:
    data = drawn(seed)
    many = len(data.values)
    lines = [
        "Model,MDO3014", "Firmware Version,1.26", "", "Waveform Type,ANALOG", "Point Format,Y",
        "Horizontal Units,s", "Horizontal Scale,0.0004", f"Sample Interval,{data.interval:g}",
        f"Record Length,{data.count}", "Probe Attenuation" + ",1" * many, "Vertical Units" + ",A" * many,
        "Vertical Offset" + ",0" * many, "Label" + "," * many, "TIME" + "".join(f",CH{at + 1}" for at in range(many)),
        *data.rows(_seconds(data)),
    ]  # fmt: skip
    return _export(lines, data, [f"ch{at + 1}" for at in range(many)], "A", data.start)


def rigol_sequence(seed: int) -> Export:
    data = drawn(seed)
    many = len(data.values)
    heads = "".join(f",CH{at + 1}" for at in range(many))
    lines = [
        f"X{heads},Start,Increment,",
        f"Sequence{',Volt' * many},{data.start:.6e},{data.interval:.6e}",
        *(f"{row},," for row in data.rows([str(at) for at in range(data.count)])),
    ]
    return _export(lines, data, [f"ch{at + 1}" for at in range(many)], "V", data.start)


def rigol_seconds(seed: int) -> Export:
    data = drawn(seed)
    many = len(data.values)
    heads = "".join(f",CH{at + 1}" for at in range(many))
    lines = [f"X{heads},", f"Second{',Volt' * many},", *(f"{row}," for row in data.rows(_seconds(data)))]
    return _export(lines, data, [f"ch{at + 1}" for at in range(many)], "V", data.start)


def keysight(seed: int) -> Export:
    data = drawn(seed)
    many = len(data.values)
    heads = "".join(f",{at + 1}" for at in range(many))
    lines = [f"x-axis{heads}", f"second{',Volt' * many}", *data.rows(_seconds(data))]
    return _export(lines, data, [f"channel_{at + 1}" for at in range(many)], "V", data.start)


def infiniium(seed: int) -> Export:
    data = drawn(seed, channels=1)
    lines = [
        "Revision:,1", "Type:,raw", f"Points:,{data.count}", f"XInc:,{data.interval:+.9E}", f"XOrg:,{data.start:+.9E}",
        "YUnits:,Volt", "Data:", *(f"{value:.5f}" for value in data.values[0]),
    ]  # fmt: skip
    return _export(lines, data, ["data"], "V", data.start)


def benchlink(seed: int) -> Export:
    data = drawn(seed, interval=0.1)
    many = len(data.values)
    heads = "".join(f",10{at + 1} (VDC),Alarm 10{at + 1}" for at in range(many))
    clocks = [clock[::-1].replace(".", ":", 1)[::-1] for clock in data.clocks("%m/%d/%Y %H:%M:%S.%f")]
    rows = [
        f"{at + 1},{clocks[at]}," + ",".join(f"{one[at]:.5f},0" for one in data.values)
        for at in range(data.count)
    ]
    return _export([f"Scan,Time{heads}", *rows], data, [f"channel_10{at + 1}" for at in range(many)], "V")


def picoscope(seed: int) -> Export:
    data = drawn(seed)
    many = len(data.values)
    heads = "".join(f",Channel {'ABC'[at]}" for at in range(many))
    rows = data.rows([f"{1e3 * instant:.8f}" for instant in data.instants])
    lines = [f"Time{heads}", f"(ms){',(mV)' * many}", "", *rows]
    return _export(lines, data, [f"channel_{'abc'[at]}" for at in range(many)], "0.001 V", data.start)


def saleae(seed: int) -> Export:
    data = drawn(seed)
    heads = "".join(f",Channel {at}" for at in range(len(data.values)))
    return _export(
        [f"Time [s]{heads}", *data.rows(_seconds(data))],
        data, [f"channel_{at}" for at in range(len(data.values))], "1", data.start,
    )  # fmt: skip


def catman(seed: int) -> Export:
    data = drawn(seed)
    heads = "".join(f"\tDMS {at + 1} [µm/m]" for at in range(len(data.values)))
    lines = [
        "Versuch am Balken", "T0 = 12.03.2019 10:11:12", f"Zeit  1 - Standardmessrate [s]{heads}",
        *_commas(data.rows(_seconds(data), "\t")),
    ]  # fmt: skip
    return _export(lines, data, [f"dms_{at + 1}" for at in range(len(data.values))], "1e-06 1", data.start)


def hbm(seed: int) -> Export:
    data = drawn(seed)
    heads = "\t".join(f"Kraft {at + 1} [kN]" for at in range(len(data.values)))
    rows = ["\t".join(f"{one[at]:.5f}" for one in data.values) for at in range(data.count)]
    lines = ["HBM MX840A", f"Sample rate:\t{1.0 / data.interval:g} Hz", heads, *rows]
    return _export(lines, data, [f"kraft_{at + 1}" for at in range(len(data.values))], "1000 N", 0.0)


def diadem_pairs(seed: int) -> Export:
    data, slower = drawn(seed, channels=1), drawn(seed + 100, interval=0.01, channels=1)
    longest = max(data.count, slower.count)
    sides = [[f"{instant};{value:.5f}" for instant, value in zip(_seconds(one), one.values[0], strict=True)]
             for one in (data, slower)]  # fmt: skip
    rows = [";".join(side[at] if at < len(side) else ";" for side in sides) for at in range(longest)]
    values = [data.values[0], slower.values[0]]
    intervals = [data.interval, slower.interval]
    return Export(["Kraft_X;Kraft_Y;Weg_X;Weg_Y", *rows], ["kraft_y", "weg_y"], ["1", "1"], values, intervals)


def diadem(seed: int) -> Export:
    data = drawn(seed)
    heads = "".join(f";Kanal {at + 1} [mm]" for at in range(len(data.values)))
    lines = ["DIAdem 2019;Export", f"Zeit [s]{heads}", *_commas(data.rows(_seconds(data), ";"))]
    return _export(lines, data, [f"kanal_{at + 1}" for at in range(len(data.values))], "0.001 m", data.start)


def dasylab(seed: int) -> Export:
    data = drawn(seed)
    heads = "".join(f"Schreiben {at} [V];" for at in range(len(data.values)))
    lines = [
        "DASYLab - V 11.00.00", "Worksheet name: beam", "Recording date     : 12.03.2019,  10:11:12",
        "Block length       : 1", f"Delta              : {data.interval:g} sec.",
        f"Number of channels : {len(data.values)}", f"Measurement time[hh:mm:ss];{heads}",
        *(f"{row};" for row in data.rows(_commas(data.clocks()), ";")),
    ]  # fmt: skip
    lines[7:] = [line.replace(".", ",") for line in lines[7:]]
    return _export(lines, data, [f"schreiben_{at}" for at in range(len(data.values))], "V")


def testo(seed: int) -> Export:
    data = drawn(seed, interval=1.0, channels=2)
    clocks = [clock.replace(" ", ";") for clock in data.clocks("%d.%m.%Y %H:%M:%S")]
    rows = [row.replace(",", ";") for row in data.rows(clocks)]
    dates = [
        ";".join([*row.split(";")[:2], *(cell.replace(".", ",") for cell in row.split(";")[2:])])
        for row in rows
    ]
    lines = ["Datum;Zeit;m/s²;°C", *dates, "Minimum;;-1,2;-1,1", "Maximum;;1,2;1,1", "Anzahl Werte: 60"]
    return Export(lines, ["m_s", "c"], ["m s-2", "degree_Celsius"], data.values, [1.0, 1.0])


def phyphox(seed: int) -> Export:
    data = drawn(seed, interval=0.002, channels=3)
    heads = ",".join(f'"Linear Acceleration {axis} (m/s^2)"' for axis in "xyz")
    lines = [
        f'"Time (s)",{heads}',
        *data.rows([f"{instant:.9E}" for instant in data.instants], form="{:.9E}"),
    ]
    return _export(lines, data, [f"linear_acceleration_{axis}" for axis in "xyz"], "m s-2", data.start)


def arduino_millis(seed: int) -> Export:
    data = drawn(seed, interval=0.005)
    heads = "".join(f",acc_{'xyz'[at]}" for at in range(len(data.values)))
    rows = data.rows([str(900 + 5 * at) for at in range(data.count)])
    return _export(
        [f"millis{heads}", *rows], data, [f"acc_{'xyz'[at]}" for at in range(len(data.values))], "1", 0.9
    )


def arduino_monitor(seed: int) -> Export:
    data = drawn(seed, interval=0.01)
    rows = data.rows([""] * data.count)
    lines = [f"{clock} -> {row[1:]}" for clock, row in zip(data.clocks(), rows, strict=True)]
    return _export(lines, data, [f"column_{at + 2}" for at in range(len(data.values))], "1")


def bruel_kjaer(seed: int) -> Export:
    data = drawn(seed, channels=1)
    lines = [
        "Header Size:\t12", "Version:\t7", "Decimal Separator:\t.", "Title1:\tAcc tip", "X-Axis type:\tLinear",
        f"X-Axis size:\t{data.count}", "X-Axis unit:\ts", f"X-Axis start:\t{data.start:.9g}",
        f"X-Axis delta:\t{data.interval:.9g}", "Y-Axis unit:\tm/s²",
        *(f"{at + 1}\t{row}" for at, row in enumerate(data.rows(_seconds(data), "\t", "{:.5e}"))),
    ]  # fmt: skip
    return _export(lines, data, ["acc_tip"], "m s-2", data.start)


def labview(seed: int) -> Export:
    data = drawn(seed)
    many = len(data.values)
    stamp = "12.03.2019 10:11:12,000"
    lines = [
        "waveform" + "".join(f"\t[{at}]" for at in range(many)), "t0" + f"\t{stamp}" * many,
        "delta t" + f"\t{data.interval:.6f}" * many, "", "time" + "".join(f"\tY[{at}]" for at in range(many)),
        *data.rows(_commas(data.clocks("%d;%m;%Y %H:%M:%S.%f")), "\t"),
    ]  # fmt: skip
    lines[2:3] = _commas(lines[2:3])
    lines[5:] = [line.replace(".", ",").replace(";", ".") for line in lines[5:]]
    return _export(lines, data, [f"y_{at}" for at in range(many)], "1")


EXPORTS: dict[str, tuple[str, Callable[[int], Export]]] = {
    "Tektronix TDS": ("Tektronix", tektronix_tds),
    "Tektronix MDO": ("Tektronix", tektronix_mdo),
    "Rigol, counted": ("Rigol", rigol_sequence),
    "Rigol, in seconds": ("Rigol", rigol_seconds),
    "Keysight": ("Keysight", keysight),
    "Keysight Infiniium": ("Keysight", infiniium),
    "BenchLink": ("Keysight", benchlink),
    "PicoScope": ("PicoScope", picoscope),
    "Saleae": ("Saleae Logic", saleae),
    "Catman": ("HBM", catman),
    "HBM": ("HBM", hbm),
    "DIAdem, pairs": ("DIAdem", diadem_pairs),
    "DIAdem": ("DIAdem", diadem),
    "DASYLab": ("DASYLab", dasylab),
    "Testo": ("Testo", testo),
    "phyphox": ("phyphox", phyphox),
    "Arduino millis": ("Arduino", arduino_millis),
    "Arduino monitor": ("Arduino", arduino_monitor),
    "Brüel & Kjær": ("Brüel & Kjær", bruel_kjaer),
    "LabVIEW": ("LabVIEW", labview),
}
"""Maker and writer of each export."""
