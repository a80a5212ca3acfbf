"""Canonical calls reported by `_rs274_canon.py`, and their layout in its blocks: standard library only."""

import ctypes
import struct
from typing import Any

#: function that runs comments (py, ...) and ;py,
PYTHON = "_ZN12PythonPlugin10run_stringEPKcRN5boost6python3api6objectEb"
#: kind, count of numbers, line, numbers
RECORD = struct.Struct("<HHi10d")

INT, D, B, P, TEXT = ctypes.c_int, ctypes.c_double, ctypes.c_bool, ctypes.c_void_p, ctypes.c_char_p


class Pose(ctypes.Structure):
    """Offsets in X Y Z A B C U V W."""

    _fields_ = (("values", D * 9),)


#: canonical functions reported with their arguments: mangled name -> kind, types
TOLD: dict[str, tuple[str, tuple[Any, ...]]] = {
    "_Z13SET_FEED_MODEii": ("feedmode", (INT, INT)),
    "_Z11SELECT_TOOLi": ("select", (INT,)),
    "_Z21STOP_SPEED_FEED_SYNCHv": ("unsync", ()),
    "_Z23START_SPINDLE_CLOCKWISEii": ("m3", (INT, INT)),
    "_Z30START_SPINDLE_COUNTERCLOCKWISEii": ("m4", (INT, INT)),
    "_Z20STOP_SPINDLE_TURNINGi": ("m5", (INT,)),
    "_Z17SET_SPINDLE_SPEEDid": ("speed", (INT, D)),
    "_Z16SET_SPINDLE_MODEid": ("speedmode", (INT, D)),
    "_Z14ORIENT_SPINDLEidi": ("orient", (INT, D, INT)),
    "_Z28WAIT_SPINDLE_ORIENT_COMPLETEid": ("oriented", (INT, D)),
    "_Z12PROGRAM_STOPv": ("m0", ()),
    "_Z21OPTIONAL_PROGRAM_STOPv": ("m1", ()),
    "_Z14PALLET_SHUTTLEv": ("pallet", ()),
    "_Z11PROGRAM_ENDv": ("end", ()),
    "_Z7MIST_ONv": ("mist", ()),
    "_Z8FLOOD_ONv": ("flood", ()),
    "_Z8MIST_OFFv": ("mistoff", ()),
    "_Z9FLOOD_OFFv": ("floodoff", ()),
    "_Z20ENABLE_FEED_OVERRIDEv": ("feedoverride", ()),
    "_Z21DISABLE_FEED_OVERRIDEv": ("nofeedoverride", ()),
    "_Z21ENABLE_SPEED_OVERRIDEi": ("speedoverride", (INT,)),
    "_Z22DISABLE_SPEED_OVERRIDEi": ("nospeedoverride", (INT,)),
    "_Z20ENABLE_ADAPTIVE_FEEDv": ("adaptive", ()),
    "_Z21DISABLE_ADAPTIVE_FEEDv": ("noadaptive", ()),
    "_Z16ENABLE_FEED_HOLDv": ("feedhold", ()),
    "_Z17DISABLE_FEED_HOLDv": ("nofeedhold", ()),
    "_Z21SET_MOTION_OUTPUT_BITi": ("m62", (INT,)),
    "_Z23CLEAR_MOTION_OUTPUT_BITi": ("m63", (INT,)),
    "_Z18SET_AUX_OUTPUT_BITi": ("m64", (INT,)),
    "_Z20CLEAR_AUX_OUTPUT_BITi": ("m65", (INT,)),
    "_Z23SET_MOTION_OUTPUT_VALUEid": ("m67", (INT, D)),
    "_Z20SET_AUX_OUTPUT_VALUEid": ("m68", (INT, D)),
}
#: other functions that are redirected: mangled name -> method of the receiver, types of the result and the arguments
REDIRECTED: dict[str, tuple[str, tuple[Any, ...]]] = {
    "_Z22START_SPEED_FEED_SYNCHidb": ("synchronised", (None, INT, D, B)),
    "_Z20SET_TOOL_TABLE_ENTRYii7EmcPosedddi": ("tool_stored", (None, INT, INT, Pose, D, D, D, INT)),
    "fopen64": ("opened", (P, TEXT, TEXT)),
    "fgets": ("line_read", (P, P, INT, P)),
    "_Z7COMMENTPKc": ("commented", (None, TEXT)),  # the module only handles ASCII
    "_Z7MESSAGEPc": ("messaged", (None, TEXT)),
    "_Z18CHANGE_TOOL_NUMBERi": ("change_tool_number", (None, INT)),
    "_Z9RIGID_TAPidddd": ("tapped", (None, INT, D, D, D, D)),
    "_Z4WAITiiid": ("waited", (INT, INT, INT, INT, D)),
    "_Z16USE_LENGTH_UNITS11CANON_UNITS": ("united", (None, INT)),
    "_Z23SET_MOTION_CONTROL_MODE17CANON_MOTION_MODEd": ("pathed", (None, INT, D)),
    "_Z22SET_NAIVECAM_TOLERANCEd": ("naive", (None, D)),
    "_Z10NURBS_FEEDiSt6vectorI13CONTROL_POINTSaIS0_EEj": ("curved", (None, INT, P, ctypes.c_uint)),
}


MOVES = ("rapid", "feed", "probe", "arc")
OTHERS = (
    "centre", "curve", "tap", "g5x", "g92", "rotation", "length", "plane", "unit", "feedrate", "sync", "dwell",
    "change",
    "toolnumber", "tooltable", "wait", "path", "naive", "user", "comment", "message", "file", "error", "done",
)  # fmt: skip
KINDS = (*MOVES, *OTHERS, *(kind for kind, _ in TOLD.values()))
CODES = {kind: code for code, kind in enumerate(KINDS)}
