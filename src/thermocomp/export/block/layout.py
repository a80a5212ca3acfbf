"""State, working memory and constants of a compensator's block: the variables of `thermocomp.export.block`."""

from typing import Literal, NamedTuple

Kind = Literal["real", "time", "int", "bool"]


class Var(NamedTuple):
    """A variable or an array.

    Parameters
    ----------
    kind : {'real', 'time', 'int', 'bool'}
        ``time`` is always in double precision [s].
    about : str
        Meaning and unit.
    dims : tuple of str
        Dimensions: names of `sizes`.
    cap : bool
        Upper bound never to be exceeded: rounding makes it smaller, never larger.
    """

    kind: Kind
    about: str
    dims: tuple[str, ...] = ()
    cap: bool = False


#: variables kept between calls, initially 0
STATE = {
    "begun": Var("bool", "it was called before"),
    "clock": Var("time", "since the first call [s]"),
    "seen": Var("bool", "a reading was used"),
    "time": Var("time", "of the last reading used [s]"),
    "taken": Var("time", "when it was used [s]"),
    "origin": Var("time", "what the clock of the readings was set by [s]"),
    "known": Var("bool", "what temperatures count from is known"),
    "zero": Var("real", "what the inputs count from", ("RANGES",)),
    "begun_absolute": Var("bool", "models that count from nothing have begun"),
    "begun_rezeroed": Var("bool", "models that count from the start have begun"),
    "gathered": Var("int", "readings of the zero"),
    "resting": Var("bool", "the spindle was stopped in the first of them"),
    "gathered_at": Var("time", "when they were taken [s]", ("MOST",)),
    "gathered_value": Var("real", "what they say", ("MOST", "CHANNELS")),
    "deviation": Var("real", "of each model, within its range", ("MODELS",)),
    "lag": Var("real", "of the models", ("LAGS",)),
    "phase": Var("real", "of a clock, since its last tick [s]", ("CLOCKS",)),
    "past": Var("real", "what its value was, the last tick first", ("PASTS",)),
    "averages": Var("real", "of what it follows, over the intervals before, the last first", ("AVERAGES",)),
    "total": Var("real", "of what it follows since its last tick, by time", ("LEAVES",)),
    "correction": Var("real", "in force, at the reference position [um]", ("TARGETS",)),
    "slope": Var("real", "in force [um/m]", ("TARGETS",)),
    "idle": Var("time", "so long no model has driven it [s]", ("TARGETS",)),
    "status": Var("int", "0 starts, 1 active, 2 holding, 3 fading, 4 shadow", ("TARGETS",)),
    "rejected": Var("int", "why the reading was not used: 0 it was, 1 its time, 2 a value, 3 no start"),
    "outside": Var("int", "inputs beyond the trained range"),
    "fault": Var("int", "of each sensor: 0 good, 1 missing, 2 stepped, 3 stuck, 4 off, 5 swapped", ("SENSORS",)),
}

#: state of the temperature watch, see `thermocomp.runtime.watch.WatchState`
WATCH = {
    "looked": Var("bool", "the watch has begun"),
    "look": Var("time", "of the last look [s]"),
    "watch_zero": Var("real", "what its inputs count from", ("WATCHED",)),
    "watch_gathered": Var("int", "readings of its zero"),
    "watch_resting": Var("bool", "the spindle was stopped in the first of them"),
    "watch_gathered_at": Var("time", "when they were taken [s]", ("MOST",)),
    "watch_gathered_value": Var("real", "what they say", ("MOST", "WATCHED")),
    "memory": Var("real", "lags of the temperatures, lag by lag, and states of the speed", ("MEMORY",)),
    "traces": Var("real", "lags of the differences [degC]", ("LAGGED",)),
    "used": Var("real", "what was believed, less the zero [degC]", ("SENSORS",)),
    "predicted": Var("real", "less the zero [degC]", ("SENSORS",)),
    "usual": Var("real", "difference between reading and prediction, low-passed [degC]", ("SENSORS",)),
    "since": Var("time", "when the fault was found [s]", ("SENSORS",)),
    "bridge": Var("real", "what stands in begins so much beside the prediction [degC]", ("SENSORS",)),
    "has_jumped": Var("bool", "it jumped", ("SENSORS",)),
    "jumped": Var("time", "when [s]", ("SENSORS",)),
    "is_off": Var("bool", "it is off", ("SENSORS",)),
    "off_since": Var("time", "since when [s]", ("SENSORS",)),
    "read_once": Var("bool", "it read a number at the last look", ("SENSORS",)),
    "same": Var("real", "what it reads since `still`, less the zero [degC]", ("SENSORS",)),
    "still": Var("time", "since when it reads the same [s]", ("SENSORS",)),
    "then_predicted": Var("real", "what was predicted then [degC]", ("SENSORS",)),
    "is_moving": Var("bool", "its prediction has moved too far for that", ("SENSORS",)),
    "moving": Var("time", "since when [s]", ("SENSORS",)),
    "is_back": Var("bool", "it was missing and reads what is predicted", ("SENSORS",)),
    "back": Var("time", "since when [s]", ("SENSORS",)),
    "cleared": Var("bool", "the two are not swapped", ("PAIRS",)),
    "evidence": Var("real", "that the two are", ("PAIRS",)),
    "was_fast": Var("bool", "the spindle turned faster than in the training"),
    "fast": Var("time", "when it last did [s]"),
}

#: variables computed in every call
WORK = {
    "age": Var("time", "of the values [s]"),
    "dt": Var("time", "since the call before [s]"),
    "value": Var("real", "by channel", ("CHANNELS",)),
    "given": Var("bool", "it is a number", ("CHANNELS",)),
    "now": Var("time", "of the reading [s]"),
    "shifted": Var("time", "origin, if it is used [s]"),
    "passes": Var("bool", "the reading may be used"),
    "travel": Var("time", "time that counts for moves [s]"),
    "step": Var("time", "between this reading and the one before [s]"),
    "stands": Var("bool", "the spindle is stopped"),
    "column": Var("real", "readings, sorted", ("COLUMN",)),
    "rows": Var("int", "so many"),
    "middle": Var("real", "their median, or their mean without outliers"),
    "mean": Var("real", "of the readings of the zero", ("CHANNELS",)),
    "input": Var("real", "of the models", ("CHANNELS",)),
    "leaf": Var("real", "what a clock follows", ("LEAVES",)),
    "average": Var("real", "of it, over an interval", ("LEAVES",)),
    "next": Var("real", "what its value is at the next tick"),
    "found": Var("real", "in a table, or of a clock"),
    "place": Var("int", "in a table"),
    "excess": Var("real", "how far an input is beyond its range, in spans over which a deviation fades"),
    "distance": Var("real", "how far the inputs together are from the training; 1 is the limit"),
    "offset": Var("real", "where a correction wants to be, at the reference position [um]"),
    "tilt": Var("real", "the same, slope [um/m]"),
    "end": Var("real", "corrections at the ends of the travel [um]", ("ENDS",)),
}

#: variables of the watch computed in every call
WATCH_WORK = {
    "made": Var("bool", "what is read continues as it is"),
    "x": Var("real", "readings, less the zero [degC]", ("SENSORS",)),
    "there": Var("bool", "it reads something that a machine can have", ("SENSORS",)),
    "before": Var("real", "what it should be near [degC]", ("SENSORS",)),
    "far": Var("bool", "it is not", ("SENSORS",)),
    "stepped": Var("bool", "its jump lasts", ("SENSORS",)),
    "stuck": Var("bool", "it is", ("SENSORS",)),
    "waiting": Var("bool", "it jumped a while ago", ("SENSORS",)),
    "calm": Var("bool", "its difference can be gone by", ("SENSORS",)),
    "able": Var("bool", "it can have failed", ("SENSORS",)),
    "changed": Var("bool", "it reads something else than before", ("SENSORS",)),
    "difference": Var("real", "between reading and prediction [degC]", ("SENSORS",)),
    "change": Var("real", "of the inputs of the watch", ("WATCHED",)),
    "weighed": Var("real", "what is explained by a failure [degC]", ("SENSORS",)),
    "lasting": Var("bool", "a difference has been too large for long"),
    "failing": Var("bool", "these fail now", ("SENSORS",)),
    "onset": Var("real", "what stands in begins so much beside the prediction [degC]", ("SENSORS",)),
    "new_fault": Var("int", "what they are"),
    "one": Var("int", "sensor whose failure explains most; none is -1"),
    "one_rest": Var("real", "what it leaves"),
    "one_worst": Var("real", "the largest of what it leaves"),
    "both": Var("int", "pair whose exchange explains most; none is -1"),
    "both_rest": Var("real", "what it leaves"),
    "both_worst": Var("real", "the largest of what it leaves"),
}

#: constants of the block: numbers of the models and of the limits
TABLES = {
    "magnitude": Var("real", "largest correction [um]", cap=True),
    "rate": Var("real", "fastest change of a correction [um/s]", cap=True),
    "dead_band": Var("real", "a smaller change is none [um]"),
    "reading_age": Var("time", "older values are not used [s]"),
    "hold": Var("time", "so long a correction stays that nothing drives [s]"),
    "fade": Var("time", "time constant with which it goes to zero after that [s]"),
    "at_rest": Var("time", "the zero is averaged so long while the spindle is stopped [s]"),
    "otherwise": Var("time", "so long otherwise [s]"),
    "speed_channel": Var("int", "tells whether the spindle is stopped"),
    "channel": Var("int", "of each trained range", ("RANGES",)),
    "temperature": Var("bool", "it is one", ("RANGES",)),
    "rezero": Var("bool", "it counts from the start", ("RANGES",)),
    "reference": Var("real", "zero of the training", ("RANGES",)),
    "low": Var("real", "least trained change", ("RANGES",)),
    "high": Var("real", "greatest trained change", ("RANGES",)),
    "room": Var("real", "beyond it a value is not plausible", ("RANGES",)),
    "applies": Var("int", "that counts: 0 never, 1 once the zero is known, 2 always", ("RANGES",)),
    "bound_low": Var("real", "least change that a model follows", ("RANGES",)),
    "bound_high": Var("real", "greatest change that a model follows", ("RANGES",)),
    "least": Var("real", "that the quantity can be", ("RANGES",)),
    "most": Var("real", "that the quantity can be", ("RANGES",)),
    "span": Var("real", "of a start [degC]", ("RANGES",)),
    "set_begin": Var("int", "first of the ranges that are one model's", ("ENDS_OF_SETS",)),
    "set_range": Var("int", "which they are", ("MEMBERS",)),
    "model_rezeroed": Var("bool", "it counts from the start", ("MODELS",)),
    "line_begin": Var("int", "first model of a target", ("ENDS_OF_LINES",)),
    "to_offset": Var("real", "share of a model in the deviation", ("MODELS",)),
    "to_slope": Var("real", "share of a model in its slope", ("MODELS",)),
    "position": Var("real", "reference position [mm]", ("TARGETS",)),
    "travel_low": Var("real", "least position [mm]", ("TARGETS",)),
    "travel_high": Var("real", "greatest position [mm]", ("TARGETS",)),
    "shadow": Var("bool", "its correction stays zero", ("TARGETS",)),
    "leans_on": Var("bool", "a model needs a sensor", ("MODELS", "SENSORS")),
    "may_lose": Var("bool", "it was judged without that sensor", ("MODELS", "SENSORS")),
    "judged_model": Var("int", "was judged without several sensors", ("JUDGED",)),
    "judged_without": Var("bool", "these", ("JUDGED", "SENSORS")),
    "table_x": Var("real", "points of the tables", ("POINTS_OF_TABLES",)),
    "table_y": Var("real", "what is there", ("POINTS_OF_TABLES",)),
    "interval": Var("real", "of a clock [s]", ("CLOCKS",)),
    "past_begin": Var("int", "first of its past", ("ENDS_OF_CLOCKS",)),
    "leaf_begin": Var("int", "first of what it follows", ("ENDS_OF_CLOCKS",)),
    "average_begin": Var("int", "first of the means of that", ("ENDS_OF_CLOCKS",)),
    "member_begin": Var("int", "first of the inputs of a support", ("ENDS_OF_SUPPORTS",)),
    "member_range": Var("int", "range of an input", ("SUPPORTED",)),
    "member_low": Var("real", "least change", ("SUPPORTED",)),
    "member_high": Var("real", "greatest change", ("SUPPORTED",)),
    "member_span": Var("real", "over which a deviation fades", ("SUPPORTED",)),
    "column_begin": Var("int", "first of the inputs that count together", ("ENDS_OF_SUPPORTS",)),
    "column_range": Var("int", "range of each", ("COLUMNS",)),
    "column_weight": Var("real", "how it counts", ("COLUMNS",)),
    "points": Var("int", "training states of a support", ("SUPPORTS",)),
    "point_begin": Var("int", "where they begin", ("ENDS_OF_SUPPORTS",)),
    "point": Var("real", "training states, one after the other", ("POINTS",)),
    "speeds_begin": Var("int", "first of the speeds of a support", ("ENDS_OF_SUPPORTS",)),
    "speed_range": Var("int", "range of each", ("LEVELLED",)),
    "tolerance": Var("real", "that a speed may be off a trained one", ("LEVELLED",)),
    "level_begin": Var("int", "first of its trained values", ("ENDS_OF_LEVELS",)),
    "level": Var("real", "trained values", ("LEVELS",)),
    "sensor_channel": Var("int", "of each sensor", ("SENSORS",)),
    "sensor_input": Var("int", "of the watch", ("SENSORS",)),
    "watch_channel": Var("int", "of each input of the watch", ("WATCHED",)),
    "watch_rezero": Var("bool", "it counts from the start", ("WATCHED",)),
    "watch_reference": Var("real", "zero of the training", ("WATCHED",)),
    "start_zero": Var("real", "what a sensor reads at a start [degC]", ("SENSORS",)),
    "start_span": Var("real", "give or take [degC]", ("SENSORS",)),
    "sensor_low": Var("real", "least trained change [degC]", ("SENSORS",)),
    "sensor_high": Var("real", "greatest trained change [degC]", ("SENSORS",)),
    "sensor_span": Var("real", "beyond it a reading cannot be [degC]", ("SENSORS",)),
    "speed_input": Var("int", "of the watch", ("SPEEDS",)),
    "top_speed": Var("real", "[1/min]"),
    "pace": Var("time", "over which a jump is one [s]"),
    "tau": Var("real", "of the lags [s]", ("TAUS",)),
    "state_input": Var("int", "speed that a state follows", ("STATES",)),
    "power": Var("real", "of the share of top speed", ("STATES",)),
    "resting_rate": Var("real", "of a state [1/s]", ("STATES",)),
    "gain": Var("real", "what the rate grows by to top speed [1/s]", ("STATES",)),
    "direct": Var("real", "of the other sensors in a prediction", ("SENSORS", "SENSORS")),
    "weight": Var("real", "of the memory in a prediction", ("MEMORY", "SENSORS")),
    "off_limit": Var("real", "[degC]", ("SENSORS",)),
    "jump_limit": Var("real", "[degC]", ("SENSORS",)),
    "moved_limit": Var("real", "[degC]", ("SENSORS",)),
    "still_limit": Var("time", "[s]", ("SENSORS",)),
    "unseen": Var("real", "error of a prediction [degC]", ("SENSORS",)),
    "shape": Var(
        "real", "what a failure does to all differences, at once and in the end", ("SHAPES", "SENSORS", "SENSORS")
    ),
    "pair_first": Var("int", "of two sensors", ("PAIRS",)),
    "pair_second": Var("int", "of two sensors", ("PAIRS",)),
}
