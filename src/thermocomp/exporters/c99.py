"""C99: one header and one source that say what a model says, without allocation and without globals."""

import re
from dataclasses import dataclass

from thermocomp.core.model import ErrorModel
from thermocomp.exporters.cexpression import Clock, Written, number
from thermocomp.exporters.csupport import write_support

_HEADER = """/* {title} */
#ifndef {guard}
#define {guard}

#ifndef TC_REAL
#define TC_REAL
#ifdef TC_FLOAT
typedef float tc_real;
#else
typedef double tc_real;
#endif
#endif

/* inputs: {inputs} */
#define {upper}_INPUTS {n}

{clocks}typedef struct {{
    tc_real zero[{n}]; /* what the inputs are counted from */
    int begun;
{memory}}} {name}_state;

/* Begin: `zero` is what the inputs read when the machine was zeroed. */
void {name}_start({name}_state *s, const tc_real zero[{n}]);

/* Take a reading in, `dt` seconds after the one before, and return the deviation [{unit}]. */
tc_real {name}_step({name}_state *s, const tc_real in[{n}], tc_real dt);

#endif
"""

_CLOCK_TYPE = """typedef struct {{
    tc_real past[{past}];
    tc_real mean[{means}][{leaves}];
    tc_real total[{leaves}];
    tc_real phase;
}} {name}_clock{index};

"""

_SOURCE = """#include "{name}.h"

#include <math.h>

#define TC(x) ((tc_real)(x))
#ifdef TC_FLOAT
#define TC_MATH(name) name##f
#else
#define TC_MATH(name) name
#endif
{helpers}{tables}{clocks}{support}
void {name}_start({name}_state *s, const tc_real zero[{n}])
{{
    static const {name}_state cold = {{0}};
    int k;

    *s = cold;
    for (k = 0; k < {n}; k++) {{
        s->zero[k] = zero[k];
    }}
}}

tc_real {name}_step({name}_state *s, const tc_real in[{n}], tc_real dt)
{{
{body}
{said}
    s->begun = 1;
    (void)in;
    (void)dt;
    return said;
}}
"""

_HELPERS = {
    "tc_clip": """
static tc_real tc_clip(tc_real value, tc_real low, tc_real high)
{
    return value < low ? low : (value > high ? high : value);
}
""",
    "tc_follow": """
/* a first-order lag, `paces` time constants later; it rests in its first value */
static tc_real tc_follow(tc_real *lag, tc_real value, tc_real paces, int begun)
{
    *lag = begun ? *lag - TC_MATH(expm1)(-paces) * (value - *lag) : value;
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
    "tc_step": """
static tc_real tc_step(tc_real at, const tc_real *x, const tc_real *y, int n)
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
    """A model in C.

    Parameters
    ----------
    name : str
        Of the files and of all that is in them.
    header, source : str
    """

    name: str
    header: str
    source: str


def translate(model: ErrorModel) -> Sources:
    """Return a model in C99.

    What it computes is what `ErrorModel.step` gives: `ErrorModel.expression`, and what the support policy lets pass.

    Parameters
    ----------
    model : ErrorModel

    Raises
    ------
    InputError
        It is of a family that has no formula.
    """
    written, support = Written(), write_support(model)
    result = written.value(model.expression())
    name, n = identifier(model.target), len(model.inputs)
    body = "\n".join(f"    {line}" for line in written.lines)
    parts = {"name": name, "n": n}
    source = _SOURCE.format(
        **parts,
        helpers="".join(text for word, text in _HELPERS.items() if f"{word}(" in body),
        tables="".join(
            f"\nstatic const tc_real table{k}_{axis}[{len(row)}] = {{{', '.join(map(number, row))}}};\n"
            for k, table in enumerate(written.tables)
            for axis, row in (("x", table.x), ("y", table.y))
        ),
        clocks="".join(
            _CLOCK.format(
                **_sizes(clock, name),
                interval=clock.interval,
                seconds=number(clock.interval),
                tick="\n".join(f"    {line}" for line in clock.statements()),
            )
            for clock in written.clocks
        ),
        support=support.functions,
        body=body,
        said="\n".join([f"    tc_real said = {result};", support.statements]).rstrip(),
    )
    memory = [f"    tc_real lag[{written.lags}];\n"] if written.lags else []
    memory += [f"    {name}_clock{c.index} clock{c.index};\n" for c in written.clocks]
    header = _HEADER.format(
        **parts,
        title=_comment(f"{model.target} [{model.unit}], written by thermocomp"),
        guard=f"{name.upper()}_H",
        upper=name.upper(),
        inputs=_comment(", ".join(f"{i.name} [{i.unit}]" for i in model.inputs)),
        clocks="".join(_CLOCK_TYPE.format(**_sizes(clock, name)) for clock in written.clocks),
        memory="".join(memory) + support.memory,
        unit=_comment(model.unit),
    )
    return Sources(name, header, source)


def identifier(name: str) -> str:
    """Return a name that C takes, as near to another as it gets."""
    text = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_")
    return f"tc_{text}"


def _comment(text: str) -> str:
    return " ".join(text.replace("*/", "* /").replace("/*", "/ *").split())


def _sizes(clock: Clock, name: str) -> dict[str, object]:
    return {
        "name": name,
        "index": clock.index,
        "leaves": len(clock.leaves),
        "past": clock.past,
        "means": max(clock.means, 1),
    }
