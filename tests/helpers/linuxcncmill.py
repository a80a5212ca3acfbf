"""The configuration of a small LinuxCNC mill, as files: a drive per joint, encoders, a signal that others use too."""

from pathlib import Path

INI = """# a mill
[EMC]
VERSION = 1.1
[HAL]
HALFILE = mill.hal
[TRAJ]
COORDINATES = X Y Z
LINEAR_UNITS = mm
[KINS]
KINEMATICS = trivkins coordinates=XYZ
JOINTS = 3
[EMCMOT]
SERVO_PERIOD = 1000000
"""
AXIS = """[AXIS_{name}]
MIN_LIMIT = -200
MAX_LIMIT = 100
MAX_VELOCITY = 80
MAX_ACCELERATION = 800
OFFSET_AV_RATIO = 0.1
"""
HAL = """# read, plan, control, write
loadrt [KINS]KINEMATICS
loadrt motmod servo_period_nsec=[EMCMOT]SERVO_PERIOD num_joints=[KINS](JOINTS)
loadrt sum2 count=2
loadrt mux2 names=a,b
addf board.read servo-thread
addf motion-command-handler servo-thread
addf motion-controller servo-thread
addf board.write servo-thread
net z-cmd joint.2.motor-pos-cmd => \\
    board.2.command
net z-fb board.2.feedback => joint.2.motor-pos-fb
net x-loop joint.0.motor-pos-cmd => joint.0.motor-pos-fb
net enabled motion.motion-enabled => board.enable
"""


def write_linuxcnc_mill(folder: Path, ini: str = "", hal: str = "") -> Path:
    """Write it, with lines of one's own at the end, and return the INI."""
    folder.mkdir(exist_ok=True)
    text = INI + "".join(AXIS.format(name=name) for name in "XYZ") + ini
    (folder / "mill.ini").write_text(text, encoding="ascii")
    (folder / "mill.hal").write_text(HAL + hal, encoding="ascii")
    return folder / "mill.ini"
