"""Recordings that are damaged, or made to cost a reader its time, memory or temper: one per seed."""

import io
import random
import re
import time
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from loggerfiles import FILES

from thermocomp.core.exceptions import ThermocompError
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.readers.recordings import read

SHEET = "xl/worksheets/sheet1.xml"
_MAIN = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
_ODS = " ".join(f'xmlns:{n}="urn:oasis:names:tc:opendocument:xmlns:{n}:1.0"' for n in ("office", "table", "text"))
_STRINGS = (
    b"<Override PartName='/xl/sharedStrings.xml' ContentType='application/vnd.openxmlformats-officedocument."
    b"spreadsheetml.sharedStrings+xml'/></Types>"
)
_TOKENS = (
    *("1e999", "-1e308", "nan", "9" * 400, "1" * 40_000, '"', "=1+1", "\x00", "\ufffd", "''", "-", "1_0", "\u0661"),
    *(
        "9999-99-99",
        "0001-01-01T00:00:00",
        "999999-01-01",
        "1e308",
        "[degX]",
        "[]",
        "#",
        ";",
        "\t",
        "\r",
        "T",
        "&bogus;",
    ),
    *("<row>", "</row>", "<c/>", "-1", "4294967296", "A0", "ZZZ9", "s", "inlineStr", "b", "e", "%", "\\"),
)


def table(n_rows: int = 40) -> pd.DataFrame:
    """Return a small recording with everything that columns can be."""
    rng = np.random.default_rng(1)
    return pd.DataFrame(
        {
            "timestamp": pd.date_range("2024-01-01", periods=n_rows, freq="min").strftime("%Y-%m-%d %X"),
            "t1_C": rng.normal(20, 1, n_rows).round(2),
            "drift_um": rng.normal(0, 1, n_rows).round(2),
            "spindle_rpm": np.where(np.arange(n_rows) % 20 < 10, 3000.0, 0.0),
            "cycle": np.arange(n_rows) // 10,
            "remark": "warm",
        }
    )


def _ods(rows: str, before: str = "") -> bytes:
    return _zip({"content.xml": f"<?xml version='1.0'?>{before}<office:document-content {_ODS}><office:body>"
                 f"<office:spreadsheet><table:table table:name='a'>{rows}</table:table></office:spreadsheet>"
                 "</office:body></office:document-content>"})  # fmt: skip


def _ods_row(cells: list[object], more: str = "") -> str:
    found = "".join(
        f"<table:table-cell office:value-type='float' office:value='{c}'/>"
        if isinstance(c, float | int)
        else f"<table:table-cell office:value-type='string'><text:p>{c}</text:p></table:table-cell>"
        for c in cells
    )
    return f"<table:table-row{more}>{found}</table:table-row>"


def _zip(parts: dict[str, str | bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as z:
        for name, content in parts.items():
            z.writestr(name, content)
    return out.getvalue()


def _unzip(content: bytes) -> dict[str, bytes]:
    with zipfile.ZipFile(io.BytesIO(content)) as z:
        return {name: z.read(name) for name in z.namelist()}


def bases() -> dict[str, bytes]:
    """Return a sound recording by its ending, or by the name of a logger's file."""
    whole = table()
    out: dict[str, bytes] = {}
    for ending in ("xlsx", "parquet"):
        buffer = io.BytesIO()
        getattr(whole, {"xlsx": "to_excel", "parquet": "to_parquet"}[ending])(buffer, index=False)
        out[ending] = buffer.getvalue()
    rows = [list(whole.columns), *whole.to_numpy().tolist()]
    return {
        **out,
        "csv": whole.to_csv(index=False).encode(),
        "txt": whole.to_csv(index=False, sep=";", decimal=",").encode("utf-8-sig"),
        "tsv": whole.to_csv(index=False, sep="\t").encode("latin-1"),
        "ods": _ods("".join(map(_ods_row, rows))),
        **{name: make().encode() for name, make in FILES.items()},
    }


def _sheet(rows: str, **parts: str) -> bytes:
    """Return a workbook with these rows, and other parts in place of its own."""
    book = openpyxl.Workbook()
    book.active.append(["time_s", "t1_C"])
    out = io.BytesIO()
    book.save(out)
    kept: dict[str, str | bytes] = {
        name: part.replace(b"</Types>", _STRINGS) for name, part in _unzip(out.getvalue()).items()
    }
    kept["xl/sharedStrings.xml"] = f"<sst {_MAIN}/>"
    if rows:
        kept[SHEET] = f"<?xml version='1.0'?><worksheet {_MAIN}><sheetData>{rows}</sheetData></worksheet>"
    return _zip({**kept, **{name.replace("__", "/"): text for name, text in parts.items()}})


_HEAD = "".join(f"<c t='inlineStr'><is><t>{h}</t></is></c>" for h in ("time_s", "t1_C"))
_HEAD = f"<row>{_HEAD}</row><row><c><v>0</v></c><c><v>20</v></c></row><row><c><v>1</v></c><c><v>21</v></c></row>"
_BOMB = "".join(f"<!ENTITY {chr(98 + k)} '{f'&{chr(97 + k)};' * 10}'>" for k in range(9))
_BOMB = f"<!DOCTYPE x [<!ENTITY a 'aaaaaaaaaa'>{_BOMB}]>"
_FILE = "<!DOCTYPE x [<!ENTITY a SYSTEM 'file:///etc/hostname'>]>"


def _lying() -> bytes:
    content = bytearray(_sheet(_HEAD + "<row><c/></row>" * 100_000))
    for signature, place in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        at = content.find(signature)
        while at >= 0:
            content[at + place : at + place + 4] = (100).to_bytes(4, "little")
            at = content.find(signature, at + 4)
    return bytes(content)


def _parquet(columns: dict[str, object], **options: object) -> bytes:
    out = io.BytesIO()
    pq.write_table(pa.table(columns), out, **options)
    return out.getvalue()


def _claims() -> bytes:
    """Return a Parquet file of some KB with very many rows, each of them true."""
    out = io.BytesIO()
    few = pa.table({"time_s": np.zeros(1 << 20), "t1_C": np.full(1 << 20, 20.0)})
    with pq.ParquetWriter(out, few.schema, compression="zstd") as file:
        for _ in range(64):
            file.write_table(few)
    return out.getvalue()


def _dictionary() -> bytes:
    label = pa.DictionaryArray.from_arrays(pa.array(np.zeros(300_000, np.int32)), pa.array(["x" * 30_000]))
    return _parquet({"time_s": np.arange(300_000.0), "t1_C": np.full(300_000, 20.0), "cycle": label})


#: files of a kind of their own, by a name that tells what they do
HOSTILE: dict[str, tuple[str, Callable[[], bytes]]] = {
    "cell far away": ("xlsx", lambda: _sheet(_HEAD + "<row r='20000'><c r='XFD20000'><v>1</v></c></row>")),
    "cell beyond": ("xlsx", lambda: _sheet(_HEAD + "<row r='4'><c r='ZZZZZZZ4'><v>1</v></c></row>")),
    "digits in a cell": ("xlsx", lambda: _sheet(_HEAD + f"<row><c><v>2</v></c><c><v>{'9' * 4_000}</v></c></row>")),
    "digits alone": ("xlsx", lambda: _sheet(_HEAD.replace("<v>20<", f"<v>{'9' * 400}<").replace("<v>21<", "<v>1<"))),
    "digits of a thumb": (
        "xlsx",
        lambda: _sheet(_HEAD.replace("<v>20<", f"<v>{'9' * 30}<").replace("<v>21<", "<v>x<")),
    ),
    "digits as time": ("xlsx", lambda: _sheet(_HEAD + f"<row><c><v>{'9' * 400}</v></c><c><v>2</v></c></row>")),
    "row beyond": ("xlsx", lambda: _sheet(_HEAD + "<row r='2000000000'><c><v>1</v></c></row>")),
    "wide empty rows": ("xlsx", lambda: _sheet(_HEAD + "<row><c r='XFD1'/></row>" * 300_000)),
    "empty cells": ("xlsx", lambda: _sheet(_HEAD + ("<row>" + "<c/>" * 10_000 + "</row>") * 400)),
    "one row": ("xlsx", lambda: _sheet(_HEAD + "<row>" + "<c/>" * 3_000_000 + "</row>")),
    "empty rows": ("xlsx", lambda: _sheet(_HEAD + "<row/>" * 930_000)),
    "numbers": ("xlsx", lambda: _sheet(_HEAD + ("<row>" + "<c><v>1</v></c>" * 1000 + "</row>") * 464)),
    "zip bomb": ("xlsx", lambda: _sheet(_HEAD + " " * 500_000_000)),
    "long text": ("xlsx", lambda: _sheet(_HEAD + "<row><c><v>" + "1" * 60_000_000 + "</v></c></row>")),
    "sizes that lie": ("xlsx", _lying),
    "entities": ("xlsx", lambda: _sheet("", **{SHEET: f"{_BOMB}<worksheet {_MAIN}>&j;</worksheet>"})),
    "file entity": ("xlsx", lambda: _sheet("", **{SHEET: f"{_FILE}<worksheet {_MAIN}>&a;</worksheet>"})),
    "utf-16 entities": ("xlsx", lambda: _zip({**_unzip(_sheet("")), SHEET: f"{_BOMB}<x>&j;</x>".encode("utf-16")})),
    "strings": (
        "xlsx",
        lambda: _sheet(
            "<row><c t='s'><v>0</v></c></row>",
            **{"xl__sharedStrings.xml": f"<sst {_MAIN}>{'<si><t/></si>' * 465_000}</sst>"},
        ),
    ),
    "more strings": (
        "xlsx",
        lambda: _sheet(
            "<row><c t='s'><v>0</v></c></row>",
            **{"xl__sharedStrings.xml": f"<sst {_MAIN}>{'<si><t/></si>' * 690_000}</sst>"},
        ),
    ),
    "styles": (
        "xlsx",
        lambda: _sheet(
            _HEAD, **{"xl__styles.xml": f"<styleSheet {_MAIN}><cellXfs>{'<xf/>' * 190_000}</cellXfs></styleSheet>"}
        ),
    ),
    "many styles": (
        "xlsx",
        lambda: _sheet(_HEAD, **{"xl__styles.xml": f"<styleSheet {_MAIN}>{'<xf/>' * 2_000_000}</styleSheet>"}),
    ),
    "ods rows": (
        "ods",
        lambda: _ods(
            _ods_row(["time_s", "t1_C"])
            + _ods_row([0, 20])
            + _ods_row([1, 20], " table:number-rows-repeated='2000000000'")
        ),
    ),
    "ods gap": (
        "ods",
        lambda: _ods(
            _ods_row(["time_s", "t1_C"])
            + "<table:table-row table:number-rows-repeated='"
            + "9" * 20
            + "'/>"
            + _ods_row([1, 20])
        ),
    ),
    "ods columns": (
        "ods",
        lambda: _ods(
            "<table:table-row><table:table-cell office:value-type='float' office:value='1' "
            "table:number-columns-repeated='2000000000'/></table:table-row>" * 9
        ),
    ),
    "ods wide": (
        "ods",
        lambda: _ods(
            _ods_row(["time_s", "t1_C"])
            + (
                "<table:table-row table:number-rows-repeated='500'>"
                "<table:table-cell office:value-type='float' office:value='1' table:number-columns-repeated='9999'/>"
                "</table:table-row>"
            )
            * 50
        ),
    ),
    "ods entities": ("ods", lambda: _ods("<a>&j;</a>", _BOMB)),
    "parquet rows": ("parquet", _claims),
    "parquet dictionary": ("parquet", _dictionary),
    "parquet nested": ("parquet", lambda: _parquet({"time_s": [0.0, 1.0], "t1_C": pa.array([[1.0] * 9, [2.0]])})),
    "parquet zeros": (
        "parquet",
        lambda: _parquet(
            {"time_s": np.zeros(30_000_000), "t1_C": np.zeros(30_000_000)}, compression="zstd", use_dictionary=False
        ),
    ),
    "parquet columns without units": (
        "parquet",
        lambda: _parquet(
            {"time_s": [0.0, 1.0], "t_C": [20.0, 21.0], **{f"n{k}": [1.0, "a"][k % 2 :][:1] * 2 for k in range(9_000)}}
        ),
    ),
    "parquet bytes": (
        "parquet",
        lambda: _parquet({"time": pa.array([b"\xff", b"\x00\xfe"]), "t1_C": [1.0, 2.0]}).replace(b"\xfe", b"\xff"),
    ),
    "parquet text that is none": (
        "parquet",
        lambda: _parquet(
            {"time": ["2024-01-01T00:00:00~", "2024-01-01T00:00:01~"], "t1_C": [1.0, 2.0]}, compression="none"
        ).replace(b"~", b"\xff"),
    ),
    "parquet columns": ("parquet", lambda: _parquet({f"t{k}_C": [1.0] for k in range(20_000)})),
    "parquet kinds": (
        "parquet",
        lambda: _parquet(
            {"time_s": pa.array([0, 1], pa.duration("ns")), "t1_C": [1, 2], "t2_C": pa.array([b"\xff", None])}
        ),
    ),
    "digits": ("csv", lambda: b"time_s,t1_C\n0," + b"1" * 50_000_000 + b"\n1,2\n"),
    "commas": ("csv", lambda: b"," * 3_000_000 + b"\n" + b"1," * 1_500_000 + b"\n"),
    "long rows": ("csv", lambda: (b"1," * 1_500_000 + b"\n") * 10),
    "spaces": ("csv", lambda: (b"a " * 900_000 + b"\n") * 10),
    "quotes": ("csv", lambda: b"time_s,t1_C\n0," + b'"' * 3_000_001 + b"\n"),
    "blank lines": ("csv", lambda: b"time_s,t1_C\n" + b"\n" * 20_000_000 + b"0,1\n"),
    "comments": ("csv", lambda: b"#\n" * 10_000_000 + b"time_s,t1_C\n0,1\n"),
    "columns": ("csv", lambda: _wide("t{}_C")),
    "columns without units": ("csv", lambda: _wide("sensor number {} of the machine")),
    "columns of odd units": ("csv", lambda: _wide("sensor {} [kilobananas per fortnight]")),
    "columns of long headings": ("csv", lambda: _wide("sensor {} " + "x" * 900)),
    "long heading": ("csv", lambda: b"time_s,t1_C," + b"x" * 200_000 + b"\n0,1,2\n1,2,3\n"),
    "labels": ("csv", lambda: b"time_s,t1_C,cycle\n" + b"".join(b"%d,20,c%d\n" % (k, k) for k in range(500_000))),
    "starts": ("csv", lambda: b"time_h,spindle_rpm\n" + b"".join(b"%d,%d\n" % (k, k % 2) for k in range(300_000))),
    "zeros": ("csv", lambda: bytes(10_000_000)),
    "zero far behind": ("csv", lambda: b"time_s,t1_C\n" + b"0,1\n" * 30_000 + b"\0"),
    "gzip": ("csv", lambda: b"\x1f\x8b\x08" + bytes(range(256)) * 100),
    "utf-16": ("csv", lambda: table().to_csv().encode("utf-16")),
    "utf-16 without mark": ("csv", lambda: table().to_csv().encode("utf-16-le")),
    "beyond numbers": ("csv", lambda: b"time_s,t1_C\n-1.7e308,20\n1.7e308,1e999\n"),
    "beyond units": ("csv", lambda: b"time_s,t1_degF,x_in\n0,1.7e308,1\n1,-1.7e308,1.7e308\n"),
    "beyond calendars": ("csv", lambda: b"timestamp,t1_C\n0001-01-01T00:00:00,20\n9999-12-31T23:59:59,21\n"),
    "own format": ("csv", lambda: b'# thermocomp: {"time":{"column":"t","format":"%"}}\nt,t1_C\n1,20\n2,21\n'),
    "own formats": ("csv", lambda: b'# thermocomp: {"time":{"column":"t","format":"%Q%Z%G"}}\nt,t1_C\n1,20\n2,21\n'),
    "own scale": ("csv", lambda: b'# thermocomp: {"columns":{"t1_C":{"scale":1e308}}}\ntime_s,t1_C\n1,20\n2,21\n'),
    "own limits": ("csv", lambda: b'# thermocomp: {"limits":{"columns":1}}\ntime_s,t1_C\n1,20\n2,21\n'),
    "formulas": ("csv", lambda: b"time_s,=cmd|' /C calc'!A0,+t1_C,@t2_C\n0,1,2,3\n1,2,3,4\n"),
}


def _wide(heading: str) -> bytes:
    names = ",".join(heading.format(k) for k in range(9_990))
    rows = "".join(f"{k},20," + ",".join(["20.5"] * 9_990) + "\n" for k in range(200))
    return f"time_s,t_C,{names}\n{rows}".encode()


def damaged(seed: int, sound: dict[str, bytes]) -> tuple[str, bytes]:
    """Return ending and content of a recording that something has happened to."""
    rng = random.Random(seed)
    ending = rng.choice(sorted(sound))
    content = sound[ending]
    if ending in ("xlsx", "ods") and rng.random() < 0.7:
        parts = _unzip(content)
        name = rng.choice(sorted(parts))
        parts[name] = _hurt(parts[name], rng) if rng.random() < 0.3 else _reword(parts[name], rng)
        return ending, _zip({**parts})
    if ending.rpartition(".")[2] in ("csv", "tsv", "txt", "lvm", "xml") and rng.random() < 0.7:
        return ending, _reword(content, rng)
    return ending, _hurt(content, rng)


def _reword(content: bytes, rng: random.Random) -> bytes:
    """Put other words in the place of some, between whatever parts words."""
    words = re.split(rb"([<>\"'=,;\t\n ])", content)
    for _ in range(rng.choice((1, 1, 2, 5))):
        k = rng.randrange(len(words))
        words[k] = rng.choice((rng.choice(_TOKENS).encode(), b"", rng.choice(words), words[k] * 2))
    return b"".join(words)


def _hurt(content: bytes, rng: random.Random) -> bytes:
    out = bytearray(content)
    for _ in range(rng.choice((1, 1, 3, 20))):
        at = rng.randrange(len(out))
        match rng.randrange(5):
            case 0:
                out[at] ^= 1 << rng.randrange(8)
            case 1:
                out[at] = rng.randrange(256)
            case 2:
                del out[at : at + rng.randrange(1, 50)]
            case 3:
                out[at:at] = out[max(at - rng.randrange(1, 200), 0) : at]
            case _:
                out[at : at + 4] = bytes(rng.choice((b"\x00", b"\xff", b"\x7f")) * 4)
        if len(out) < 2:
            break
    return bytes(out[: rng.randrange(1, len(out) + 1)] if rng.random() < 0.2 else out)


def try_file(path: Path) -> tuple[float, int, str]:
    """Read and check a file.

    Returns
    -------
    tuple
        Processor time [s], the most memory of this process so far [MB], and the error that a user sees.

    Raises
    ------
    Exception
        Of whatever kind: what a user should never see.
    """
    began = time.process_time()
    said = ""
    with warnings.catch_warnings(action="ignore"):
        try:
            recording = read(path)
            assert not np.isinf(recording.table.to_numpy()).any()
            assert sum(map(len, recording.notes)) < 250_000
            check(recording)
        except ThermocompError as e:
            said = str(e)
    assert len(said) < 3_000
    taken = time.process_time() - began
    peak = re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())  # ru_maxrss begins at the parent's
    assert peak is not None
    return taken, int(peak[1]) // 1024, said
