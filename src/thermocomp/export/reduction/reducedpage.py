"""Page of an export to a simple controller: residual and loss, installation, check, and switching it off."""

from collections.abc import Iterator, Mapping, Sequence

from thermocomp.export.reduction.reduced import Reduced, linear_factors

_PAGE = """{head}

# {name}: thermal compensation by {what}

{about}

## Residual error

On unseen cycles:

| [um] | no compensation | full model | reduced |
|---|---|---|---|
{errors}

{beside}
{more}
## What is lost

{lost}

## Install

{install}

## Check

{check}

## Switch off

{off}
"""

_LOST = """- **State**: the formula uses only the present temperatures: no lag, no spindle speed, no history.
- **Limits**: {limits}
- **Failed sensors**: {failed}
- **Range**: outside the trained range the correction is neither held nor faded. Trained range: {ranges}.
"""


def write_page(
    name: str,
    head: Sequence[str],
    reductions: Sequence[Reduced],
    *,
    what: str,
    about: str,
    limits: str,
    failed: str,
    install: str,
    check: str,
    off: str,
    figure: str,
) -> str:
    """Return the page of instructions for a reduced model."""
    ranges = "; ".join(
        ", ".join(f"{i.name} {i.low:+.1f} to {i.high:+.1f} degC from its zero" for i, _ in r.terms) for r in reductions
    )
    return _PAGE.format(
        head="  \n".join(head),
        name=name,
        what=what,
        about=about,
        beside="\n".join(f"The full model of {r.model.target}: {r.beside}.  " for r in reductions).rstrip(),
        errors="\n".join(line for r in reductions for line in _errors(r)),
        more="\n".join(["", *_more(reductions, figure)]),
        lost=_LOST.format(limits=limits, failed=failed, ranges=ranges).strip(),
        install=install,
        check=check,
        off=off,
    )


def name_table(place: str, names: Mapping[str, tuple[str, str]]) -> str:
    """Return a table of the temperatures by place: name in the file, in ASCII, and in the recording."""
    rows = [f"| {where} | {plain} | {name.replace('|', '/')} |" for where, (plain, name) in names.items()]
    return "\n".join([f"| {place} | name in the file | name in the recording |", "|---|---|---|", *rows])


def _errors(r: Reduced) -> Iterator[str]:
    rms, largest = ([left[k] for left in (r.none, r.full, r.reduced)] for k in (0, 1))
    yield f"| {r.model.target}: RMS | {' | '.join(_number(v) for v in rms)} |"
    yield f"| {r.model.target}: largest | {' | '.join(_number(v) for v in largest)} |"
    yield f"| {r.model.target}: **loss** (RMS, in um and as a ratio) | | | {rms[2] - rms[1]:+.3f}, {r.loss:.3f} times |"


def _more(reductions: Sequence[Reduced], figure: str) -> Iterator[str]:
    for r in reductions:
        if r.replayed is not None:
            yield (
                f"{r.model.target}: on the recordings to which it was fitted, the exported numbers leave a residual of "
                f"RMS {r.replayed.rms:.3f} um, largest {r.replayed.largest:.3f} um. This is not an error on unseen "
                "data; it serves to check a replay of these recordings.\n"
            )
        if r.cycles:
            yield (
                f"{r.model.target}: coefficients fitted without each cycle, and the RMS of the residual on that cycle "
                "[um]:\n"
            )
            yield "| cycle left out | um per K | no compensation | full model | reduced |\n|---|---|---|---|---|"
            for c in r.cycles:
                factors = linear_factors(c.model) or []
                said = ", ".join(f"{i.name} {f!r}" for i, f in zip(c.model.inputs, factors, strict=True) if f)
                if c.model.intercept:
                    said += f", constant {c.model.intercept!r} um"
                yield f"| {c.name} | {said} | {_number(c.none)} | {_number(c.full)} | {_number(c.reduced)} |"
            yield ""
    if figure:
        yield f"![deviation, and the residuals of the full and the reduced model]({figure})\n"


def _number(value: float) -> str:
    return f"{value:.3f}" if value == value else "not known"  # noqa: PLR0124 - nan
