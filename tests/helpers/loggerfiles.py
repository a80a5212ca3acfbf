"""Files as loggers, controllers and databases write them: two channels of one warm-up, in the form of each maker."""

import math
from collections.abc import Callable

#: rows, and seconds between them
N, STEP = 120, 10
SPINDLE = [round(20 + 5 * (1 - math.exp(-k / 40)), 3) for k in range(N)]
PROBE = [round(0.117 * k, 3) for k in range(N)]
ROWS = list(zip(range(N), SPINDLE, PROBE, strict=True))


def stamp(k: int, sep: str = " ", day: str = "2024-03-05", hour: int = 8) -> str:
    """Return the time of a row."""
    return f"{day}{sep}{hour + k * STEP // 3600:02d}:{k * STEP // 60 % 60:02d}:{k * STEP % 60:02d}"


def us(k: int) -> str:
    """Return the time of a row, with the month first and milliseconds after a colon, and across the 13th of March."""
    return f"03/13/2024 {stamp(k)[11:]}:010"


def comma(text: str) -> str:
    """Return numbers with a decimal comma."""
    return text.replace(".", ",")


def keysight() -> str:
    """Return a scan of BenchLink Data Logger with 60 channels in its list, as 34970A and 34972A give it."""
    channels = "".join(
        f"{101 + k},{('Spindle', 'Probe')[k] if k < 2 else ''},Temp (Type K),Auto,5.5,1 PLC,FALSE,1,0,C,Off,0,0,None\n"
        for k in range(60)
    )
    return (
        "Name:,Warm-up,,Owner:,lab\nComments:,\nAcquisition Date:,3/13/2024 8:00:00 AM\nInstrument:,34970A\n"
        "Total Channels:,60\n\nChannel,Name,Function,Range,Resolution,Details,Scale,Gain,Offset,Label,Test,Low,High,H\n"
        f"{channels}\nScan Control:\nStart Action:,Immediately\n\n"
        "Scan,Time,101 <Spindle> (C),Alarm 101,102 <Probe> (UM),Alarm 102\n"
        + "".join(f"{k + 1},{us(k)},{t},0,{z},0\n" for k, t, z in ROWS)
    )


def padded(begin: int = 0, end: int = N) -> str:
    """Return such a scan from a spreadsheet, which ends the rows of the list with empty cells."""
    channels = "".join(f"{number},{name},,,,\n" for number, name in ((101, "Spindle"), (102, "Probe"), (103, "Spare")))
    rows = "".join(f"{k + 1},{us(k)},{t},0,{z},0\n" for k, t, z in ROWS[begin:end])
    return (
        f"Name:,Warm-up,,,,\nChannel,Name,,,,\n{channels},,,,,\nScan Control:,,,,,\n"
        f"Scan,Time,101 [C],Alarm 101,102 [um],Alarm 102\n{rows}"
    )


def graphtec(begin: int = 0, end: int = N) -> str:
    """Return a file of a midi logger, with a list of its channels and a second row of headings."""
    return (
        f"Vendor,GRAPHTEC Corporation\nModel,GL240\nSampling interval,10s\nStart time,2024-03-05,{stamp(begin)[11:]}\n"
        "AMP settings\nCH,Signal name,Input,Range,Filter,Span\n"
        'CH1,"Spindle",TEMP,TC_K,Off,200.0,-50.0,degC\nCH2,"Probe",DC,10V,Off,100.0,-100.0,um\nLogic/Pulse,Off\n'
        "Data\nNumber,Date&Time,ms,CH1,CH2,Alarm1-10,AlarmOut\nNO.,Time,ms,degC,um,A1234567890,A1234\n"
        + "".join(f"{k + 1},{stamp(k)},0,+{t:8.3f},+ {z},LLLL,LL\n" for k, t, z in ROWS[begin:end])
    )


def yokogawa() -> str:
    """Return a file of a paperless recorder: labelled rows of tags and units around the headings."""
    rows = "".join(f"{stamp(k).replace('-', '/').replace(' ', ',')},000,{t},{z}\n" for k, t, z in ROWS)
    return (
        "Device Type,GX20\nSampling Interval,10 s\nCh,,,0001,0002\nTag,,,Spindle,Probe\nUnit,,,C,um\n"
        f"Date,Time,msec,Data,Data\n{rows}"
    )


def labview(
    columns: str = "One", *, decimal: str = ".", separator: str = "\t", starts: tuple[str, ...] = ("08",)
) -> str:
    """Return a LabVIEW measurement file, with a segment per start."""
    multi, no = columns == "Multi", columns == "No"
    gap, named = "\t\t" if multi else "\t", "Comma" if separator == "," else "Tab"
    head = (
        f"LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\t{named}\n"
        f"Decimal_Separator\t{decimal}\nMulti_Headings\tYes\nX_Columns\t{columns}\nTime_Pref\tAbsolute\n"
        "Date\t2024/03/05\nTime\t08:00:00.0000000000000000000\n***End_of_Header***\t\n\t\n"
    )
    each = N // len(starts)
    for s, hour in enumerate(starts):
        head += (
            f"Channels\t2\t\nSamples\t{each}{gap}{each}\t\nDate\t2024/03/05{gap}2024/03/05\t\nTime\t{hour}:00:00.0{gap}"
            f"{hour}:00:00.0\t\nY_Unit_Label\tC{gap}um\t\nX_Dimension\tTime{gap}Time\t\nX0\t0.0E+0{gap}0.0E+0\t\n"
            f"Delta_X\t{STEP}.0{gap}{STEP}.0\t\n***End_of_Header***\t\t\t\n"
            f"X_Value\tSpindle\t{'X_Value' + chr(9) if multi else ''}Probe\tComment\n"
        )
        for k, t, z in ROWS[s * each : (s + 1) * each]:
            x = "" if no else f"{(k - s * each) * STEP:.6f}"
            head += f"{x}\t{t}\t{f'{x}{chr(9)}' if multi else ''}{z}\n"
    return head.replace(".", decimal).replace("\t", separator)


def twincat() -> str:
    """Return an export of TwinCAT Scope: decimal commas, a time beside each group of channels, short rows."""
    labels = {"Name": ("MAIN.fSpindle", "MAIN.fProbe"), "SymbolComment": ("", ""), "Data-Type": ("REAL64", "REAL64"),
              "SampleTime[ms]": ("10000", "20000"), "Port": ("851", "851"), "Offset": ("0", "0"),
              "ScaleFactor": ("1", "1"), "Unit": ("°C", "µm")}  # fmt: skip
    head = "".join(f"{key}\t{a}\t{key}\t{b}\n" for key, (a, b) in labels.items())
    rows = "".join(
        f"{k * STEP * 1000}\t{t}" + (f"\t{2 * k * STEP * 1000}\t{PROBE[2 * k]}" if 2 * k < N else "") + "\n"
        for k, t, _ in ROWS
    )
    return (
        "Name\tScope Project\nFile\tC:\\a.csv\nStarttime of export\t133540992000000000\tDienstag, 5. März 2024\n"
        f"Endtime of export\t133541004000000000\n\n{head}\n{comma(rows)}EOF\n"
    )


def home_assistant() -> str:
    """Return a history of Home Assistant: one row per change, with units among the attributes."""
    rows = "".join(
        f'sensor.{name},{value},"{{""unit_of_measurement"": ""{unit}""}}",{stamp(k, "T")}.{part}Z\n'
        for name, unit, part, values in (("spindle", "°C", "000", SPINDLE), ("probe", "µm", "700", PROBE))
        for k, value in enumerate(values)
    )
    switch = f"binary_sensor.door,on,{{}},{stamp(3, 'T')}.000Z\n"
    return f"entity_id,state,attributes,last_changed\n{switch}{rows}".replace(
        "\nsensor.probe,0.0,", "\nsensor.probe,0.0,", 1
    )


def influx() -> str:
    """Return annotated CSV of InfluxDB, with a tag."""
    rows = "".join(
        f",,{j},2024-03-05T08:00:00Z,2024-03-05T09:00:00Z,{stamp(k, 'T')}Z,{value},{field},machine,{tag}\n"
        for j, (field, tag, values) in enumerate((("value_C", "Spindle", SPINDLE), ("value_um", "Probe", PROBE)))
        for k, value in enumerate(values)
    )
    return (
        "#group,false,false,true,true,false,false,true,true,true\n#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,"
        "dateTime:RFC3339,double,string,string,string\n#default,_result,,,,,,,,\n"
        f",result,table,_start,_stop,_time,_value,_field,_measurement,place\n{rows}"
    )


def grafana() -> str:
    """Return formatted data of a Grafana panel: units in the cells, and larger values in a larger unit."""
    rows = "".join(f"{stamp(k)},{t} °C,{f'{z} µm' if z < 10 else f'{z / 1000:.6f} mm'}\n" for k, t, z in ROWS)
    return f'"Time","Spindle","Probe"\n{rows}'


def grafana_rows() -> str:
    """Return data of a Grafana panel as rows of series."""
    rows = "".join(
        f'"{name}";"{stamp(k, "T")}+01:00";{value}\n'
        for name, values in (("Spindle_C", SPINDLE), ("Probe_um", PROBE))
        for k, value in enumerate(values)
    )
    return f'"Series";"Time";"Value"\n{rows}'


def opcua() -> str:
    """Return a log of an OPC UA client: one row per value of a node."""
    rows = "".join(
        f"{node};{name};{value};{stamp(k)}.000;{stamp(k)}.010;Good\n"
        for k, t, z in ROWS
        for node, name, value in (("ns=2 s=1", "Spindle_C", t), ("ns=2 s=2", "Probe_um", z))
    )
    return f"NodeId;DisplayName;Value;SourceTimestamp;ServerTimestamp;StatusCode\n{rows}"


def mtconnect() -> str:
    """Return the answer of an MTConnect agent to a request for samples."""
    items = "".join(
        f'<Temperature dataItemId="t1" timestamp="{stamp(k, "T")}Z" name="Spindle" sequence="{2 * k}">{t}</Temperature>'
        f'<Displacement dataItemId="d1" timestamp="{stamp(k, "T")}Z" name="Probe" sequence="{2 * k + 1}">{z / 1000:.6f}'
        "</Displacement>"
        for k, t, z in ROWS
    )
    return (
        '<?xml version="1.0"?><MTConnectStreams xmlns="urn:mtconnect.org:MTConnectStreams:1.5"><Header/><Streams>'
        f'<DeviceStream name="M"><ComponentStream component="X"><Samples>{items}</Samples><Events><Execution '
        'dataItemId="e" timestamp="2024-03-05T08:00:00Z">ACTIVE</Execution></Events></ComponentStream></DeviceStream>'
        "</Streams></MTConnectStreams>"
    )


def words() -> str:
    """Return a plain file with words in place of some temperatures, known and unknown ones."""
    said = {7: "unavailable", 9: "I/O Timeout", 30: "Kabelbruch X"}
    rows = "".join(f"{stamp(k)},{said.get(k, t)},{z}\n" for k, t, z in ROWS)
    return f"last_changed,Spindle_C,Probe_um,Remark\n{rows}"


#: file name, and its content
FILES: dict[str, Callable[[], str]] = {
    "keysight.csv": keysight,
    "padded.csv": padded,
    "continued.csv": lambda: padded(0, 60) + padded(60),
    "graphtec.csv": graphtec,
    "restarted.csv": lambda: graphtec(0, 60) + graphtec(60),
    "yokogawa.csv": yokogawa,
    "one.lvm": labview,
    "none.lvm": lambda: labview("No", decimal=","),
    "multi.lvm": lambda: labview("Multi", separator=","),
    "twincat.csv": twincat,
    "history.csv": home_assistant,
    "influx.csv": influx,
    "grafana.csv": grafana,
    "series.csv": grafana_rows,
    "opcua.csv": opcua,
    "samples.xml": mtconnect,
    "words.csv": words,
}
