"""Answers of the page as they are described in ``/openapi.json``; unknown numbers are null."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

#: a number that may be unknown
Number = float | None
#: machine time, in seconds since 1970
Time = Annotated[float, Field(description="machine time, seconds since 1970")]


class AnswerPart(BaseModel):
    """An answer, or a part of it: a description only, answers are not built from it."""

    model_config = ConfigDict(extra="forbid")


class Overall(AnswerPart):
    """State of the whole service: that of the target that is worst off, or an alarm."""

    word: str
    reason: str


class AtControllerAnswer(AnswerPart):
    """What is known of a correction at the controller."""

    state: Literal["confirmed", "sent, not confirmed", "not confirmed", "not sent", "no sink"]
    reason: str
    correction_um: Number
    age_s: Annotated[Number, Field(description="real time since the confirmation")]


class ReferenceAnswer(AnswerPart):
    """Zero (reference reading) of a target."""

    time: Time
    why: str


class TargetAnswer(AnswerPart):
    """A target: its state with the reason, its predicted deviation, its correction."""

    name: str
    state: Annotated[str, Field(description="active, holding, ...: see the page on live compensation")]
    reason: str
    at_controller: AtControllerAnswer
    deviation_um: Number
    half_width_um: Annotated[Number, Field(description="half-width of the uncertainty band")]
    correction_um: Number
    slope_um_per_m: Number
    reference_position_mm: Number
    axis_travel_mm: list[float]
    minutes_until_settled: Number
    settling: str
    reference: ReferenceAnswer | None
    probed: bool
    runs: Annotated[bool, Field(description="false: its model must not run, it is only observed")]


class SensorAnswer(AnswerPart):
    """A channel that was received."""

    name: str
    value: Number
    age_s: Number
    state: Annotated[str, Field(description="good, not watched, unchanged, stale, or the fault")]


class LinkAnswer(AnswerPart):
    """A source, probe or sink."""

    kind: Literal["source", "probe", "sink"]
    name: str
    state: Literal["closed", "connecting", "connected", "failed"]
    reason: str
    replaced: Annotated[int, Field(description="values replaced by newer ones before they were used")]


class Counts(AnswerPart):
    """Readings since the start."""

    readings: int
    rejected: int


class ResidualAnswer(AnswerPart):
    """A probing compared with the prediction."""

    time: Time
    target: str
    predicted: Annotated[Number, Field(description="at the probed position, before the probing is used [um]")]
    residual: Annotated[Number, Field(description="measured minus predicted [um]")]
    limit: Annotated[Number, Field(description="action limit [um]")]
    refused: Annotated[str, Field(description="why the probing was not used; empty if it was")]


class EventAnswer(AnswerPart):
    """An event, the newest first."""

    time: Time
    kind: str
    text: str


class StateAnswer(AnswerPart):
    """State of the service."""

    time: Time
    state: Overall
    alarms: list[str]
    speed: Annotated[float, Field(description="time-lapse factor; 1 for a real machine")]
    settled_um: float
    targets: list[TargetAnswer]
    sensors: list[SensorAnswer]
    missing: Annotated[list[str], Field(description="failed channels that were never received")]
    left_out: Annotated[int, Field(description="further channels that were received, and are not used")]
    links: list[LinkAnswer]
    counts: Counts
    rejected: Annotated[str, Field(description="why the last reading was rejected; empty if it was used")]
    residuals: list[ResidualAnswer]
    events: list[EventAnswer]


class DoneAnswer(AnswerPart):
    """A command that was carried out."""

    done: str
    target: str


class RefusedAnswer(AnswerPart):
    """Why a request was refused."""

    detail: str


def describe(*refusals: int, answer: Any = None) -> dict[int | str, dict[str, Any]]:
    """Return the description of the answers of a route, for ``responses``.

    Parameters
    ----------
    *refusals : int
        Status codes with which a request is refused, in addition to that for other names (400).
    answer : type, optional
        Type of the answer 200.
    """
    own: dict[int | str, dict[str, Any]] = {} if answer is None else {200: {"model": answer}}
    return own | {code: {"model": RefusedAnswer, "description": _REFUSED[code]} for code in (400, *refusals)}


_REFUSED = {
    400: "another host name, or no JSON",
    401: "the token is wrong",
    403: "the page of another site, or no token is configured",
    404: "unknown target",
    409: "not possible now",
    413: "too large",
    422: "not a command",
    429: "too many wrong tokens",
}
