"""The main workflow in forty lines, from a recording to the correction of an axis: ``python examples/main_path.py``."""

import asyncio
from pathlib import Path
from tempfile import TemporaryDirectory

import thermocomp as tc
from thermocomp.files import modelfile
from thermocomp.live.adapters.plain import FileSink
from thermocomp.runtime.compensator import Compensator


async def main() -> float:
    """Fit a model to recordings and correct another day with it; return the largest remaining error [um]."""
    with TemporaryDirectory() as folder:
        # virtual/verbs.py; for a file tc.read("drift.csv"), api/inputs.py
        *days, new_day = tc.simulate("wessel-milling")
        # api/verbs.py, judging/compare.py; the do-no-harm gate: judging/do_no_harm.py
        found = tc.compare(days, "s1_um", ["ols", "mra"], leave_one="file", jobs=1)
        print(found)
        best = found.best["s1_um"]  # "ols": models/ols.py
        assert best is not None, "no model may run"
        fitted = tc.fit(days, "s1_um", best, leave_one="file", jobs=1)  # judging/study.py; freeze(): models/base.py
        path = fitted.save(Path(folder) / "model.json")  # files/modelfile.py
        print(tc.assess(path, new_day))  # a replay, as at the machine: judging/replay.py, runtime/batch.py

        (model,) = modelfile.read(path)  # files/modelfile.py; an ErrorModel: core/model.py
        compensator = Compensator.of([model], tc.Limits(rate=1.0))  # runtime/compensator.py
        sink = FileSink(path=Path(folder) / "corrections.json")  # live/adapters/plain.py; the ports: core/ports.py
        await sink.connect(timeout=1.0)
        state, left = compensator.start(), []  # all memory is in `state`: runtime/state.py
        names = [i.name for i in model.inputs]
        # watch, gate, zero, model, change of sign (only in core/correction.py), limits: runtime/compensator.py
        for time, row in zip(new_day.time, new_day.table.to_dict("records"), strict=True):
            reading = tc.Reading(float(time), {name: row[name] for name in names})  # core/reading.py
            state, result = compensator.step(state, reading, now=float(time))
            await sink.apply(result.corrections)
            left.append(row["s1_um"] - new_day.table["s1_um"].iloc[0] + result.corrections["s1_um"].offset)
        await sink.close()
        return float(max(map(abs, left)))


if __name__ == "__main__":
    print(f"at most {asyncio.run(main()):.1f} um of error remain on the new day")
