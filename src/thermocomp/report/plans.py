"""The figure of a plan: what each test would bring, and how the error falls with what was learned from."""

from matplotlib.figure import Figure

from thermocomp.assessment.learningcurve import LearningCurve
from thermocomp.assessment.planning import Plan
from thermocomp.report.drawing import Drawn, add_legend, drawing, name_ticks, svg


def draw(plan: Plan, curve: LearningCurve | None) -> Drawn:
    """Draw the tests that could be run next, and beside them the learning curve if there is one.

    Parameters
    ----------
    plan : Plan
    curve : LearningCurve or None

    Returns
    -------
    Drawn
    """
    with drawing("plan"):
        figure = Figure(figsize=(9.6, 1.4 + 0.22 * len(plan.candidates)), layout="constrained")
        axes = figure.subplots(1, 2 if curve else 1, squeeze=False)[0]
        tests = axes[0]
        tests.barh(range(len(plan.candidates)), [c.gain for c in plan.candidates], color="#1f77b4", height=0.7)
        name_ticks(tests.yaxis, [c.trial.words for c in plan.candidates], fontsize=7)
        tests.invert_yaxis()
        tests.set_xlabel("expected to take off the error [um]")
        tests.set_title(f"next test (expected error now {plan.expected:.2f} um)")
        if curve is not None:
            levels = curve.by_cycles()
            learned = axes[1]
            learned.plot([p.learned for p in curve.points], [p.rms for p in curve.points], ".", color="#bbbbbb")
            learned.errorbar(
                [x.learned for x in levels], [x.rms for x in levels], [x.error for x in levels], marker="o", capsize=2,
                label=f"{curve.model}, mean and its standard error",
            )  # fmt: skip
            learned.axhline(curve.none, color="#999999", ls="--", lw=0.8, label="no compensation")
            learned.set_ylim(bottom=0)
            learned.set_xlabel("thermal cycles learned from")
            learned.set_ylabel("error on an unseen cycle [um RMS]")
            learned.set_title("how much is enough")
            add_legend(learned)
        return svg(figure)
