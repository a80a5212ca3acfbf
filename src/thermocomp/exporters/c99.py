"""C99: a compensator as one header and one source, without allocation and without globals."""

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass

from thermocomp.exporters.block.tables import Tables
from thermocomp.exporters.cexpression import Clock, Written, number
from thermocomp.exporters.cstatements import write_functions, write_tables, write_variables
from thermocomp.exporters.csupport import Supports

_HEADER = """{facts}#ifndef {guard}
#define {guard}

#ifndef TC_REAL
#define TC_REAL
#ifdef TC_FLOAT
typedef float tc_real;
#else
typedef double tc_real;
#endif
#endif

/* readings that the zero is averaged of, at most; fewer take less memory, and then it is known earlier */
#ifndef TC_ZERO_READINGS
#define TC_ZERO_READINGS {most}
#endif

/* what it takes, in this order */
enum {{
{inputs}
}};

/* what it corrects, in this order */
enum {{
{outputs}
}};

{clocks}/* what is kept between two calls: read it, change nothing */
typedef struct {{
{state}{memory}}} {name}_state;

/* Begin: all corrections are zero. */
void {name}_start({name}_state *s);

/*
 * Take values in, measured `age` seconds ago, and move the corrections; `dt` is the time since the call before [s].
 * A value that is missing is given as NAN. Call it at every cycle: with values that are not new it waits, holds and
 * at last lets the corrections go to zero.
 */
void {name}_step({name}_state *s, const tc_real value[{n}], double age, double dt);

#endif
"""

_CLOCK_TYPE = """typedef struct {{
    tc_real past[{past}];
    tc_real mean[{means}][{leaves}];
    tc_real total[{leaves}];
    tc_real phase;
}} {name}_clock{index};

"""

_SOURCE = """{facts}#include "{name}.h"

#include <math.h>

#ifdef __FAST_MATH__
#error "a value that is no number would not be noticed: compile without -ffast-math"
#endif

#define TC(x) ((tc_real)(x))
#ifdef TC_FLOAT
#define TC_MATH(name) name##f
#else
#define TC_MATH(name) name
#endif

/* what is worked out anew in every call */
typedef struct {{
{work}}} {name}_work;

{constants}{helpers}{tables}{clocks}{support}
{functions}
void {name}_start({name}_state *s)
{{
    static const {name}_state cold = {{0}};

    *s = cold;
}}

void {name}_step({name}_state *s, const tc_real value[{n}], double age, double dt)
{{
    {name}_work w;
    int k;

    for (k = 0; k < {n}; k++) {{
        w.value[k] = value[k];
    }}
    w.age = age;
    w.dt = dt;
    tc_step(s, &w);
}}
"""

_HELPERS = {
    "tc_clip": """
static tc_real tc_clip(tc_real value, tc_real low, tc_real high)
{
    return value < low ? low : (value > high ? high : value);
}
""",
    "tc_lag": """
/* a first-order lag; it rests in its first value */
static tc_real tc_lag(tc_real *lag, tc_real value, tc_real gain, int begun)
{
    *lag = begun ? *lag + gain * (value - *lag) : value;
    return *lag;
}
""",
    "tc_linear": """
/* straight lines between points, constant beyond them */
static tc_real tc_linear(tc_real at, const tc_real *x, const tc_real *y, int n)
{
    int k = 0;

    while (k < n && x[k] <= at) {
        k++;
    }
    if (k == 0) {
        return y[0];
    }
    if (k == n) {
        return y[n - 1];
    }
    return y[k - 1] + (y[k] - y[k - 1]) / (x[k] - x[k - 1]) * (at - x[k - 1]);
}
""",
    "tc_stairs": """
static tc_real tc_stairs(tc_real at, const tc_real *x, const tc_real *y, int n)
{
    int k = 0;

    while (k < n && x[k] <= at) {
        k++;
    }
    return y[k];
}
""",
}

_CLOCK = """
static tc_real clock{index}_tick(const {name}_clock{index} *s, const tc_real mean[{leaves}])
{{
    (void)s;
    (void)mean;
{tick}
}}

/* a value that is made anew every {interval:g} s; between two it goes straight to what the next would be */
static tc_real clock{index}_step({name}_clock{index} *s, const tc_real now[{leaves}], tc_real dt, int begun)
{{
    const tc_real interval = {seconds};
    tc_real mean[{leaves}];
    tc_real ticks, next, phase;
    int k, i, moves = 1;

    if (!begun) {{
        dt = TC(0.0);
        for (i = 0; i < {leaves}; i++) {{
            s->mean[0][i] = now[i];
        }}
    }}
    ticks = TC_MATH(floor)((s->phase + dt) / interval + TC(1e-6));
    phase = s->phase + dt - ticks * interval;
    dt = ticks > TC(0.0) ? phase : dt;
    while (ticks > TC(0.0) && moves) {{ /* what has settled moves no more */
        moves = 0;
        for (i = 0; i < {leaves}; i++) {{
            mean[i] = (s->total[i] + (interval - s->phase) * now[i]) / interval;
        }}
        next = clock{index}_tick(s, mean);
        for (k = {past} - 1; k >= 0; k--) {{
            moves = moves || s->past[k] < next || s->past[k] > next;
            s->past[k] = k > 0 ? s->past[k - 1] : next;
        }}
        for (i = 0; i < {leaves}; i++) {{
            for (k = {means} - 1; k >= 0; k--) {{
                moves = moves || s->mean[k][i] < mean[i] || s->mean[k][i] > mean[i];
                s->mean[k][i] = k > 0 ? s->mean[k - 1][i] : mean[i];
            }}
            s->total[i] = TC(0.0);
        }}
        s->phase = TC(0.0);
        ticks -= TC(1.0);
    }}
    s->phase = phase;
    for (i = 0; i < {leaves}; i++) {{
        s->total[i] += dt * now[i];
        mean[i] = phase > TC(0.0) ? s->total[i] / phase : now[i];
    }}
    if (phase <= TC(1e-6) * interval) {{
        return s->past[0];
    }}
    return s->past[0] + phase / interval * (clock{index}_tick(s, mean) - s->past[0]);
}}
"""


@dataclass(frozen=True)
class Sources:
    """A compensator in C.

    Parameters
    ----------
    name : str
        Of the files and of all that is in them.
    header, source : str
    """

    name: str
    header: str
    source: str


def translate(tables: Tables, name: str, facts: Sequence[str] = ()) -> Sources:
    """Return a compensator in C99.

    What it does with values is what `Compensator.step` does with a reading.

    Parameters
    ----------
    tables : Tables
        Of the compensator.
    name : str
        Of the files and of all that is in them.
    facts : sequence of str
        What stands above them.

    Raises
    ------
    InputError
        A model is of a family that has no formula.
    """
    name, n, sizes = identifier(name), len(tables.channels), tables.sizes
    written, supports = Written(tables.values["channel"]), Supports(tables.ranges, tables.values["channel"])
    bodies = {f"models_{when}": _body(tables, written, supports, when) for when in ("absolute", "rezeroed")}
    functions = write_functions(sizes, name, bodies)
    everything = "".join(bodies.values())
    clocks = {c.index: _sizes(c, name) for c in written.clocks}
    above = "".join(f"/* {_comment(line)} */\n" for line in facts)
    source = _SOURCE.format(
        facts=above,
        name=name,
        n=n,
        work=write_variables(sizes, "w", functions + "w->value w->age w->dt"),
        constants=write_tables(sizes, tables.values, functions),
        helpers="".join(text for word, text in _HELPERS.items() if word in everything + "".join(_ticks(written))),
        tables="".join(
            f"\nstatic const tc_real table{k}_{axis}[{len(row)}] = {{{', '.join(map(number, row))}}};\n"
            for k, table in enumerate(written.tables)
            for axis, row in (("x", table.x), ("y", table.y))
        ),
        clocks="".join(
            _CLOCK.format(
                **clocks[c.index],
                interval=c.interval,
                seconds=number(c.interval),
                tick="\n".join(_indented(c.statements())),
            )
            for c in written.clocks
        ),
        support=supports.functions,
        functions=functions,
    )
    memory = [f"    tc_real lag[{written.lags}]; /* of the models */\n"] if written.lags else []
    memory += [f"    {name}_clock{c.index} clock{c.index};\n" for c in written.clocks]
    header = _HEADER.format(
        name=name,
        n=n,
        facts=above,
        guard=f"{name.upper()}_H",
        most=sizes["MOST"],
        inputs=_enumerated(name, "IN", [f"{c.name} [{c.unit}]" for c in tables.channels]),
        outputs=_enumerated(name, "OUT", [f"{t} [um]" for t in tables.targets]),
        clocks="".join(_CLOCK_TYPE.format(**c) for c in clocks.values()),
        state=write_variables(sizes, "s", functions + "s->status s->correction s->rejected s->fault s->outside"),
        memory="".join(memory),
    )
    return Sources(name, header, "".join(_wrapped(line) for line in source.splitlines(keepends=True)))


def _wrapped(line: str) -> str:
    """Return a long line as several: a compiler need not take more than 4,095 characters."""
    if len(line) <= 200:
        return line
    return textwrap.fill(line, 110, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False) + "\n"


def _body(tables: Tables, written: Written, supports: Supports, when: str) -> str:
    """Return the body of the function that works some models out: those that wait for their zero, or the others."""
    mine = [(k, m) for k, m in enumerate(tables.models) if tables.waits(m) == (when == "rezeroed")]
    worked_out = set[int]()
    for k, model in mine:
        written.lines.append(f"const tc_real said{k} = {written.value(tables.formula(model))};")
        written.lines += supports.statements(model, k, worked_out)
    lines = written.take_lines()
    text = "\n".join(lines)
    head = [f"const int begun = s->begun_{when};"] if "begun)" in text else []
    head += ["const tc_real dt = (tc_real)w->step;"] if re.search(r"\bdt\b", text) else []
    tail = [f"s->begun_{when} = 1;", *([] if "w->" in text + "".join(head) else ["(void)w;"])]
    return "\n".join(_indented([*head, *lines, *tail]))


def _indented(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" for line in lines]


def _ticks(written: Written) -> list[str]:
    return [line for c in written.clocks for line in c.statements()]


def _enumerated(name: str, kind: str, texts: Sequence[str]) -> str:
    lines = []
    for k, text in enumerate(texts):
        word = re.sub(r"[^A-Za-z0-9]+", "_", text.split(" [")[0]).strip("_").upper() or "X"
        lines.append(
            f"    {name.upper()}_{kind}_{k}_{word} = {k}{',' if k < len(texts) - 1 else ''} /* {_comment(text)} */"
        )
    return "\n".join(lines)


def identifier(name: str) -> str:
    """Return a name that C takes, as near to another as it gets."""
    text = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return f"tc_{text}"


def _comment(text: str) -> str:
    for sign in ("*/", "/*", "??"):
        text = text.replace(sign, " ".join(sign))
    return " ".join(text.encode("ascii", "backslashreplace").decode().split())


def _sizes(clock: Clock, name: str) -> dict[str, object]:
    return {
        "name": name,
        "index": clock.index,
        "leaves": len(clock.leaves),
        "past": clock.past,
        "means": max(clock.means, 1),
    }
