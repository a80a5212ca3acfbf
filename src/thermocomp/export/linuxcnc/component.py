"""A LinuxCNC HAL component around the C99 code of a compensator, and the HAL file that moves axes with it."""

import textwrap
from collections.abc import Mapping, Sequence

from thermocomp.core.exceptions import InputError
from thermocomp.export.c99.cstatements import comment
from thermocomp.runtime.program.tables import Tables

#: resolution of the external offset counts [mm]
RESOLUTION = 1e-5
#: longest name in HAL, and longest suffix after the name of the component and a dot [characters]
_LONGEST, _BEHIND = 47, len("motion-enabled")

_COMPONENT = """{facts}component {component} "thermal compensation; {name}.md says how to use it";

pin in float value-#[{inputs}] = NAN;   /* see {name}.md for their order and units */
pin in bit good-#[{inputs}] = TRUE;     /* FALSE for a sensor that reports a failure */
pin in u32 reading;              /* counter of readings: the values are new when it changes */
pin in bit enable = TRUE;        /* FALSE: corrections are held, then decay to zero */

pin in bit told-cold;            /* TRUE: the machine is cold; ignored once the reference is known */
pin in bit rezero;               /* rising edge: correction-K continues from its value minus `measured` */
pin in s32 rezero-target;        /* K */
pin in float measured;           /* deviation (actual minus commanded) with the correction in force [mm] */

pin in bit motion-enabled;       /* from the controller: external offsets can move only if TRUE */
pin in bit all-homed;
pin in bit coord-mode;
pin in bit teleop-mode;
{axes}
pin out float correction-#[{targets}];  /* [mm] */
pin out float slope-#[{targets}];       /* [um/m] */
/* 0 starts, 1 active, 2 holding, 3 fading, 4 shadow, 5 its reference is unknown */
pin out s32 status-#[{targets}];
{faults}/* why a reading was not used: 0 it was used, 1 its time, 2 a value, 3 not a start, 4 the source has stopped */
pin out s32 rejected;
pin out s32 outside;             /* number of inputs beyond the trained range */
pin out bit seems-warm;          /* at the start the temperatures were those of a warm machine: a hint */
pin out float scale = {resolution!r};     /* one count of an external offset [machine units] */
pin out bit engaged;             /* external offsets can move */
param rw float unit = 1.0;       /* machine units per millimetre: 1, or 0.0393700787 for inches */

function _ fp;
option singleton yes;
option extra_setup yes;
option extra_cleanup yes;
license "none";
include "{name}.c";
include <stdio.h>;
include <time.h>;
;;
#undef rejected
#undef outside

#define SECOND 1000000000LL /* [ns] */
#define MAGNITUDE {magnitude!r} /* um */
#define RATE {rate!r} /* um/s */
#define LARGEST 1e6 /* counts per period */

enum {{ INPUTS = {inputs}, TARGETS = {targets} }};

/* ends of the travel, from the reference position [mm]; equal: independent of position */
static const double travel[TARGETS][2] = {{{travel}}};

static {name}_state state; /* all zero: its reference is unknown */
static char *state_file; /* read at the start and then removed; written when the component is unloaded */
RTAPI_MP_STRING(state_file, "file for the state while LinuxCNC does not run");
static int ordered;
static double now[TARGETS][2]; /* corrections in force at both ends of the travel [um] */
static double base[TARGETS]; /* offset in force when it was engaged [machine units] */
static long sent[TARGETS]; /* counts sent since then */
static int lost[TARGETS];
static long long since, waited; /* time since the last reading, and since the last step [ns] */
static hal_u32_t heard;
static int fresh, could;

static double within(double value, double low, double high)
{{
    return value < low ? low : value > high ? high : value;
}}

/* Return the counts to be added to an external offset; ends of the travel from the reference position [mm]. */
static int lacking(int k, const double ends[2], double at, double request, int on, double seconds, double per_mm)
{{
    const double count = {resolution!r} * per_mm, most = RATE * seconds;
    double wanted, order;
    int j;

    lost[k] = 0;
    if (!on) {{ /* start at the offset in force */
        base[k] = isfinite(request) ? request : 0.0;
        now[k][0] = now[k][1] = 1000.0 * base[k] / per_mm;
        sent[k] = 0;
        return 0;
    }}
    /* the requested offset must be in force, else another component moves it or it is not applied */
    lost[k] = !(fabs(request - (base[k] + (double)sent[k] * count)) < 0.5 * count);
    if (lost[k]) {{
        return 0;
    }}
    for (j = 0; j < 2; j++) {{
        wanted = within((double)state.correction[k] + 0.001 * (double)state.slope[k] * ends[j], -MAGNITUDE, MAGNITUDE);
        now[k][j] += within(wanted - now[k][j], -most, most);
    }}
    at = ends[1] > ends[0] ? within((at - ends[0]) / (ends[1] - ends[0]), 0.0, 1.0) : 0.0;
    order = (0.001 * per_mm * (now[k][0] + at * (now[k][1] - now[k][0])) - request) / count;
    if (!(fabs(order) < LARGEST)) {{
        return 0;
    }}
    sent[k] += lround(order);
    return (int)lround(order);
}}

EXTRA_SETUP()
{{
    static struct {{ {name}_saved saved; time_t when; }} kept;
    FILE *file = state_file ? fopen(state_file, "rb") : NULL;
    const int known = file && fread(&kept, sizeof kept, 1, file) == 1;

    (void)__comp_inst; (void)prefix; (void)extra_arg;
    if (file) {{
        fclose(file);
        remove(state_file); /* LinuxCNC may end without writing it anew */
    }}
    {name}_power_up(&state, known ? &kept.saved : NULL, known ? difftime(time(NULL), kept.when) : 0.0);
    return 0;
}}

EXTRA_CLEANUP()
{{
    static struct {{ {name}_saved saved; time_t when; }} kept;
    FILE *file = state_file ? fopen(state_file, "wb") : NULL;

    if (file) {{
        {name}_save(&state, &kept.saved);
        kept.when = time(NULL);
        if ((fwrite(&kept, sizeof kept, 1, file) != 1) | (fclose(file) != 0)) {{
            remove(state_file);
        }}
    }}
}}

static void obey(int told, int order, int target, double by)
{{
    int k, unknown = 0;

    for (k = 0; k < TARGETS; k++) {{
        unknown |= !state.referenced[k];
    }}
    if (told && unknown) {{
        {name}_cold(&state);
    }}
    if (order && !ordered) {{
        {name}_rezero(&state, target, 1000.0 * by);
    }}
    ordered = order;
}}

FUNCTION(_)
{{
    const hal_u32_t count = reading;
    const int can = motion_enabled && all_homed && (coord_mode || teleop_mode) && unit > 0.001 && unit < 1000.0;
    const int on = can && could; /* in the first period LinuxCNC resets an offset from before to zero */
    int k;

    since += period;
    if (count != heard) {{
        heard = count;
        since = 0;
        fresh = 1;
    }}
    waited += period;
    if (waited >= SECOND) {{
        tc_real given[INPUTS];

        for (k = 0; k < INPUTS; k++) {{
            given[k] = good(k) ? (tc_real)value(k) : (tc_real)NAN;
        }}
        obey(told_cold, rezero, rezero_target, measured);
        {name}_step(&state, given, fresh && enable ? 1e-9 * (double)since : 1e9, 1e-9 * (double)waited);
        fresh = 0;
        waited = 0;
        for (k = 0; k < TARGETS; k++) {{
            correction(k) = 0.001 * (double)state.correction[k];
            slope(k) = (double)state.slope[k];
            status(k) = state.status[k];
        }}
{told}        *__comp_inst->rejected = state.rejected;
        *__comp_inst->outside = state.outside;
        seems_warm = state.warm;
    }}
    could = can;
    engaged = on;
    scale = {resolution!r} * unit;
{moves}}}
"""

_FAULTS = (
    "pin out s32 fault-#[{sensors}];         "
    "/* 0 good, 1 missing, 2 stepped, 3 stuck, 4 off, 5 swapped, 6 unexplained */\n"
)
_TOLD = """        for (k = 0; k < {sensors}; k++) {{
            fault(k) = state.fault[k];
        }}
"""
_MOVE = """    {a}_counts += lacking({k}, travel[{k}], {at}, {a}_request, on, 1e-9 * (double)period, unit);
    {a}_lost = lost[{k}];
"""

_HAL = """{facts}
# For a state that outlasts LinuxCNC, FILL IN: loadrt {component} state_file=/FOLDER/{name}.state
loadrt {component}
addf {hal} servo-thread

# 1. Machine units per millimetre: 0.0393700787 if [TRAJ]LINEAR_UNITS is inch.
setp {hal}.unit 1.0

# 2. FILL IN the sources of the readings, and remove the first # of each line. Until then nothing moves.
#    good-K is optional. Increment reading with each new set of values: if it does not change, the values are old.
{sources}
#net {hal}-reading SOURCE => {hal}.reading

# 3. Power-up: until the reference is known, nothing moves. Tell the machine cold from a button of the panel, or here:
#setp {hal}.told-cold 1

# 4. Whether an external offset may move. If your HAL connects one of these pins to a signal, use that signal here.
net {hal}-enabled motion.motion-enabled => {hal}.motion-enabled
net {hal}-homed motion.is-all-homed => {hal}.all-homed
net {hal}-coord motion.coord-mode => {hal}.coord-mode
net {hal}-teleop motion.teleop-mode => {hal}.teleop-mode

# 5. Axes. Each needs OFFSET_AV_RATIO = 0.1 in its [AXIS_...] of the INI: otherwise nothing moves, without a message.
{axes}
"""


def name_component(name: str) -> str:
    """Return the name of a compensator's component, different from the name of its source."""
    component = f"{name}_hal"
    if (over := len(component) + 1 + _BEHIND - _LONGEST) > 0:
        raise InputError(f"--name: {over} characters too long: a name in HAL has at most {_LONGEST} characters")
    return component


def write_component(tables: Tables, name: str, facts: Sequence[str], letters: Mapping[str, str]) -> str:
    """Return the source text of a HAL component, for ``halcompile``."""
    pins, moves = list[str](), list[str]()
    for k, target in enumerate(tables.targets):
        a, at = letters[target].lower(), "0.0"
        pins.append(f"\n/* {letters[target]}: {comment(target)} */")
        pins += [f"pin in float {a}-request;", f"pin out s32 {a}-counts;", f"pin out bit {a}-lost;"]
        if has_slopes(tables):
            pins.append(f"pin in float {a}-position;")
            at = f"{a}_position / unit - {tables.values['position'][k]!r}"
        moves.append(_MOVE.format(a=a, k=k, at=at))
    sensors, known = len(tables.sensors), tables.values
    ends = zip(known["travel_low"], known["travel_high"], known["position"], strict=True)
    travel = ", ".join(f"{{{low - at!r}, {high - at!r}}}" if low < high else "{0.0, 0.0}" for low, high, at in ends)
    return _COMPONENT.format(
        facts="".join(f"/* {comment(line)} */\n" for line in facts),
        component=name_component(name),
        name=name,
        inputs=len(tables.channels),
        targets=len(tables.targets),
        axes="\n".join(pins) + "\n",
        faults=_FAULTS.format(sensors=sensors) if sensors else "",
        told=_TOLD.format(sensors=sensors) if sensors else "",
        moves="".join(moves),
        travel=travel,
        resolution=RESOLUTION,
        magnitude=float(tables.values["magnitude"]),
        rate=float(tables.values["rate"]),
    )


def write_hal(tables: Tables, name: str, facts: Sequence[str], letters: Mapping[str, str]) -> str:
    """Return the HAL file that loads a component and moves axes with it."""
    hal = name_component(name).replace("_", "-")
    sources = [
        f"#net {hal}-value-{k} SOURCE => {hal}.value-{k}\n#net {hal}-good-{k} SOURCE => {hal}.good-{k}"
        for k in range(len(tables.channels))
    ]
    told = [
        remark(f"{k}: {c.name} [{c.unit}]{_such_as(c.quantity)}") + source
        for k, (c, source) in enumerate(zip(tables.channels, sources, strict=True))
    ]
    axes = []
    for target in tables.targets:
        a = letters[target].lower()
        axes += [
            remark(f"{letters[target]}: {target}").rstrip(),
            f"setp axis.{a}.eoffset-enable 1",
            f"net {hal}-scale {hal}.scale => axis.{a}.eoffset-scale",
            f"net {hal}-{a}-counts {hal}.{a}-counts => axis.{a}.eoffset-counts",
            f"net {hal}-{a}-request axis.{a}.eoffset-request => {hal}.{a}-request",
        ]
        if has_slopes(tables):
            axes.append(f"net {hal}-{a}-position axis.{a}.pos-cmd => {hal}.{a}-position")
    return _HAL.format(
        facts="".join(map(remark, facts)),
        component=name_component(name),
        name=name,
        hal=hal,
        sources="\n".join(told),
        axes="\n".join(axes),
    )


def has_slopes(tables: Tables) -> bool:
    """Return whether a correction depends on the axis position."""
    return any(tables.values["to_slope"])


def remark(text: str) -> str:
    """Return a text as HAL comments: wrapped, and without backslashes, which would continue a line."""
    lines = textwrap.wrap(comment(text).replace("\\", "/"), 110, break_on_hyphens=False)
    return "".join(f"# {line}\n" for line in lines or [""])


def _such_as(quantity: str) -> str:
    return ", such as spindle.0.speed-out-abs" if quantity == "spindle_speed" else ""
