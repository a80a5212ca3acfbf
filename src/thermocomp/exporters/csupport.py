"""What a model does beyond its trained range, as C99: ``hold`` and ``fade``, each input alone and all together."""

import math
from collections.abc import Iterable
from typing import NamedTuple

from thermocomp.core.joint import JointSupport
from thermocomp.core.model import ErrorModel
from thermocomp.exporters.cexpression import number

_EXCESS = """
/* how far the inputs are beyond the trained range, in spans over which a deviation fades; 0 inside, 1 at most */
static tc_real support_excess(const tc_real *in, const tc_real *zero)
{{
    static const tc_real low[{n}] = {low};
    static const tc_real high[{n}] = {high};
    static const tc_real span[{n}] = {span};
    tc_real change, beyond, most = TC(0.0);
    int k;

    for (k = 0; k < {n}; k++) {{
        change = in[k] - zero[k];
        beyond = change < low[k] ? low[k] - change : (change > high[k] ? change - high[k] : TC(0.0));
        beyond = beyond >= span[k] && beyond > TC(0.0) ? TC(1.0) : (beyond > TC(0.0) ? beyond / span[k] : TC(0.0));
        most = beyond > most ? beyond : most;
    }}
    return most;
}}
"""

_NEAREST = """
/* squared distance to the nearest training state: 1 is the limit */
static tc_real support_nearest(const tc_real *in, const tc_real *zero)
{{
    static const int column[{columns}] = {column};
    static const tc_real weight[{columns}] = {weight};
    static const tc_real point[{points}][{columns}] = {{
{rows}
    }};
    tc_real apart, square, least = TC(-1.0);
    int p, k;

    for (p = 0; p < {points}; p++) {{
        square = TC(0.0);
        for (k = 0; k < {columns}; k++) {{
            apart = (in[column[k]] - zero[column[k]]) * weight[k] - point[p][k];
            square += apart * apart;
        }}
        least = (p == 0 || square < least) ? square : least;
    }}
    return least;
}}
"""

_LEVEL = """
/* distance to the nearest trained value of input {input}: 1 is the limit */
static tc_real support_level{input}(const tc_real *in, const tc_real *zero)
{{
    static const tc_real level[{levels}] = {level};
    tc_real apart, least = TC(-1.0);
    int k;

    for (k = 0; k < {levels}; k++) {{
        apart = TC_MATH(fabs)(in[{input}] - zero[{input}] - level[k]);
        least = (k == 0 || apart < least) ? apart : least;
    }}
    return least / {tolerance};
}}
"""


class Support(NamedTuple):
    """C99 of a support policy."""

    functions: str
    memory: str  #: in the state of the model
    statements: str  #: they change ``said``


def write_support(model: ErrorModel) -> Support:
    """Return what a model does beyond its trained range.

    Parameters
    ----------
    model : ErrorModel
    """
    policy, joint = model.support.policy, model.joint
    if policy == "clip":
        return Support("", "", "")
    low, high, span = model.bounds
    functions = _EXCESS.format(n=len(low), low=_table(low), high=_table(high), span=_table(span))
    far = [f"    tc_real excess = support_excess(in, s->zero), far = {number(0.0)};", ""]
    if joint is not None:
        functions += _joint(joint)
        far += ["    far = TC_MATH(sqrt)(support_nearest(in, s->zero));"] if joint.columns else []
        for k in joint.speeds:
            level = f"support_level{k}(in, s->zero)"
            far.append(f"    far = {level} > far ? {level} : far;")
        far.append("    far = TC_MATH(rint)(far * TC(1e6)) / TC(1e6); /* the same on every processor */")
    if policy == "hold":
        far += ["    said = excess > TC(0.0) || !(far <= TC(1.0)) ? s->last : said;", "    s->last = said;"]
        return Support(functions, "    tc_real last; /* deviation */\n", "\n".join(far))
    far += [
        f"    far = (far - TC(1.0)) / {number(model.support.fade_over)};",
        "    excess = far > excess ? far : excess;",
        "    said *= excess < TC(1.0) ? TC(1.0) - excess : TC(0.0);",
    ]
    return Support(functions, "", "\n".join(far))


def _joint(joint: JointSupport) -> str:
    text = ""
    if joint.columns:
        unit = joint.limit * math.sqrt(len(joint.columns))
        text = _NEAREST.format(
            columns=len(joint.columns),
            column="{" + ", ".join(map(str, joint.columns)) + "}",
            weight=_table(1.0 / (s * unit) for s in joint.scale),
            points=len(joint.points),
            rows=",\n".join(f"        {_table(v / unit for v in point)}" for point in joint.points),
        )
    for k, levels, tolerance in zip(joint.speeds, joint.levels, joint.tolerances, strict=True):
        text += _LEVEL.format(input=k, levels=len(levels), level=_table(levels), tolerance=number(tolerance))
    return text


def _table(values: Iterable[float]) -> str:
    return "{" + ", ".join(map(number, values)) + "}"
