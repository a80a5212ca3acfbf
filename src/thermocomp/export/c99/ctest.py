"""A program that runs the C code of a compensator over its test vectors."""

import math
import re
import textwrap
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from thermocomp.export.c99.c99 import Sources
from thermocomp.export.vectors import Answers, Readings, add_up, find_inner
from thermocomp.runtime.program.tables import Tables

_PROGRAM = """/* runs {name}.c on its test vectors; instructions: {name}.md */
#include "{name}.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>

#ifdef TC_FLOAT
#define TOLERANCE {single:.0e} /* ten times the effect of rounding, at least 1e-5 */
#else
#define TOLERANCE {double:.0e} /* larger for a model with feedback, which amplifies rounding errors */
#endif

enum {{ CALLS = {calls}, INPUTS = {inputs}, TARGETS = {targets}, SENSORS = {sensors} }};

/*
 * values, their age [s], time since the previous call [s], number of the reading; what happens before the call: 1 off
 * and on with the state of the call before, 2 the same with a damaged one, 3 told cold, 4... re-zero of a target; time
 * without power [s], or measured deviation [um]
 */
static const double given[CALLS][INPUTS + 5] = {{
{given}
}};

/* corrections [um] and slopes [um/m] by target */
static const double wanted[CALLS][2 * TARGETS] = {{
{wanted}
}};

/* status by target, fault by sensor, why the reading was not used, inputs beyond the trained range, machine warm */
static const int told[CALLS][TARGETS + SENSORS + 3] = {{
{told}
}};
{inner}
#ifdef TC_FLOAT
#define TABLES 1e-6
#else
#define TABLES 1e-12
#endif

static double worst;

static int off(double value, double want)
{{
    const double size = fabs(want) > 1.0 ? fabs(want) : 1.0;
    const double apart = fabs(value - want) / size;

    worst = apart > worst ? apart : worst;
    return !(apart <= TOLERANCE);
}}

static void happen({name}_state *s, int event, double amount)
{{
    static {name}_saved saved;
    static size_t damaged;

    if (event == 1 || event == 2) {{
        {name}_save(s, &saved);
        if (event == 2) {{ /* at the first byte, at the last one, between them, ... */
            ((unsigned char *)&saved.state)[damaged * (sizeof saved.state - 1) / 2] ^= 1;
            damaged = (damaged + 2) % 3;
        }}
        {name}_power_up(s, &saved, amount);
    }} else if (event == 3) {{
        {name}_cold(s);
    }} else if (event > 3) {{
        {name}_rezero(s, event - 4, amount);
    }}
}}

int main(void)
{{
    static {name}_state s;
    tc_real value[INPUTS];
    int k, j, wrong, failed = 0;

    {name}_start(&s);
    for (k = 0; k < CALLS; k++) {{
        for (j = 0; j < INPUTS; j++) {{
            value[j] = (tc_real)given[k][j];
        }}
        happen(&s, (int)given[k][INPUTS + 3], given[k][INPUTS + 4]);
        if (given[k][INPUTS + 2] == 0.0) {{
            {name}_step(&s, value, given[k][INPUTS], given[k][INPUTS + 1]);
        }} else {{
            {name}_step_counted(&s, value, given[k][INPUTS], given[k][INPUTS + 1], given[k][INPUTS + 2]);
        }}
        wrong = s.rejected != told[k][TARGETS + SENSORS];
#ifndef TC_FLOAT
        wrong |= s.outside != told[k][TARGETS + SENSORS + 1];
#endif
        wrong |= s.warm != told[k][TARGETS + SENSORS + 2];
        for (j = 0; j < TARGETS; j++) {{
            wrong |= off((double)s.correction[j], wanted[k][2 * j]);
            wrong |= off((double)s.slope[j], wanted[k][2 * j + 1]);
            wrong |= s.status[j] != told[k][j];
        }}
{faults}        if (wrong && failed++ < 10) {{
            printf("call %d: correction[0] is %.17g um, want %.17g; status %d, want %d; rejected %d\\n",
                   k, (double)s.correction[0], wanted[k][0], s.status[0], told[k][0], s.rejected);
        }}
    }}
{tables}    printf("%d calls, %d wrong; largest difference %.1e of max(1 um, correction), allowed %.0e\\n",
           CALLS, failed, worst, TOLERANCE);
    printf("state: %lu bytes\\n", (unsigned long)sizeof s);
    return failed != 0;
}}
"""

_TABLES = """    if (!(fabs({name}_tables() / {total!r} - 1.0) <= TABLES)) {{
        printf("the tables of {name}.c are not those that were exported\\n");
        failed++;
    }}
"""

#: appended to the source, and its declaration
_SUM = """
/* add the numbers of a table to a check value: index from 1, times logarithm of the size */
#define TC_ADD(type, table) \\
    for (k = 0; k < (int)(sizeof(table) / sizeof(type)); k++) {{ \\
        x = (double)((const type *)&(table))[k]; \\
        size = log(1.0 + (1e4 * ((fabs(x) < 1e13) ? fabs(x) : 1e13))); \\
        sum += (x < 0.0) ? (-(k + 1) * size) : ((k + 1) * size); \\
    }}

double {name}_tables(void)
{{
    double sum = 0.0;
    double size;
    double x;
    int k;

{adds}
    return sum;
}}
"""
_DECLARED = """/* Return a check value of all tables and limits. */
double {name}_tables(void);

#ifdef __cplusplus
}}
"""
_TABLE = re.compile(r"^static const (tc_real|double|int) (\w+)(?:\[\d+\])* = ([^;]+);", re.MULTILINE)

_FAULTS = """        for (j = 0; j < SENSORS; j++) {
            wrong |= s.fault[j] != told[k][TARGETS + j];
        }
#ifndef TC_FLOAT
        wrong |= inner[k] == inner[k] && !(fabs(add_up(&s) - inner[k]) <= 1e-9 * (1.0 + fabs(inner[k])));
#endif
"""

#: the state of the monitoring shows what the outputs show only if a sensor fails
_INNER = """
#ifndef TC_FLOAT
/* check value of the state of the monitoring; NAN: rounding decides */
static const double inner[CALLS] = {{
{values}
}};

static double part(double value, int k)
{{
    const double size = log(1.0 + 1e4 * fmin(fabs(value), 1e13));

    return value < 0.0 ? -(k + 1) * size : (k + 1) * size;
}}

static double add_up(const {name}_state *s)
{{
    double sum = 0.0;
    int k;

{sums}
    return s->looked ? sum : 0.0;
}}
#endif
"""


def add_check(sources: Sources) -> tuple[Sources, float]:
    """Return sources with a function that adds up all tables, and its expected result.

    Most numbers of the monitoring decide only, and no reading shows a small change of them.
    """
    found = _TABLE.findall(re.sub(r"/\*.*?\*/", "", sources.source, flags=re.DOTALL))
    adds = " ".join(f"TC_ADD({kind}, {name})" for kind, name, _ in found)
    adds = textwrap.fill(adds, 116, initial_indent="    ", subsequent_indent="    ")
    source = sources.source + _SUM.format(name=sources.name, adds=adds)
    begin, end = sources.header.rsplit("#ifdef __cplusplus\n}\n", 1)
    header = begin + _DECLARED.format(name=sources.name) + end
    return replace(sources, header=header, source=source), add_up(map(_numbers, (text for *_, text in found)))


def _numbers(text: str) -> list[float]:
    """Return the numbers of a table."""
    plain = re.sub(r"TC_ROUNDED\(\s*([^,]+),[^()]*\)", r"\1", text)
    return [float(v) for v in re.sub(r"TC\(|[(){}\s]", "", plain).split(",") if v]


def write_test(
    name: str,
    tables: Tables,
    readings: Readings,
    answers: Answers,
    double: float,
    single: float,
    total: float | None = None,
) -> str:
    """Return a program that compares the outputs of the code with those of the compensator.

    Parameters
    ----------
    total : float, optional
        Check value of the tables: see `add_check`.
    double, single : float
        Tolerance in double and in single precision, as a fraction of the correction, or in um for corrections below
        1 um; `single` is 0 if single precision is not supported.
    """
    calls = range(len(readings.age))
    told = np.column_stack([answers.status, answers.fault, answers.why, answers.outside, answers.warm]).astype(int)
    return _PROGRAM.format(
        name=name,
        double=double,
        single=single,
        calls=len(calls),
        inputs=len(tables.channels),
        targets=len(tables.targets),
        sensors=len(tables.sensors),
        given=_rows(readings.columns.tolist()),
        wanted=_rows(
            [x for pair in zip(answers.correction[k], answers.slope[k], strict=True) for x in pair] for k in calls
        ),
        told=",\n".join(f"    {{{', '.join(map(str, row))}}}" for row in told.tolist()),
        faults=_FAULTS if tables.sensors else "",
        inner=_inner(name, tables, answers) if tables.sensors else "",
        tables="" if total is None else _TABLES.format(name=name, total=total),
    )


def _inner(name: str, tables: Tables, answers: Answers) -> str:
    sums = []
    for variable, size in find_inner(tables).items():
        value = "s->cleared[k] ? 0.0 : s->evidence[k]" if variable == "evidence" else f"s->{variable}[k]"
        sums.append(f"    for (k = 0; k < {size}; k++) {{\n        sum += part((double)({value}), k);\n    }}")
    values = ",\n".join(f"    {_number(v)}" for v in answers.inner.tolist())
    return _INNER.format(name=name, values=values, sums="\n".join(sums))


def _rows(rows: Iterable[list[float]]) -> str:
    return ",\n".join(f"    {{{', '.join(map(_number, row))}}}" for row in rows)


def _number(value: float) -> str:
    if math.isnan(value):
        return "NAN"
    return repr(float(value)) if math.isfinite(value) else "INFINITY" if value > 0 else "-INFINITY"
