"""HAL text that applies corrections in the servo thread: rate limit, magnitude limit and position dependence."""

from collections.abc import Sequence
from typing import NamedTuple

from thermocomp.nc.linuxcnc.machineini import HalFiles

#: size of one count of an external offset [mm]
RESOLUTION = 1e-5
#: maximum number of joints per lookup table
_INPUTS = 4


class HalAxis(NamedTuple):
    """A corrected axis: joint, travel, speed and acceleration, in machine units."""

    letter: str
    joint: int  #: joint number; -1: not needed
    low: float
    high: float
    speed: float  #: available to a correction
    acceleration: float  #: available to a correction


def load_modules(axes: Sequence[HalAxis], joints: int, pattern: str, files: HalFiles, todo: list[str]) -> list[str]:
    """Return the lines that load HAL modules; LinuxCNC loads each module only once."""
    letters = [a.letter for a in axes]
    homed = ["tc.homed" if k == 0 else f"tc.homed-{k}" for k in range(-(-joints // _INPUTS))]
    wanted = {
        "lut5": ["tc.on", "tc.off", "tc.was", "tc.beat", "tc.alive", "tc.enabled", "tc.limited", *homed],
        "mux2": [f"tc.{a}.{n}" for a in letters for n in ("from0", "from1")],
        "limit2": [f"tc.{a}.{n}" for a in letters for n in ("offset", "slope", "clip")],
        "mult2": [f"tc.{a}.times" for a in letters],
        "sum2": [f"tc.{a}.{n}" for a in letters for n in ("away", "line")],
    }
    if pattern == "offset":
        wanted["limit2"] += [f"tc.{a}.force" for a in letters]
        wanted["sum2"] += [f"tc.{a}.{n}" for a in letters for n in ("error", "counts")]
        wanted["conv_float_s32"] = [f"tc.{a}.whole" for a in letters]
        wanted["conv_s32_float"] = [f"tc.{a}.back" for a in letters]
    else:
        wanted["limit3"] = [f"tc.{a}.smooth" for a in letters]
        wanted["offset"] = [f"tc.{a}.drive" for a in letters]
    lines = []
    for module, names in wanted.items():
        if module not in files.modules:
            lines.append(f"loadrt {module} names={','.join(names)}")
            continue
        file, line, arguments = files.modules[module]
        key, _, value = arguments.partition("=")
        before = (
            value.split(",")
            if key == "names"
            else [f"{module}.{k}" for k in range(int(value) if value.isdigit() else 1)]
        )
        if not set(names) <= set(before):
            todo.append(
                f"{file}: line {line} already loads {module}, and LinuxCNC loads a module only once; change it to: "
                f"loadrt {module} names={','.join([*before, *(n for n in names if n not in before)])}"
            )
    return lines


def _net(files: HalFiles, source: str, *sinks: str) -> str:
    """Return the line that links pins to the signal of a source; a new signal is created if the machine has none."""
    own = "tc-" + source.replace(".", "-")
    return f"net {files.signals.get(source, own)} {source} => {' '.join(sinks)}"


def make_gate(joints: int, pattern: str, files: HalFiles) -> list[str]:
    """Return the HAL lines that determine whether a correction can be in force."""
    lines, before = [], ""
    for k in range(-(-joints // _INPUTS)):
        name = "tc.homed" if k == 0 else f"tc.homed-{k}"
        here = [f"joint.{j}.homed" for j in range(_INPUTS * k, min(joints, _INPUTS * (k + 1)))]
        lines.append(f"setp {name}.function 0x80000000")
        lines += [_net(files, pin, f"{name}.in-{i}") for i, pin in enumerate(here)]
        lines += [f"setp {name}.in-{i} 1" for i in range(len(here), _INPUTS)]
        lines.append(f"net {before} => {name}.in-4" if before else f"setp {name}.in-4 1")
        before = "tc-homed" if joints <= _INPUTS * (k + 1) else f"tc-homed-{k}"
        lines.append(f"net {before} {name}.out")
        lines.append(f"addf {name} servo-thread")
    lines += [f"net {before} => {n}.in-3" for n in ("tc.on", "tc.off", "tc.was")]
    if pattern == "offset":  # also enabled, and coordinated or teleop mode: otherwise an external offset does not move
        table = 0xA800
        for i, pin in enumerate(("motion-enabled", "coord-mode", "teleop-mode")):
            lines.append(_net(files, f"motion.{pin}", *(f"{n}.in-{i}" for n in ("tc.on", "tc.off", "tc.was"))))
    else:
        table = 0xFF00
    # only if true in the previous period too: in the first one LinuxCNC resets a retained offset to zero
    lines += ["net tc-was tc.was.out => tc.on.in-4 tc.off.in-4", f"setp tc.was.function {table:#x}"]
    lines += [f"setp tc.on.function {table << 16:#x}", f"setp tc.off.function {0xFFFFFFFF ^ table << 16:#x}"]
    lines += ["net tc-on tc.on.out", "net tc-off tc.off.out"]
    lines += ["net tc-heartbeat => tc.beat.in-0", "net tc-beat tc.beat.out", "net tc-alive => tc.alive.in-0"]
    lines += [_net(files, "motion.motion-enabled", "tc.enabled.in-0"), "net tc-enabled tc.enabled.out"]
    lines += [_net(files, "motion.eoffset-limited", "tc.limited.in-0"), "net tc-limited tc.limited.out"]
    copying = ("tc.beat", "tc.alive", "tc.enabled", "tc.limited")
    lines += [f"setp {n}.function 0x2" for n in copying]  # copy the input to the output
    return lines + [f"addf {n} servo-thread" for n in ("tc.on", "tc.off", "tc.was", *copying)]


def make_line(axis: HalAxis, files: HalFiles, magnitude: float, micron: float) -> list[str]:
    """Return the HAL lines that move offset and slope of an axis to their targets and compute the correction.

    Parameters
    ----------
    magnitude : float
        Largest correction [um].
    """
    a, most = axis.letter, magnitude * micron
    lines = [
        _net(files, f"axis.{a}.pos-cmd", f"tc.{a}.away.in0"),
        f"setp tc.{a}.away.offset {0.0 - (axis.low + axis.high) / 2.0!r}",
    ]
    for k, part in enumerate(("offset", "slope")):
        lines += [
            f"net tc-on => tc.{a}.from{k}.sel",
            f"net tc-{a}-{part}-gated tc.{a}.from{k}.out => tc.{a}.{part}.in",
            f"net tc-{a}-{part} => tc.{a}.from{k}.in1",
            f"net tc-off => tc.{a}.{part}.load",
            f"net tc-{a}-{part}-rate => tc.{a}.{part}.maxv",
        ]
    lines += [
        f"net tc-{a}-slope-now tc.{a}.slope.out => tc.{a}.times.in0",
        f"net tc-{a}-away tc.{a}.away.out => tc.{a}.times.in1",
        f"net tc-{a}-offset-now tc.{a}.offset.out => tc.{a}.line.in0",
        f"net tc-{a}-sloping tc.{a}.times.out => tc.{a}.line.in1",
        f"net tc-{a}-line tc.{a}.line.out => tc.{a}.clip.in",
        f"setp tc.{a}.clip.min {-most!r}",
        f"setp tc.{a}.clip.max {most!r}",
    ]
    order = ("away", "from0", "from1", "offset", "slope", "times", "line", "clip")
    return lines + [f"addf tc.{a}.{n} servo-thread" for n in order]


def make_offset(axis: HalAxis, files: HalFiles, micron: float) -> list[str]:
    """Return the HAL lines that keep an external offset at its target.

    LinuxCNC adds up the changes of the counts, and some are lost: the difference from the controller's own request is
    therefore added. While no correction can be in force, the line starts from that request: the difference is zero.
    """
    a, scale = axis.letter, RESOLUTION * 1e3 * micron
    request = f"axis.{a}.eoffset-request"
    return [
        f"setp axis.{a}.eoffset-scale {scale!r}",
        f"setp axis.{a}.eoffset-enable 1",
        _net(files, request, f"tc.{a}.error.in1", f"tc.{a}.from0.in0"),
        f"net tc-{a}-demand tc.{a}.clip.out => tc.{a}.error.in0",
        f"setp tc.{a}.error.gain0 {1.0 / scale!r}",
        f"setp tc.{a}.error.gain1 {-1.0 / scale!r}",
        f"net tc-{a}-error tc.{a}.error.out => tc.{a}.counts.in0",
        f"net tc-{a}-before tc.{a}.back.out => tc.{a}.counts.in1",
        f"net tc-{a}-counts-float tc.{a}.counts.out => tc.{a}.whole.in",
        f"net tc-{a}-counts tc.{a}.whole.out => axis.{a}.eoffset-counts tc.{a}.back.in",
        _net(files, f"axis.{a}.eoffset", f"tc.{a}.force.in"),
        f"net tc-{a}-force tc.{a}.force.out",
        *(f"addf tc.{a}.{n} servo-thread" for n in ("error", "counts", "whole", "back", "force")),
    ]


def make_drive(axis: HalAxis, files: HalFiles) -> list[str]:
    """Return the HAL lines that add a correction to the drive command and subtract it from the feedback."""
    a, command, feedback = axis.letter, f"joint.{axis.joint}.motor-pos-cmd", f"joint.{axis.joint}.motor-pos-fb"
    told, answered = files.signals[command], files.signals[feedback]
    drives = [p for p in files.pins[told] if not p.startswith("joint.")]
    at = 1 + files.functions.index("motion-command-handler")
    lines = [
        f"net tc-{a}-demand tc.{a}.clip.out => tc.{a}.smooth.in",
        f"setp tc.{a}.smooth.maxv {axis.speed!r}",
        f"setp tc.{a}.smooth.maxa {axis.acceleration!r}",
        f"net tc-{a}-force tc.{a}.smooth.out => tc.{a}.drive.offset",
        f"net {told} => tc.{a}.drive.in",
        *(f"unlinkp {pin}" for pin in drives),
        f"unlinkp {feedback}",
        f"net tc-{a}-drive tc.{a}.drive.out {' '.join(['=>', *drives] if drives else [])}".rstrip(),
        f"net tc-{a}-fb tc.{a}.drive.fb-out => {feedback}",
        f"net {'tc-' + a + '-drive' if answered == told else answered} => tc.{a}.drive.fb-in",
        f"addf tc.{a}.drive.update-feedback servo-thread {at}",
    ]
    files.functions.insert(at - 1, f"tc.{a}.drive.update-feedback")
    # directly after the planner: the correction added here is subtracted from the feedback one period later
    after = files.functions.index("motion-controller") + 2
    for name in ("update-output", "smooth"):
        function = f"tc.{a}.drive.{name}" if name == "update-output" else f"tc.{a}.{name}"
        files.functions.insert(after - 1, function)
        lines.append(f"addf {function} servo-thread {after}")
    return lines
