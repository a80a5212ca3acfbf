"""Damaged files of models, machines, jobs and mappings, drawn by lot: as an accident leaves them, and as somebody who
can sign them again would make them.
"""

import json
import random
from collections.abc import Iterator
from copy import deepcopy
from typing import Any

from thermocomp.files import jsonfile

Keys = tuple[str | int, ...]


def split(words: str) -> list[str]:
    return words.split()


#: words that may stand in place of anything
WORDS = split("1.0 yes nan K banana temperatur temperature um urad/m^3 polynomial network spline accepted fade")
NUMBERS = (0, 1, -1, 2, 7, 10**6, 10**17, -(10**17), 0.0, -0.0, 0.5, 1.0, -1.5, 5e-324, 1e-300, 1e-12, 1e9, 1e15)
LARGE = (1.0001e15, 1e100, 1e308, -1.7e308)
LISTS: tuple[Any, ...] = ([], {}, [[]], [None], [0.0], [1, 2], ["a"], {"a": 1}, [[0, 1.0]], [1e308] * 3)
TABLES: tuple[Any, ...] = ({"family": "polynomial"}, [{"kind": "spline"}])
TEXTS = ("", " ", "a\nb", "\x1b[2J", "\u202ereversed", "x" * 300)
STRANGE: tuple[Any, ...] = (None, True, False, *WORDS, *NUMBERS, *LARGE, *LISTS, *TABLES, *TEXTS)
#: what may stand in a text in place of a number or a word
LITERALS = (
    *split("NaN Infinity -Infinity 1e999 -1e999 tru nul 'a' 0x10 1_000 --1 // inf nan [1,]"),
    *("9" * 19, "9" * 5000, "-" + "9" * 4301, "0." + "0" * 5000 + "1"),
    *('"\\ud800"', '"\\udfff x"', '"\\u0000"', '"\t"', "\x00", "", "1 1", '{"a": 1, "a": 1}'),
    *("[" * 200 + "]" * 200, "[" * 60_000, '{"a":' * 3000 + "1" + "}" * 3000),
)


def places(tree: Any, path: Keys = ()) -> Iterator[Keys]:
    """Give the way to everything in a tree."""
    if path:
        yield path
    inner = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in inner:
        yield from places(value, (*path, key))


def at(tree: Any, path: Keys) -> Any:
    for key in path:
        tree = tree[key]
    return tree


def spoil_tree(tree: Any, lot: random.Random) -> None:
    """Damage a tree in one place or a few."""
    for _ in range(lot.choice((1, 1, 1, 2, 3))):
        known = list(places(tree))
        if not known:
            return
        path = lot.choice(known)
        parent, value = at(tree, path[:-1]), at(tree, path)
        match lot.randrange(7):
            case 0 | 1:
                parent[path[-1]] = lot.choice(STRANGE)
            case 2:
                parent[path[-1]] = _of_another_type(value, lot)
            case 3:
                del parent[path[-1]]
            case 4:
                parent[path[-1]] = deepcopy(at(tree, lot.choice(known)))
            case 5 if isinstance(parent, dict):
                parent[lot.choice(("more", "famly", "", "\x1b", "unit", "x" * 500))] = lot.choice(STRANGE)
            case 5:
                parent.insert(lot.randint(0, len(parent)), deepcopy(value))
            case 6 if isinstance(value, list):
                parent[path[-1]] = value * lot.choice((2, 50))


def _of_another_type(value: Any, lot: random.Random) -> Any:
    """Return what looks alike, or another number."""
    if isinstance(value, str):
        return [value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return json.dumps(value)
    return lot.choice((str(value), float(value), value * 10.0 ** lot.randint(-320, 300), -value, value + 1))


def sign(content: Any) -> str:
    """Return the text of a file whose checksum fits, as somebody would write it who knows how."""
    if isinstance(content, dict) and isinstance(content.get("models"), list):
        try:
            shared = {k: content[k] for k in jsonfile.MODELS.shared if k in content}
            content["sha256"] = jsonfile.digest(content["models"], shared)
        except ValueError:  # an infinity: it has no checksum
            content["sha256"] = ""
    return json.dumps(content)


def spoil_text(text: str, lot: random.Random) -> bytes:
    """Damage a text as an accident, an editor or a bad cable does."""
    raw = bytearray(text.encode())
    match lot.randrange(7):
        case 0:
            for _ in range(lot.randint(1, 4)):
                raw[lot.randrange(len(raw))] ^= 1 << lot.randrange(8)
        case 1:
            del raw[lot.randrange(len(raw)) :]
        case 2:
            a, b = sorted(lot.randrange(len(raw)) for _ in range(2))
            del raw[a : min(b, a + 40)]
        case 3:
            a = lot.randrange(len(raw))
            raw[a:a] = raw[a : a + lot.choice((1, 20, 500))]
        case 4:
            a = lot.randrange(len(raw))
            raw[a : a + lot.choice((0, 1, 3))] = bytes(lot.randrange(256) for _ in range(lot.choice((1, 5))))
        case 5:
            words = text.split(" ")
            a, b = lot.randrange(len(words)), lot.randrange(len(words))
            words[a], words[b] = words[b], words[a]
            return " ".join(words).encode()
        case 6:
            words = text.split(" ")
            a = lot.randrange(len(words))
            tail = words[a][len(words[a].rstrip(",\n]}")) :]
            words[a] = lot.choice(LITERALS) + tail
            return " ".join(words).encode()
    return bytes(raw)


def spoil_json(text: str, lot: random.Random) -> bytes:
    """Return a damaged file of models."""
    if lot.random() < 0.3:
        return spoil_text(text, lot)
    content = json.loads(text)
    whole = lot.random() < 0.05
    spoil_tree(content if whole else content["models"], lot)
    signed = sign(content)
    if lot.random() < 0.15:  # what no tree can hold, below a checksum that fits the rest
        marks = [k for k, c in enumerate(signed) if c in ":,["]
        k = lot.choice(marks) + 1
        signed = signed[:k] + lot.choice((*LITERALS, '"unit": "um",', '{"x":1},')) + signed[k:]
    return signed.encode("utf-8", "surrogatepass")


def spoil_toml(text: str, lot: random.Random) -> bytes:
    """Return a damaged TOML file."""
    if lot.random() < 0.4:
        return spoil_text(text, lot)
    lines = text.splitlines()
    for _ in range(lot.choice((1, 1, 2, 4))):
        k = lot.randrange(len(lines))
        (key, _, value), (other, _, another) = lines[k].partition("="), lot.choice(lines).partition("=")
        strange = lot.choice(TOML)
        became = (
            *(f"{key}= {strange}", f"{other}={value}", f"{key}={another}", f"{lot.choice(TOML_KEYS)} = {strange}"),
            *(f"{lines[k]}\n{lines[k]}", ""),
        )
        lines[k] = lot.choice(became)
    return ("\n".join(lines) + "\n").encode()


TOML = (
    *split("""1 1.0 "1.0" true "yes" inf -inf nan 1e999 [] {} [1,2] "" 'a' -0.0 "\\u0000" "\\u001b[2J" "XXX" """),
    *split("""2024-03-01 12:00:00 2024-03-01T08:00:00Z {model="."} {model="none.json"} {model="\\u0000"}"""),
    '{model="drift.json"}',
    *('"/dev/zero"', '{model="/dev/zero"}', "9" * 30, "9" * 5000, '"' + "x" * 5000 + '"'),
    *("[" * 40 + "]" * 40, "[" * 2000 + "]" * 2000, "{a=" * 40 + "1" + "}" * 40),
    *('["0 mm", "1e300 mm"]', '["0 mm", "inf mm"]', '"1e999 mm"', '"12 banana"', '"12 um"', '"w X\' b Z Y (C1) t"'),
    '{profile = [["0 mm", "0 um"], ["1e9 mm", "1e9 um"]]}',
    '{profile = [["0 mm", "0 um"], ["1e-320 mm", "1 um"]]}',
)
TOML_KEYS = (
    *("a." * 50 + "b", '"\\u001b"', '""', "a.b.c", "name", "[components]\nEXX"),
    *("[axes.X]\nb", "[[axes]]\nb", "[columns.a.b]\nc"),
)
