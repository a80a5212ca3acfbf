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

MACRO = '''
def run(lines, numbers):
    """Run the few instructions that occur in this macro."""
    def value(words):
        words = re.sub(r"#\\d+|[A-Z]+\\d+", lambda m: f"numbers.get('{m[0]}')", words)
        signs = {" EQ ": "==", " NE ": "!=", " LT ": "<", " GT ": ">", " LE ": "<=", " GE ": ">=", "[": "(", "]": ")"}
        for word, sign in signs.items():
            words = words.replace(word, sign)
        return eval(words, {"numbers": numbers, "ROUND": round})
    k = 0
    while lines[k] not in ("M99", "RTS"):
        line = re.sub(r"^N\\d+ ?", "", lines[k])
        k += 1
        if found := re.fullmatch(r"IF \\[(.*)\\] (GOTO|N)(\\d+)", line):
            if value(found[1]):
                k = next(j for j, other in enumerate(lines) if re.match(rf"N{found[3]}( |$)", other))
        elif found := re.fullmatch(r"([^ =]+)=(.*)", line):
            numbers[found[1]] = value(found[2])
        elif line:
            raise SystemExit(f"unknown: {line}")


def answers(text, rows):
    inputs = {name: place for place, name in re.findall(r"^\\((\\S+): (\\w+) IN DEGC", text, re.M)}
    [on] = re.findall(r"^\\((\\S+): 1 IS ON", text, re.M)
    missing = None if on.startswith("#") else 999.0
    moved, lines = {}, []
    for line in re.sub(r"(VZOF.)\\[(\\d+)\\]", r"\\1\\2", text).splitlines():
        if found := re.match(r"\\((\\S+): CORRECTION OF ([XYZ]) IN FORCE", line):
            moved[axis := found[2]] = [found[1]]
        line = re.sub(r"\\(.*?\\)", "", line).strip()
        if found := re.match(r"(#5\\d\\d\\d|VZOF.\\d+)=", line):
            moved[axis].append(found[1])
        if line and not re.match(r"%|O\\d", line):
            lines.append(line)
    for row in rows:
        numbers = {on: 1.0, **{place: 0.0 for places in moved.values() for place in places}}
        named = {key.upper(): value for key, value in row.items()}
        for name, place in inputs.items():
            value = named[name + "_DEGC"] or missing
            if value is not None:
                numbers[place] = float(value)
        before = None
        while numbers != before:  # call until the correction no longer changes
            before = dict(numbers)
            run(lines, numbers)
        wanted = float(row["correction_um"])
        yield max((1e3 * numbers[place] for place in moved[row["axis"]]), key=lambda um: abs(um - wanted)), wanted
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


def write_script(answers: str, name: str, ending: str) -> str:
    """Return the source of the Python script that runs the test vectors of the file with an ending."""
    return _SCRIPT.format(name=name, file=f"{name}.{ending}", answers=answers)
