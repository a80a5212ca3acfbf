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
    "begun": Var("bool", "the block has been called before"),
    "clock": Var("time", "time since the first call [s]"),
    "seen": Var("bool", "a reading has been used"),
    "time": Var("time", "time stamp of the last reading used [s]"),
    "taken": Var("time", "time at which it was used [s]"),
    "origin": Var("time", "shift of the clock of the readings [s]"),
    "known": Var("bool", "the zero of the inputs is known"),
    "zero": Var("real", "zero of the inputs", ("RANGES",)),
    "begun_absolute": Var("bool", "models without a zero have started"),
    "begun_rezeroed": Var("bool", "models relative to the zero have started"),
    "gathered": Var("int", "number of readings collected for the zero"),
    "resting": Var("bool", "the spindle was stopped in the first of these readings"),
    "gathered_at": Var("time", "their times [s]", ("MOST",)),
    "gathered_value": Var("real", "their values", ("MOST", "CHANNELS")),
    "deviation": Var("real", "deviation of each model, within its range", ("MODELS",)),
    "lag": Var("real", "lags of the models", ("LAGS",)),
    "phase": Var("real", "time since the last tick of a clock [s]", ("CLOCKS",)),
    "past": Var("real", "previous values, the latest first", ("PASTS",)),
    "averages": Var("real", "means of its inputs over previous intervals, the latest first", ("AVERAGES",)),
    "total": Var("real", "integral of its inputs since the last tick", ("LEAVES",)),
    "correction": Var("real", "correction in force, at the reference position [um]", ("TARGETS",)),
    "slope": Var("real", "slope in force [um/m]", ("TARGETS",)),
    "idle": Var("time", "time for which no model has driven the correction [s]", ("TARGETS",)),
    "status": Var("int", "0 starts, 1 active, 2 holding, 3 fading, 4 shadow", ("TARGETS",)),
    "rejected": Var("int", "why the reading was not used: 0 it was used, 1 its time, 2 a value, 3 not a valid start"),
    "outside": Var("int", "number of inputs beyond the trained range"),
    "fault": Var("int", "state of each sensor: 0 good, 1 missing, 2 stepped, 3 stuck, 4 off, 5 swapped", ("SENSORS",)),
}

#: state of the temperature watch, see `thermocomp.runtime.watch.WatchState`
WATCH = {
    "looked": Var("bool", "the watch has started"),
    "look": Var("time", "time of its last update [s]"),
    "watch_zero": Var("real", "zero of its inputs", ("WATCHED",)),
    "watch_gathered": Var("int", "number of readings collected for its zero"),
    "watch_resting": Var("bool", "the spindle was stopped in the first of these readings"),
    "watch_gathered_at": Var("time", "their times [s]", ("MOST",)),
    "watch_gathered_value": Var("real", "their values", ("MOST", "WATCHED")),
    "memory": Var("real", "lags of the temperatures, lag by lag, and states of the speed", ("MEMORY",)),
    "traces": Var("real", "lags of the differences [degC]", ("LAGGED",)),
    "used": Var("real", "values used, relative to the zero [degC]", ("SENSORS",)),
    "predicted": Var("real", "predicted values, relative to the zero [degC]", ("SENSORS",)),
    "usual": Var("real", "difference between reading and prediction, low-passed [degC]", ("SENSORS",)),
    "since": Var("time", "time at which the fault was found [s]", ("SENSORS",)),
    "bridge": Var("real", "initial difference of the substitute value from the prediction [degC]", ("SENSORS",)),
    "has_jumped": Var("bool", "the reading has jumped", ("SENSORS",)),
    "jumped": Var("time", "time of the jump [s]", ("SENSORS",)),
    "is_off": Var("bool", "the reading is far from its prediction", ("SENSORS",)),
    "off_since": Var("time", "time since which it is [s]", ("SENSORS",)),
    "read_once": Var("bool", "the sensor had a value at the last update", ("SENSORS",)),
    "same": Var("real", "value since `still`, relative to the zero [degC]", ("SENSORS",)),
    "still": Var("time", "time since which the reading is constant [s]", ("SENSORS",)),
    "then_predicted": Var("real", "prediction at that time [degC]", ("SENSORS",)),
    "is_moving": Var("bool", "the prediction has moved too far for a constant reading", ("SENSORS",)),
    "moving": Var("time", "time since which it has [s]", ("SENSORS",)),
    "is_back": Var("bool", "a missing sensor reads its prediction again", ("SENSORS",)),
    "back": Var("time", "time since which it does [s]", ("SENSORS",)),
    "cleared": Var("bool", "the two sensors are not swapped", ("PAIRS",)),
    "evidence": Var("real", "evidence that the two sensors are swapped", ("PAIRS",)),
    "was_fast": Var("bool", "the spindle has turned faster than in training"),
    "fast": Var("time", "time at which it last did [s]"),
}

#: variables computed in every call
WORK = {
    "age": Var("time", "age of the values [s]"),
    "dt": Var("time", "time since the last call [s]"),
    "value": Var("real", "values by channel", ("CHANNELS",)),
    "given": Var("bool", "the channel has a value", ("CHANNELS",)),
    "now": Var("time", "time of the reading [s]"),
    "shifted": Var("time", "origin if the reading is used [s]"),
    "passes": Var("bool", "the reading may be used"),
    "travel": Var("time", "time available for moves of the correction [s]"),
    "step": Var("time", "time since the previous reading [s]"),
    "stands": Var("bool", "the spindle is stopped"),
    "column": Var("real", "sorted readings", ("COLUMN",)),
    "rows": Var("int", "number of readings"),
    "middle": Var("real", "their median, or their mean without outliers"),
    "mean": Var("real", "mean of the readings of the zero", ("CHANNELS",)),
    "input": Var("real", "inputs of the models", ("CHANNELS",)),
    "leaf": Var("real", "inputs of a clock", ("LEAVES",)),
    "average": Var("real", "their mean over an interval", ("LEAVES",)),
    "next": Var("real", "value at the next tick"),
    "found": Var("real", "value found in a table or of a clock"),
    "place": Var("int", "place in a table"),
    "excess": Var("real", "distance of an input from its range, in units of the span over which a deviation fades"),
    "distance": Var("real", "distance of all inputs from the training data; 1 is the limit"),
    "offset": Var("real", "demanded correction at the reference position [um]"),
    "tilt": Var("real", "demanded slope [um/m]"),
    "end": Var("real", "corrections at the ends of the travel [um]", ("ENDS",)),
}

#: variables of the watch computed in every call
WATCH_WORK = {
    "made": Var("bool", "the reading is passed on as it is"),
    "x": Var("real", "readings, relative to the zero [degC]", ("SENSORS",)),
    "there": Var("bool", "the reading is plausible", ("SENSORS",)),
    "before": Var("real", "expected value [degC]", ("SENSORS",)),
    "far": Var("bool", "the reading is far from it", ("SENSORS",)),
    "stepped": Var("bool", "the jump lasts", ("SENSORS",)),
    "stuck": Var("bool", "the sensor is stuck", ("SENSORS",)),
    "waiting": Var("bool", "the reading jumped recently", ("SENSORS",)),
    "calm": Var("bool", "the difference from the prediction is reliable", ("SENSORS",)),
    "able": Var("bool", "the sensor may have failed", ("SENSORS",)),
    "changed": Var("bool", "the reading differs from the previous one", ("SENSORS",)),
    "difference": Var("real", "difference of reading and prediction [degC]", ("SENSORS",)),
    "change": Var("real", "changes of the inputs of the watch", ("WATCHED",)),
    "weighed": Var("real", "residual to be explained by a failure [degC]", ("SENSORS",)),
    "lasting": Var("bool", "a difference has been too large for too long"),
    "failing": Var("bool", "sensors that fail now", ("SENSORS",)),
    "onset": Var("real", "initial difference of the substitute value from the prediction [degC]", ("SENSORS",)),
    "new_fault": Var("int", "their new state"),
    "one": Var("int", "sensor whose failure explains most; -1: none"),
    "one_rest": Var("real", "sum of squares of its residuals"),
    "one_worst": Var("real", "largest of its residuals"),
    "both": Var("int", "pair whose swap explains most; -1: none"),
    "both_rest": Var("real", "sum of squares of its residuals"),
    "both_worst": Var("real", "largest of its residuals"),
}

#: constants of the block: numbers of the models and of the limits
TABLES = {
    "magnitude": Var("real", "largest correction [um]", cap=True),
    "rate": Var("real", "fastest change of a correction [um/s]", cap=True),
    "dead_band": Var("real", "smaller changes are ignored [um]"),
    "reading_age": Var("time", "maximum age of the values used [s]"),
    "hold": Var("time", "time for which a correction holds after its model stopped [s]"),
    "fade": Var("time", "time constant of its return to zero after that [s]"),
    "at_rest": Var("time", "averaging time of the zero with the spindle stopped [s]"),
    "otherwise": Var("time", "averaging time of the zero otherwise [s]"),
    "speed_channel": Var("int", "channel that shows whether the spindle is stopped"),
    "channel": Var("int", "channel of each trained range", ("RANGES",)),
    "temperature": Var("bool", "the input is a temperature", ("RANGES",)),
    "rezero": Var("bool", "the input is relative to the start", ("RANGES",)),
    "reference": Var("real", "zero of the training data", ("RANGES",)),
    "low": Var("real", "smallest trained change", ("RANGES",)),
    "high": Var("real", "largest trained change", ("RANGES",)),
    "room": Var("real", "plausible distance beyond the range", ("RANGES",)),
    "applies": Var("int", "when the range applies: 0 never, 1 once the zero is known, 2 always", ("RANGES",)),
    "bound_low": Var("real", "smallest change used by a model", ("RANGES",)),
    "bound_high": Var("real", "largest change used by a model", ("RANGES",)),
    "least": Var("real", "smallest possible value of the quantity", ("RANGES",)),
    "most": Var("real", "largest possible value of the quantity", ("RANGES",)),
    "span": Var("real", "tolerance of a start [degC]", ("RANGES",)),
    "set_begin": Var("int", "first range of a model", ("ENDS_OF_SETS",)),
    "set_range": Var("int", "ranges of the models", ("MEMBERS",)),
    "model_rezeroed": Var("bool", "the model is relative to the zero", ("MODELS",)),
    "line_begin": Var("int", "first model of a target", ("ENDS_OF_LINES",)),
    "to_offset": Var("real", "factor of a model in the deviation", ("MODELS",)),
    "to_slope": Var("real", "factor of a model in the slope", ("MODELS",)),
    "position": Var("real", "reference position [mm]", ("TARGETS",)),
    "travel_low": Var("real", "smallest position [mm]", ("TARGETS",)),
    "travel_high": Var("real", "largest position [mm]", ("TARGETS",)),
    "shadow": Var("bool", "the correction stays zero", ("TARGETS",)),
    "leans_on": Var("bool", "the model needs the sensor", ("MODELS", "SENSORS")),
    "may_lose": Var("bool", "the model was judged without the sensor", ("MODELS", "SENSORS")),
    "judged_model": Var("int", "model judged without several sensors", ("JUDGED",)),
    "judged_without": Var("bool", "these sensors", ("JUDGED", "SENSORS")),
    "table_x": Var("real", "points of the tables", ("POINTS_OF_TABLES",)),
    "table_y": Var("real", "values at these points", ("POINTS_OF_TABLES",)),
    "interval": Var("real", "interval of a clock [s]", ("CLOCKS",)),
    "past_begin": Var("int", "first of its previous values", ("ENDS_OF_CLOCKS",)),
    "leaf_begin": Var("int", "first of its inputs", ("ENDS_OF_CLOCKS",)),
    "average_begin": Var("int", "first of their means", ("ENDS_OF_CLOCKS",)),
    "member_begin": Var("int", "first input of a support", ("ENDS_OF_SUPPORTS",)),
    "member_range": Var("int", "range of the input", ("SUPPORTED",)),
    "member_low": Var("real", "smallest change", ("SUPPORTED",)),
    "member_high": Var("real", "largest change", ("SUPPORTED",)),
    "member_span": Var("real", "span over which a deviation fades", ("SUPPORTED",)),
    "column_begin": Var("int", "first of the inputs of a joint support", ("ENDS_OF_SUPPORTS",)),
    "column_range": Var("int", "range of the input", ("COLUMNS",)),
    "column_weight": Var("real", "weight of the input", ("COLUMNS",)),
    "points": Var("int", "number of training states of a support", ("SUPPORTS",)),
    "point_begin": Var("int", "first of these states", ("ENDS_OF_SUPPORTS",)),
    "point": Var("real", "training states, one after another", ("POINTS",)),
    "speeds_begin": Var("int", "first speed of a support", ("ENDS_OF_SUPPORTS",)),
    "speed_range": Var("int", "range of the speed", ("LEVELLED",)),
    "tolerance": Var("real", "tolerance of a trained speed", ("LEVELLED",)),
    "level_begin": Var("int", "first of its trained values", ("ENDS_OF_LEVELS",)),
    "level": Var("real", "trained values", ("LEVELS",)),
    "sensor_channel": Var("int", "channel of each sensor", ("SENSORS",)),
    "sensor_input": Var("int", "input of the watch", ("SENSORS",)),
    "watch_channel": Var("int", "channel of each input of the watch", ("WATCHED",)),
    "watch_rezero": Var("bool", "the input is relative to the start", ("WATCHED",)),
    "watch_reference": Var("real", "zero of the training data", ("WATCHED",)),
    "start_zero": Var("real", "expected reading of a sensor at a start [degC]", ("SENSORS",)),
    "start_span": Var("real", "tolerance of that [degC]", ("SENSORS",)),
    "sensor_low": Var("real", "smallest trained change [degC]", ("SENSORS",)),
    "sensor_high": Var("real", "largest trained change [degC]", ("SENSORS",)),
    "sensor_span": Var("real", "plausible distance beyond the trained range [degC]", ("SENSORS",)),
    "speed_input": Var("int", "input of the watch", ("SPEEDS",)),
    "top_speed": Var("real", "largest trained speed [1/min]"),
    "pace": Var("time", "time within which a change is a jump [s]"),
    "tau": Var("real", "time constants of the lags [s]", ("TAUS",)),
    "state_input": Var("int", "speed followed by a state", ("STATES",)),
    "power": Var("real", "exponent of the fraction of top speed", ("STATES",)),
    "resting_rate": Var("real", "rate of a state at standstill [1/s]", ("STATES",)),
    "gain": Var("real", "increase of the rate up to top speed [1/s]", ("STATES",)),
    "direct": Var("real", "weights of the other sensors in a prediction", ("SENSORS", "SENSORS")),
    "weight": Var("real", "weights of the memory in a prediction", ("MEMORY", "SENSORS")),
    "off_limit": Var("real", "limit of a lasting difference [degC]", ("SENSORS",)),
    "jump_limit": Var("real", "limit of a jump [degC]", ("SENSORS",)),
    "moved_limit": Var("real", "limit of the prediction's change while a reading is constant [degC]", ("SENSORS",)),
    "still_limit": Var("time", "longest constant reading [s]", ("SENSORS",)),
    "unseen": Var("real", "error of a prediction on unseen cycles [degC]", ("SENSORS",)),
    "shape": Var(
        "real", "effect of a failure on all differences, immediate and final", ("SHAPES", "SENSORS", "SENSORS")
    ),
    "pair_first": Var("int", "first sensor of a pair", ("PAIRS",)),
    "pair_second": Var("int", "second sensor of a pair", ("PAIRS",)),
}
