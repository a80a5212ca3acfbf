"""MTConnect: samples of an agent, saved as XML."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pandas as pd

from thermocomp.core.exceptions import RecordingError
from thermocomp.recordings.readers.limits import FileLimits
from thermocomp.recordings.readers.mapping import ReadOptions
from thermocomp.recordings.readers.series import TimeScale, TimeSeries, join_series
from thermocomp.recordings.readers.tables import FrameTable

#: units of the standard, by the type of a sample
_UNITS = {
    **dict.fromkeys(("Temperature",), "degC"),
    **dict.fromkeys(("SpindleSpeed", "RotaryVelocity"), "1/min"),
    **dict.fromkeys(("Position", "PathPosition", "Displacement", "Length"), "mm"),
    **dict.fromkeys(("PathFeedrate", "AxisFeedrate"), "mm/s"),
}


def open_mtconnect(path: Path, options: ReadOptions, limits: FileLimits) -> FrameTable:
    """Read the samples of an MTConnectStreams document; events and conditions are left out."""
    limits.check("recoded_bytes", path.stat().st_size, path)
    text = path.read_bytes()
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise RecordingError(f"{path}: the file defines entities or a document type, as no agent does; save it again")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, LookupError) as e:
        raise RecordingError(f"{path}: this is not XML, or damaged ({e}); save it again") from e
    if root.tag.rpartition("}")[2] != "MTConnectStreams":
        raise RecordingError(f"{path}: only the samples of an MTConnect agent are read from XML; export as CSV")
    found: dict[str, list[tuple[str, str]]] = {}
    for samples in (e for e in root.iter() if e.tag.rpartition("}")[2] == "Samples"):
        for item in samples:
            kind, said = item.tag.rpartition("}")[2], item.attrib
            name = said.get("name") or said.get("dataItemId") or kind
            name += f"_{said['subType'].lower()}" if said.get("subType", "ACTUAL") != "ACTUAL" else ""
            unit = _UNITS.get(kind, "")
            if kind in ("Position", "PathPosition") and not name.casefold().startswith("pos"):
                name = f"pos_{name}"
            heading = f"{name} [{unit}]" if unit else name
            found.setdefault(heading, []).append((said.get("timestamp", ""), (item.text or "").strip()))
    series = []
    for heading, readings in found.items():
        stamps = pd.to_datetime(pd.Series([t for t, _ in readings]), format="ISO8601", utc=True, errors="coerce")
        good = stamps.notna().to_numpy()
        values = np.array([value for _, value in readings], dtype=object)
        series.append(TimeSeries(heading, stamps[good].to_numpy(dtype="M8[ns]").view(np.int64), values[good]))
    return join_series(path, series, TimeScale("timestamp", "UTC"), limits, decimal=options.decimal or ".")
