"""What a model does beyond its trained range, as C99: ``hold`` and ``fade``, each input alone and all together."""

import math
from collections.abc import Iterable, Sequence

from thermocomp.core.inputs import Input
from thermocomp.core.joint import JointSupport
from thermocomp.core.model import ErrorModel
from thermocomp.exporters.cexpression import number

_EXCESS = """
/* how far the inputs are beyond the trained range, in spans over which a deviation fades; 0 inside, 1 at most */
static tc_real support{k}_excess(const tc_real *change)
{{
    static const tc_real low[{n}] = {low};
    static const tc_real high[{n}] = {high};
    static const tc_real span[{n}] = {span};
    tc_real beyond, most = TC(0.0);
    int k;

    for (k = 0; k < {n}; k++) {{
        beyond = change[k] < low[k] ? low[k] - change[k] : (change[k] > high[k] ? change[k] - high[k] : TC(0.0));
        beyond = beyond >= span[k] && beyond > TC(0.0) ? TC(1.0) : (beyond > TC(0.0) ? beyond / span[k] : TC(0.0));
        most = beyond > most ? beyond : most;
    }}
    return most;
}}
"""

_NEAREST = """
/* distance to the nearest training state: 1 is the limit */
static tc_real support{k}_nearest(const tc_real *change)
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
            apart = change[column[k]] * weight[k] - point[p][k];
            square += apart * apart;
        }}
        least = (p == 0 || square < least) ? square : least;
    }}
    return TC_MATH(sqrt)(least);
}}
"""

_LEVEL = """
/* distance to the nearest trained value of input {input}: 1 is the limit */
static tc_real support{k}_level{input}(const tc_real *change)
{{
    static const tc_real level[{levels}] = {level};
    tc_real apart, least = TC(-1.0);
    int k;

    for (k = 0; k < {levels}; k++) {{
        apart = TC_MATH(fabs)(change[{input}] - level[k]);
        least = (k == 0 || apart < least) ? apart : least;
    }}
    return least / {tolerance};
}}
"""


class Supports:
    """C99 of the support policies of some models; what several have in common stands there once.

    Parameters
    ----------
    ranges : sequence of Input
        Of which the inputs of the models are.
    channels : sequence of int
        Which of the values that are read each of them is.
    """

    def __init__(self, ranges: Sequence[Input], channels: Sequence[int]) -> None:
        self._ranges, self._channels = ranges, channels
        self._known: dict[object, int] = {}
        self.functions = ""

    def statements(self, model: ErrorModel, place: int, written: set[int]) -> list[str]:
        """Return what a model does beyond its trained range; they change ``s->deviation[place]``.

        Parameters
        ----------
        model : ErrorModel
        place : int
            Of the model.
        written : set of int
            What the body that these are for has worked out already.
        """
        policy = model.support.policy
        said = f"s->deviation[{place}]"
        if policy == "clip":
            return [f"{said} = said{place};"]
        key = (model.inputs, model.bounds[0], model.bounds[1], model.bounds[2], model.joint)
        k = self._known.setdefault(repr(key), len(self._known))
        lines = []
        if f"support{k}_excess" not in self.functions:
            self._add(model, k)
        if k not in written:
            written.add(k)
            lines += self._distances(model, k)
        if policy == "hold":
            return [*lines, f"{said} = excess{k} > TC(0.0) || !(far{k} <= TC(1.0)) ? {said} : said{place};"]
        over = f"((far{k} - TC(1.0)) / {number(model.support.fade_over)})"
        most = f"({over} > excess{k} ? {over} : excess{k})"
        return [*lines, f"{said} = said{place} * ({most} < TC(1.0) ? TC(1.0) - {most} : TC(0.0));"]

    def _distances(self, model: ErrorModel, k: int) -> list[str]:
        own = [self._ranges.index(i) for i in model.inputs]
        change = ", ".join(f"w->input[{self._channels[r]}] - s->zero[{r}]" for r in own)
        lines = [f"const tc_real change{k}[{len(own)}] = {{{change}}};"]
        lines.append(f"const tc_real excess{k} = support{k}_excess(change{k});")
        if model.joint is None:
            return [*lines, f"const tc_real far{k} = TC(0.0);"]
        parts = [f"support{k}_nearest(change{k})"] if model.joint.columns else []
        parts += [f"support{k}_level{j}(change{k})" for j in model.joint.speeds]
        lines += [f"const tc_real apart{k}_{n} = {part};" for n, part in enumerate(parts)]
        far = "TC(0.0)"
        for n in range(len(parts)):
            far = f"(apart{k}_{n} > {far} ? apart{k}_{n} : {far})"
        # the same on every processor
        return [*lines, f"const tc_real far{k} = TC_MATH(rint)({far} * TC(1e6)) / TC(1e6);"]

    def _add(self, model: ErrorModel, k: int) -> None:
        low, high, span = model.bounds
        self.functions += _EXCESS.format(k=k, n=len(low), low=_table(low), high=_table(high), span=_table(span))
        if model.joint is not None:
            self.functions += _joint(model.joint, k)


def _joint(joint: JointSupport, place: int) -> str:
    text = ""
    if joint.columns:
        unit = joint.limit * math.sqrt(len(joint.columns))
        text = _NEAREST.format(
            k=place,
            columns=len(joint.columns),
            column="{" + ", ".join(map(str, joint.columns)) + "}",
            weight=_table(1.0 / (s * unit) for s in joint.scale),
            points=len(joint.points),
            rows=",\n".join(f"        {_table(v / unit for v in point)}" for point in joint.points),
        )
    for k, levels, tolerance in zip(joint.speeds, joint.levels, joint.tolerances, strict=True):
        text += _LEVEL.format(k=place, input=k, levels=len(levels), level=_table(levels), tolerance=number(tolerance))
    return text


def _table(values: Iterable[float]) -> str:
    return "{" + ", ".join(map(number, values)) + "}"
