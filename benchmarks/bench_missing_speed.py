"""A spindle speed that is missing for the rest of a test: error of z, with the speed and without it.

Run with ``python benchmarks/bench_missing_speed.py``. The models are fitted to the demo; the tests are of other seeds
(plus ``THERMOCOMP_SEED``): of the demo, and of `random`, in which axes move, which the training does not contain.
"""

import numpy as np

import thermocomp as tc
from bench_speed import FEW, SEED, SENSORS, SPEED, Machine, fit
from thermocomp.core.reading import Reading

TESTS = (("demo", 21), ("demo", 22), ("random", 23), ("random", 24))
#: time from which the speed is missing [s]; error that is too large [um]
BEGIN, FAR = 1000.0, 5.0


def run(machine: Machine, *, missing: bool) -> str:
    """Return what the errors of a test are, as text."""
    state, errors, inside = machine.compensator.start(), list[float](), list[bool]()
    for row, now, drift in zip(machine.rows, machine.time.tolist(), machine.drift.tolist(), strict=True):
        lost = missing and now > BEGIN
        values = {name: value for name, value in row.items() if not (lost and name == SPEED)}
        state, said = machine.compensator.step(state, Reading(now, values), now)
        if now > BEGIN:
            errors.append(abs(drift + said.corrections["z_um"].offset))
            inside.append(errors[-1] <= said.half_widths.get("z_um", 0.0))
    found, step = np.array(errors), float(machine.time[1] - machine.time[0]) / 60.0
    far = step * float((found > FAR).sum())
    return (
        f"{np.sqrt(np.mean(found**2)):.2f} um RMS, worst {found.max():.1f}, over {FAR:g} um for {far:.0f} min; in the"
        f" band {np.mean(inside):.0%}"
    )


def main() -> None:
    (demo,) = tc.simulate("demo")
    for sensors in SENSORS:
        print(f"{sensors} sensors:")
        model = fit(demo, "z_um", "averaged", None if sensors == "all" else FEW)
        for name, seed in TESTS:
            (test,) = tc.simulate(name, seed=SEED + seed)
            machine = Machine.of(model, test)
            for missing in (False, True):
                print(
                    f"  {name} {seed}, {'missing' if missing else 'sound'}: {run(machine, missing=missing)}", flush=True
                )


if __name__ == "__main__":
    main()
