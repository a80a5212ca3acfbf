"""Controls with user macros: how a macro is written for each, and what is known and not confirmed about it."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Control:
    """A control, and the language of its macros.

    Parameters
    ----------
    name : str
        Its name in the page, with an article.
    ending : str
        Ending of the file.
    program : str
        Format of the number of the program.
    before, after : str
        Lines before and after the macro.
    jump : str
        Format of a conditional jump: condition, label.
    common : str
        Format of a common variable: number.
    local : tuple of str
        Two local variables.
    on : int
        Number of the common variable that switches the correction on; the temperatures follow, after 20 the forces.
    vacant : bool
        A variable that was never written can be told from 0 (``#0``).
    adds : bool
        The macro adds changes to the offset; False: it writes its correction there.
    offsets : mapping of str to str
        Format of an offset by axis; the numbers that it is used for are in `systems`.
    systems : range
        Numbers of the work coordinate systems that are shifted.
    offset, unconfirmed, known, source, load : str
        Texts of the page.
    """

    name: str
    ending: str
    program: str = "O{:04d}"
    before: str = "%\n"
    after: str = "M99\n%\n"
    jump: str = "IF [{}] GOTO{}"
    common: str = "#{}"
    local: tuple[str, str] = ("#1", "#2")
    on: int = 500
    vacant: bool = True
    adds: bool = True
    offsets: Mapping[str, str]
    systems: range = range(1)
    offset: str
    unconfirmed: tuple[str, ...]
    known: str
    source: str
    load: str

    def variable(self, place: int) -> str:
        """Return a common variable, counted from the one that switches the correction on."""
        return self.common.format(self.on + place)

    def moved(self, axis: str) -> list[str]:
        """Return the offsets of an axis."""
        return [self.offsets[axis].format(n) for n in self.systems]


_ISO = {"X": "#5201", "Y": "#5202", "Z": "#5203"}

FANUC = Control(
    name="a Fanuc control",
    ending="nc",
    offsets=_ISO,
    offset="external workpiece zero offset",
    unconfirmed=(
        "no line of this was tested on a Fanuc control or checked against its manuals",
        "#5201, #5202, #5203 as external workpiece zero offset of X, Y, Z in mm, which a program may write",
        "how the PMC writes temperatures in degC to #501 and following; replace these numbers by yours",
        "that your control applies a new offset before the next move",
    ),
    known="Programs O8000 to O9999 are usually protected against editing.",
    source="Have the PMC write the temperatures in degC. If a sensor fails, it must write vacant or leave the value "
    "unchanged;",
    load="Load `{file}`. Call it (`G65 P{program}`, so that it has its own local variables)",
)

HAAS = Control(
    name="a Haas control",
    ending="nc",
    program="O{:05d}",
    adds=False,
    offsets=_ISO,
    offset="G52 shift",
    unconfirmed=(
        "no line of this was tested on a Haas control",
        "that G52 (#5201, #5202, #5203) shifts all work offsets, and stays after M30, RESET and power-off: with "
        "Setting 33 = FANUC it does not; see Setting 33 = HAAS; and that a new value applies before the next move",
        "that lengths are in mm (Setting 9 = METRIC)",
        "who writes temperatures in degC to #501 and following; replace these numbers by yours",
        "that a variable which was never written equals #0, and one with the value 0 does not",
    ),
    known="By Haas's manuals: #500 to #549 are retained at power-off (Next Generation Control: #10500 to #10549, the "
    "same\nvariables), #550 to #599 belong to the probe; #5201 to #5203 are the values of G52; a block that reads an "
    "offset stops the\nlook-ahead; `ROUND[...]` gives a whole number; a lathe removes a G52 at M30, RESET and power-"
    "off with Setting 33 =\nFANUC.",
    source="A computer can write the temperatures in degC by Ethernet (*Machine Data Collection*, Setting 143: it "
    "can set some\n   macro variables, see the manual which). If a sensor fails, it must write 999;",
    load="Load `{file}` into the memory. Call it (`G65 P{program}`, so that it has its own local variables)",
)

OKUMA = Control(
    name="an Okuma OSP machining centre (User Task 2)",
    ending="SSB",
    before="",
    after="RTS\n",
    jump="IF [{}] N{}",
    common="VC{}",
    local=("DT1", "DT2"),
    on=150,
    vacant=False,
    offsets={axis: f"VZOF{axis}[{{}}]" for axis in "XYZ"},
    systems=range(1, 7),
    offset="zero offsets of the work coordinate systems 1 to 6",
    unconfirmed=(
        "no line of this was tested on an Okuma control or checked against its manuals",
        "VZOFX, VZOFY, VZOFZ as zero offsets in mm, which a program may write, and which apply from the next G15 H on",
        "that you use work coordinate systems 1 to 6 only; delete or add lines",
        "ROUND[...] as rounding to a whole number",
        "that VC150 to VC173 are free and retained at power-off; replace them by yours",
        "who writes temperatures in degC to VC151 and following, and 999 for one that is missing",
    ),
    known="Seen in programs that others publish, not in the manuals: `IF[...]N100` and `GOTO`, labels that begin with "
    "N, `RTS`,\n`CALL O...`, local variables of up to four characters that do not begin with N, O, S or V, `VZOFZ[n]` "
    "read and written, and\n`G15 H=n` after it. A lathe has one `VZOFZ` without a number, and X is a diameter there: "
    "not supported. A program that\nsets a zero offset to a number of its own removes the correction from it: set "
    "datums by measuring them with the\ncorrection in force.",
    source="A program on the control can write the temperatures in degC (THINC API: `SetCommonVariableValue`). If a "
    "sensor fails,\n   it must write 999, since a variable that was never written has the value 0;",
    load="Load the file as `O{program}.SSB`. Call it (`CALL O{program}`) before `G15 H`,",
)
