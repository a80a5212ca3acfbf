"""What finite elements, heat and instruments must agree on: the linear axes of the virtual machining centre."""

#: names of the linear axes
AXES = ("x", "y", "z")
#: travel, from 0 [mm]
TRAVEL = {"x": 600.0, "y": 550.0, "z": 600.0}
#: where the deviations x, y, z of the tool point hold; the axes' own positioning comes on top elsewhere [mm]
TEST_POSITION = {"x": 300, "y": 250, "z": 300}
#: positions at which the machine tells the positioning of each axis [mm]
STATIONS = {"x": tuple(range(0, 601, 100)), "y": tuple(range(0, 551, 50)), "z": tuple(range(0, 601, 100))}
#: hat functions along each screw that take the heat of its nut
N_HATS = 7
