"""Capabilities of the watch, and the loss of accuracy with a lost sensor, as text."""

from collections.abc import Iterator, Sequence

from thermocomp.core.explained import DEAR, FAR
from thermocomp.core.model import ErrorModel


def describe_losses(models: Sequence[ErrorModel]) -> Iterator[str]:
    """Yield lines about watched models: the effect of each lost sensor, and sensors that are monitored poorly."""
    watch = next((m.watch for m in models if m.watch is not None), None)
    if watch is None:
        return
    dear = dict[str, None]()
    for model in models:
        found = model.honest_error
        single = {} if found is None else {n: v for n, v in found.lost.items() if ", " not in n}
        stood = {n: v for n, v in single.items() if n in watch.failing and model.may_lose([n])}
        if found is None or not single:
            continue
        said = []
        if stood:
            worst = max(stood, key=lambda n: stood[n])
            said.append(
                f"at most {stood[worst]:.2f} {model.unit} with one sensor lost and replaced by its prediction ({worst})"
            )
        if gone := [n for n in single if n not in stood]:
            said.append(f"without {', '.join(gone)} the correction is held, then fades")
        heat = [n for n in single if n in watch.names]
        dear |= dict.fromkeys(n for n in heat if n not in stood or single[n] > DEAR * found.rms)
        yield f"{model.target}: {found.rms:.2f} {model.unit} RMS on unseen cycles; {'; '.join(said)}"
    if dear:
        yield (
            f"A spare sensor is recommended for {', '.join(dear)}: without it a correction is held, or the error is "
            f"more than {DEAR:g} times as large"
        )
    blind = [f"{n} ({s.off:.1f} degC)" for n, s in zip(watch.names, watch.sensors, strict=True) if s.off > FAR]
    if blind:
        yield (
            f"Slow drift of {', '.join(blind)} is detected only beyond these values, because the other temperatures "
            "and the spindle speed do not predict these sensors more accurately; a spare sensor would help"
        )
