"""What the virtual machining centre is made of: plausible engineering values, not those of a certain machine.

A horizontal machining centre, structure ``w X' b Z Y (C1) t``: the table moves along X on the bed's front, the column
along Z on its rear, the headstock along Y on the column's front, the spindle points towards -Z. A horizontal machine
is what the column differences of Chen 1996 (C-12) belong to: front minus rear bends the column in the Y-Z plane, right
minus left in the X-Y plane. Right is +X, front is -Z (towards the workpiece).

Masses times 480 to 500 J/(kg K) give the capacities, areas times 5 to 10 W/(m2 K) the convection, joints and sections
the conductances.
"""

from thermocomp.simulation.network import Link, Node

#: name, heat capacity [J/K], convection [W/K], added by rotation [W/K], height [m], side [m]
NODES: tuple[Node, ...] = (
    Node("tool", 1.5e3, 0.4, 5.0, height=1.4),
    Node("shaft", 8.0e3, 0.6, 2.0, height=1.4),
    Node("front_bearing", 2.5e3, height=1.4),
    Node("rear_bearing", 2.0e3, height=1.4),
    # Where a sensor can be: the housing round the bearing, not its ring.
    Node("front_seat", 5.0e3, 0.3, height=1.4),
    Node("rear_seat", 4.0e3, 0.3, height=1.4),
    Node("motor", 14.0e3, 3.0, 8.0, height=1.4),
    Node("housing", 17.0e3, 1.5, 1.0, height=1.4),
    Node("headstock_front", 85.0e3, 4.0, height=1.4),
    Node("headstock_rear", 115.0e3, 7.0, height=1.4),
    # The column in an upper half, where sensors sit, and a lower one, which bends it most and which nobody measures.
    Node("column_front_right", 75.0e3, 3.5, height=1.9, side=0.4),
    Node("column_front_left", 75.0e3, 3.5, height=1.9, side=-0.4),
    Node("column_rear_right", 90.0e3, 6.0, height=1.9, side=0.4),
    Node("column_rear_left", 90.0e3, 6.0, height=1.9, side=-0.4),
    Node("column_front_right_low", 95.0e3, 3.5, height=1.1, side=0.4),
    Node("column_front_left_low", 95.0e3, 3.5, height=1.1, side=-0.4),
    Node("column_rear_right_low", 115.0e3, 6.0, height=1.1, side=0.4),
    Node("column_rear_left_low", 115.0e3, 6.0, height=1.1, side=-0.4),
    Node("bed_front", 450.0e3, 12.0, height=0.5),
    Node("bed_rear", 400.0e3, 14.0, height=0.5),
    Node("bed_bottom", 600.0e3, 4.0, height=0.1),
    Node("foundation", 25.0e6, 15.0, height=0.0),
    Node("table", 220.0e3, 6.0, height=0.9),
    Node("x_screw", 4.8e3, 1.5, height=0.6),
    Node("x_nut", 2.0e3, 0.3, height=0.6),
    Node("x_bearing", 8.0e3, 1.5, height=0.6, side=0.8),
    Node("y_screw", 4.8e3, 1.5, height=1.5),
    Node("y_nut", 2.0e3, 0.3, height=1.4),
    Node("y_bearing", 8.0e3, 1.5, height=2.2),
    Node("z_screw", 5.5e3, 1.5, height=0.5),
    Node("z_nut", 2.0e3, 0.3, height=0.5),
    Node("z_bearing", 8.0e3, 1.5, height=0.5),
    Node("coolant", 210.0e3, 5.0, height=0.5),
    Node("enclosure", 45.0e3, 40.0, height=1.1),
)

#: between, and conductance [W/K]
LINKS: tuple[Link, ...] = (
    Link("tool", "shaft", 4.0),
    Link("shaft", "front_bearing", 10.0),
    Link("shaft", "rear_bearing", 5.0),
    Link("front_bearing", "front_seat", 30.0),
    Link("rear_bearing", "rear_seat", 15.0),
    Link("front_seat", "housing", 40.0),
    Link("rear_seat", "housing", 18.0),
    Link("rear_bearing", "motor", 4.0),
    Link("housing", "motor", 4.0),
    Link("housing", "headstock_front", 30.0),
    Link("motor", "headstock_rear", 14.0),
    Link("housing", "coolant", 18.0, flow=True),
    Link("motor", "coolant", 11.0, flow=True),
    # The motor hangs on the right of the headstock, near the guide.
    Link("motor", "column_front_right", 7.0),
    Link("headstock_front", "headstock_rear", 34.0),
    # The guide on the right carries the clamping unit: more contact there.
    Link("headstock_rear", "column_front_right", 26.0),
    Link("headstock_rear", "column_front_left", 15.0),
    Link("column_front_right", "column_front_left", 3.5),
    Link("column_rear_right", "column_rear_left", 3.5),
    Link("column_front_right", "column_rear_right", 3.5),
    Link("column_front_left", "column_rear_left", 3.5),
    Link("column_front_right_low", "column_front_left_low", 3.5),
    Link("column_rear_right_low", "column_rear_left_low", 3.5),
    Link("column_front_right_low", "column_rear_right_low", 3.5),
    Link("column_front_left_low", "column_rear_left_low", 3.5),
    Link("column_front_right", "column_front_right_low", 5.0),
    Link("column_front_left", "column_front_left_low", 5.0),
    Link("column_rear_right", "column_rear_right_low", 5.0),
    Link("column_rear_left", "column_rear_left_low", 5.0),
    Link("column_front_right_low", "bed_rear", 5.0),
    Link("column_front_left_low", "bed_rear", 5.0),
    Link("column_rear_right_low", "bed_rear", 5.0),
    Link("column_rear_left_low", "bed_rear", 5.0),
    Link("bed_front", "bed_rear", 15.0),
    Link("bed_front", "bed_bottom", 18.0),
    Link("bed_rear", "bed_bottom", 18.0),
    Link("bed_bottom", "foundation", 45.0),
    Link("table", "bed_front", 12.0),
    Link("x_screw", "x_nut", 6.0),
    Link("x_screw", "x_bearing", 4.0),
    Link("x_nut", "table", 7.0),
    Link("x_bearing", "bed_front", 10.0),
    Link("y_screw", "y_nut", 6.0),
    Link("y_screw", "y_bearing", 4.0),
    Link("y_nut", "headstock_rear", 4.0),
    # The drive of Y sits on the right of the column's head.
    Link("y_bearing", "column_front_right", 7.0),
    Link("y_bearing", "column_front_left", 3.0),
    Link("z_screw", "z_nut", 6.0),
    Link("z_screw", "z_bearing", 4.0),
    Link("z_nut", "column_front_right_low", 3.5),
    Link("z_nut", "column_front_left_low", 3.5),
    Link("z_bearing", "bed_rear", 10.0),
    Link("enclosure", "headstock_front", 5.0),
    Link("enclosure", "column_front_right_low", 4.0),
    Link("enclosure", "column_front_left_low", 4.0),
    Link("enclosure", "table", 7.0),
    Link("enclosure", "bed_front", 6.0),
)
