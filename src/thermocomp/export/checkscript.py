"""A script that runs test vectors through an export to a controller with a reduced model; needs plain Python only."""

KLIPPER = """
def answers(text, rows):
    numbers = dict(re.findall(r"^(temp_coeff|max_z_adjustment)\\s*[:=]\\s*(\\S+)", text, re.M))
    coefficient, most = float(numbers["temp_coeff"]), 1e3 * float(numbers["max_z_adjustment"])
    for row in rows:
        said = -1e3 * coefficient * (float(row["now_degC"]) - float(row["homing_degC"]))
        yield min(max(said, -most), most), float(row["adjustment_um"])
"""

HEIDENHAIN = """
def answers(text, rows):
    formulas = dict(re.findall(r"^([XYZ]) formula: (.*)$", text, re.M))
    for row in rows:
        formula = formulas[row["axis"]].replace("<L>", "0")
        for name, value in row.items():
            if name.endswith("_degC"):
                formula = formula.replace(f"W<{name[:-5]}>", f"({value or 0})")
        assert not re.search(r"[^-+*().0-9 ]", formula), formula
        yield -1e3 * eval(formula), float(row["correction_um"])
"""

FANUC = '''
def run(lines, numbers):
    """Run the few instructions that occur in this macro."""
    def value(words):
        words = re.sub(r"#(\\d+)", lambda m: f"numbers.get({m[1]}, None)", words.replace("#0", "None"))
        for was, becomes in (("EQ", " == "), ("NE", " != "), ("LT", " < "), ("GT", " > "), ("[", "("), ("]", ")")):
            words = words.replace(was, becomes)
        return eval(words, {"numbers": numbers})
    k = 0
    while not lines[k].startswith("M99"):
        line = re.sub(r"^N\\d+", "", lines[k])
        k += 1
        if found := re.fullmatch(r"IF(\\[.*\\])GOTO(\\d+)", line):
            if value(found[1]):
                k = next(j for j, other in enumerate(lines) if re.match(rf"N{found[2]}(\\D|$)", other))
        elif found := re.fullmatch(r"IF(\\[.*\\])THEN#(\\d+)=(.*)", line):
            if value(found[1]):
                numbers[int(found[2])] = value(found[3])
        elif found := re.fullmatch(r"#(\\d+)=(.*)", line):
            numbers[int(found[1])] = value(found[2])
        elif line:
            raise SystemExit(f"unknown: {line}")


def answers(text, rows):
    inputs = dict(re.findall(r"^\\((#\\d+): (\\w+) IN DEGC", text, re.M))
    forces = dict(re.findall(r"^\\((#\\d+): CORRECTION OF ([XYZ]) IN FORCE", text, re.M))
    lines = [re.sub(r"\\(.*?\\)", "", line).replace(" ", "") for line in text.splitlines()]
    lines = [line for line in lines if line and not re.match(r"%|O\\d", line)]
    for row in rows:
        numbers = {500: 1}
        for number in forces:
            numbers[int(number[1:])] = 0.0
        for axis, place in zip("XYZ", (5201, 5202, 5203)):
            numbers[place] = 0.0
        for number, name in inputs.items():
            value = {key.upper(): value for key, value in row.items()}[name + "_DEGC"]
            if value:
                numbers[int(number[1:])] = float(value)
        before = None
        while numbers != before:  # call until the correction no longer changes
            before = dict(numbers)
            run(lines, numbers)
        place = {axis: int(number[1:]) for number, axis in forces.items()}[row["axis"]]
        yield 1e3 * numbers[place], float(row["correction_um"])
'''

_SCRIPT = '''"""Compare {file}, or a file given as argument, with {name}_vectors.csv: exit code 0 if all agree."""

import csv
import re
import sys
from pathlib import Path

here = Path(__file__).parent
{answers}

text = Path(sys.argv[1] if len(sys.argv) > 1 else here / "{file}").read_text(encoding="utf-8")
with open(here / "{name}_vectors.csv", newline="", encoding="utf-8") as file:
    rows = list(csv.DictReader(file))
worst = wrong = 0
for row, (found, expected) in zip(rows, answers(text, rows)):
    off = abs(found - expected)
    worst = max(worst, off)
    if not off <= float(row["tolerance_um"]):
        wrong += 1
        print(f"wrong: {{row}}: found {{found:.4f}} um")
print(f"{{len(rows)}} vectors, {{wrong}} wrong; largest difference {{worst:.2g}} um")
sys.exit(1 if wrong else 0)
'''

_FILES = {KLIPPER: "cfg", HEIDENHAIN: "txt", FANUC: "nc"}


def write_script(answers: str, name: str) -> str:
    """Return the source of the Python script that runs the test vectors."""
    return _SCRIPT.format(name=name, file=f"{name}.{_FILES[answers]}", answers=answers)
