"""Drift tests of the virtual machine as ten loggers, spreadsheets and databases write them."""

import io
from collections.abc import Callable
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import openpyxl
import pandas as pd

from thermocomp.virtual.verbs import simulate

#: columns of the virtual machine that are written: heading, unit
_TAKEN = {
    "spindle_rpm": ("Spindle", "1/min"),
    "t_front_seat_C": ("T1", "degC"),
    "t_housing_C": ("T2", "degC"),
    "t_column_front_left_C": ("T3", "degC"),
    "t_bed_front_C": ("T4", "degC"),
    "t_air_C": ("Air", "degC"),
    "x1_um": ("X", "um"),
    "z_um": ("Z", "um"),
}
_BEGIN = datetime(2024, 3, 11, 7, 30)


_MONTH = """
description = "four weeks, each day eight hours of work at some speed"
sampling = "10 min"
places = "usual"

[[segments]]
repeat = 28
segments = [{ duration = "8 h", speed = { between = [800, 3000], step = 200 } }, { duration = "16 h" }]
"""


@cache
def drift(protocol: str = "demo", step: int = 200) -> pd.DataFrame:
    """Return a drift test of six thermal cycles in two days, or another one, with a row every `step` seconds."""
    (recording,) = simulate(protocol)
    every = round(step / float(recording.time[1] - recording.time[0]))
    table = recording.table[list(_TAKEN)].iloc[::every].reset_index(drop=True).round(3)
    table.columns = [heading for heading, _ in _TAKEN.values()]
    table.insert(0, "time", [_BEGIN + timedelta(seconds=step * k) for k in range(len(table))])
    return table


def _heads(form: str, units: dict[str, str], names: dict[str, str] | None = None) -> list[str]:
    """Return headings: `form` with name and unit, in the words of `names` and `units`."""
    return [form.format((names or {}).get(n, n), units[u]) for n, u in _TAKEN.values()]


def _rows(stamp: str, sep: str, form: str = "{:.3f}", table: pd.DataFrame | None = None) -> list[str]:
    table = drift() if table is None else table
    return [sep.join([t.strftime(stamp), *map(form.format, v)]) for t, *v in table.itertuples(index=False)]


def _excel(names: list[str], sheet: str) -> bytes:
    book = openpyxl.Workbook()
    book.active.title = sheet
    book.active.append(names)
    for t, *values in drift().itertuples(index=False):
        book.active.append([t.to_pydatetime(), *values])
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


_GERMAN = {"1/min": "U/min", "degC": "°C", "um": "µm"}
_ENGLISH = {"1/min": "rpm", "degC": "°C", "um": "µm"}
_PLAIN = {"1/min": "rpm", "degC": "C", "um": "um"}


def _german_excel() -> bytes:
    words = {"Spindle": "Drehzahl", "T1": "Lager vorne", "T2": "Gehäuse", "Air": "Luft", "X": "Verlagerung X"}
    return _excel(["Datum/Uhrzeit", *_heads("{} [{}]", _GERMAN, {**words, "Z": "Verlagerung Z"})], "Messwerte")


def _english_excel() -> bytes:
    words = {"Spindle": "Spindle speed", "X": "Displacement X", "Z": "Displacement Z"}
    return _excel(["Date/Time", *_heads("{} ({})", _ENGLISH, words)], "Log")


def _keysight() -> bytes:
    names = [n for n, _ in _TAKEN.values()]
    channels = "".join(f"{101 + k},{n},DC volts,Auto,5.5,1 PLC,FALSE,1,0,C,Off,0,0,None\n" for k, n in enumerate(names))
    heads = ",".join(f"{101 + k} <{n}> ({_PLAIN[u]}),Alarm {101 + k}" for k, (n, u) in enumerate(_TAKEN.values()))
    rows = "\n".join(f"{k + 1},{row},0" for k, row in enumerate(_rows("%m/%d/%Y %H:%M:%S:000", ",0,"))).replace(
        ":000,0,", ":000,"
    )
    return (
        "Name:,Drift test,,Owner:,lab\nAcquisition Date:,3/11/2024 7:30:00 AM\nInstrument:,34972A\n\n"
        f"Channel,Name,Function,Range,Resolution,Details,Scale,Gain,Offset,Label,Test,Low,High,HW\n{channels}\n"
        f"Scan Control:\nStart Action:,Immediately\n\nScan,Time,{heads}\n{rows}\n"
    ).encode("utf-16")


def _graphtec() -> bytes:
    names = [n for n, _ in _TAKEN.values()]
    channels = "".join(f"CH{k + 1},{n},DC,10V,Off,100.0,-100.0\n" for k, n in enumerate(names))
    numbers = ",".join(f"CH{k + 1}" for k in range(len(names)))
    units = ",".join({"1/min": "rpm", "degC": "degC", "um": "um"}[u] for _, u in _TAKEN.values())
    rows = "\n".join(
        f"{k + 1},{row.replace(',', ',0,', 1)},LLLLLLLLLL,LLLL"
        for k, row in enumerate(_rows("%Y/%m/%d %H:%M:%S", ",", "{:+.3f}"))
    )
    return (
        "Vendor,GRAPHTEC Corporation\nModel,GL840-M\nSampling interval,200s\nStart time,2024/03/11,07:30:00\n"
        f"AMP settings\nCH,Signal name,Input,Range,Filter,Span\n{channels}Logic/Pulse,Off\nData\n"
        f"Number,Date&Time,ms,{numbers},Alarm1,AlarmOut\nNO.,Time,ms,{units},A1234567890,A1234\n{rows}\n"
    ).encode()


def _labview() -> bytes:
    table = drift()
    rows = "".join(
        "\t".join([f"{200 * k:.6f}", *(f"{v:.6f}" for v in values)]).replace(".", ",") + "\t\n"
        for k, (_, *values) in enumerate(table.itertuples(index=False))
    )
    heads = "\t".join(["Zeit (s)", *_heads("{} ({})", {"1/min": "1/min", "degC": "Grad C", "um": "1/1000 mm"})])
    return (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
        "Multi_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\nOperator\tlab\nDate\t2024/03/11\nTime\t07:30:00,000\n"
        f"***End_of_Header***\t\n\t\n{heads}\tComment\n{rows}"
    ).encode("cp1252")


def _semicolons() -> bytes:
    rows = [row.replace(".", ",").replace("#", ".") for row in _rows("%d#%m#%Y %H:%M:%S", ";")]
    return "\n".join([";".join(["Zeit", *_heads("{} [{}]", _GERMAN)]), *rows]).encode("cp1252")


def _month_log() -> bytes:
    """Four weeks, a row every ten minutes, day and month in an order that only the 13th shows."""
    with TemporaryDirectory() as folder:
        protocol = Path(folder) / "month.toml"
        protocol.write_text(_MONTH, encoding="utf-8")
        rows = _rows("%m/%d/%y %I:%M:%S %p", ",", "{:.2f}", drift(str(protocol), 600))
    return "\r\n".join([",".join(['"Date Time"', *_heads('"{}, {}"', _PLAIN)]), *rows]).encode()


def _parquet() -> bytes:
    table = drift().set_axis(["timestamp", *_heads("{}_{}", {"1/min": "rpm", "degC": "C", "um": "um"})], axis=1)
    out = io.BytesIO()
    table.to_parquet(out)
    return out.getvalue()


def _home_assistant() -> bytes:
    rows = "".join(
        f'sensor.{n.lower()},{v},"{{""unit_of_measurement"": ""{_ENGLISH[u]}""}}",{t:%Y-%m-%dT%H:%M:%S}.{k:03d}Z\n'
        for k, (n, u) in enumerate(_TAKEN.values())
        for t, v in drift()[["time", n]].itertuples(index=False)
    )
    return (
        f"entity_id,state,attributes,last_changed\nbinary_sensor.door,on,{{}},2024-03-11T07:30:00.000Z\n{rows}".encode()
    )


def _two_loggers(folder: Path) -> list[Path]:
    """Temperatures of one logger, and displacements and speed of another whose clock is 12 minutes behind."""
    table, own = drift(), ["T1", "T2", "T3", "T4", "Air"]
    heads = dict(zip((n for n, _ in _TAKEN.values()), _heads("{} [{}]", _PLAIN), strict=True))
    late = table.drop(columns=own).assign(time=table["time"] - timedelta(minutes=12))
    files = {"temperatures.csv": table[["time", *own]], "probes.csv": late}
    for name, part in files.items():
        part.rename(columns=heads).to_csv(folder / name, index=False)
    return [folder / name for name in files]


#: file name, and its content
ONE_FILE: dict[str, Callable[[], bytes]] = {
    "Driftversuch März.xlsx": _german_excel,
    "drift test.xlsx": _english_excel,
    "keysight.csv": _keysight,
    "GL840.csv": _graphtec,
    "labview.lvm": _labview,
    "semikolon.csv": _semicolons,
    "month.csv": _month_log,
    "drift.parquet": _parquet,
    "history.csv": _home_assistant,
}


def write_drift(name: str, folder: Path) -> list[Path]:
    """Write a drift test into a folder; return its files."""
    if name == "two loggers":
        return _two_loggers(folder)
    path = folder / name
    path.write_bytes(ONE_FILE[name]())
    return [path]
