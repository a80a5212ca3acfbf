"""Parameters that belong to the machine and not to the program (LinuxCNC and Fanuc)."""

from thermocomp.nc.parser.line import Controller

# first and last number, meaning
_LINUXCNC = (
    (5061, 5070, "result of a probe move (G38)"),
    (5161, 5169, "home position of G28"),
    (5181, 5189, "home position of G30"),
    (5210, 5219, "offset of G92 or G52"),
    (5220, 5220, "number of the work coordinate system"),
    (5221, 5390, "origin or rotation of a work coordinate system (G54 to G59.3)"),
    (5399, 5399, "result of M66"),
    (5400, 5413, "data of the tool in the spindle"),
    (5420, 5428, "present position"),
    (5600, 5601, "fault of the tool changer"),
)
_FANUC = (
    (1000, 1199, "interface signal of the machine"),
    (2000, 2999, "tool or work offset of the machine"),
    (3000, 3999, "alarm, clock, stop, or setting of the machine"),
    (4000, 4999, "modal state"),
    (5001, 5020, "end point of the previous block"),
    (5021, 5060, "present position"),
    (5061, 5080, "result of a skip move (G31)"),
    (5081, 5200, "tool offset in force"),
    (5201, 5349, "origin of a work coordinate system"),
    (7001, 7999, "origin of a work coordinate system (G54.1)"),
)
_NAMED = {
    **{f"_{frame}{axis}": "present position" for frame in ("", "abs_") for axis in "xyzabcuvw"},
    **dict.fromkeys(
        (
            *("_motion_mode", "_plane", "_ccomp", "_metric", "_imperial", "_absolute", "_incremental"),
            *("_inverse_time", "_units_per_minute", "_units_per_rev", "_coord_system", "_tool_offset"),
            *("_retract_r_plane", "_retract_old_z", "_spindle_rpm_mode", "_spindle_css_mode", "_ijk_absolute_mode"),
            *("_lathe_diameter_mode", "_lathe_radius_mode", "_spindle_on", "_spindle_cw", "_mist", "_flood"),
            *("_speed_override", "_feed_override", "_adaptive_feed", "_feed_hold", "_feed", "_rpm"),
        ),
        "modal state",
    ),
    **dict.fromkeys(("_current_tool", "_current_pocket", "_selected_tool", "_selected_pocket"), "tool of the machine"),
    **dict.fromkeys(("_value", "_value_returned"), "return value of a subroutine"),
    **dict.fromkeys(
        ("_vmajor", "_vminor", "_line", "_task", "_call_level", "_remap_level"), "state of the interpreter"
    ),
}


def machine_meaning(key: int | str, controller: Controller = "linuxcnc") -> str:
    """Return the meaning of a parameter of the machine; empty if it belongs to the program."""
    if isinstance(key, str):
        if key.startswith(("_ini[", "_hal[")):
            return "a setting or signal of the machine"
        return _NAMED.get(key, "")
    for first, last, meaning in _LINUXCNC if controller == "linuxcnc" else _FANUC:
        if first <= key <= last:
            return meaning
    if controller == "linuxcnc":
        return "" if key <= 5000 or key == 5599 else "reserved by LinuxCNC"
    return "" if key < 1000 else "system variable of the control"


def explain_unset(key: int | str, controller: Controller = "linuxcnc") -> str:
    """Return the reason why an unset parameter is unknown, such as 'present position, which only the machine knows'."""
    if meaning := machine_meaning(key, controller):
        return f"{meaning}, which only the machine knows"
    return "the program has not set it before"
