"""Count lines of code by package ("room"), as printed by `make count`."""

import ast
import io
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
#: in addition to Python: hand-written files that are shipped or run
OTHER = {".toml", ".html", ".j2", ".css", ".js", ".c", ".h", ".st", ".hal", ".ini", ".svg", ".sh"}


def docstring_lines(tree: ast.AST) -> set[int]:
    """Return the numbers of the lines that docstrings take."""
    found: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and node.body:
            first = node.body[0]
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                found.update(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    return found


def code_lines(text: str) -> int:
    """Return how many lines of Python are neither docstring, comment nor blank."""
    skipped = docstring_lines(ast.parse(text))
    nothing = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in nothing:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - skipped)


def files() -> Iterator[tuple[str, Path]]:
    """Yield every counted file and its room."""
    package = ROOT / "src" / "thermocomp"
    for path in sorted(p for top in (package, ROOT / "tools") for p in top.rglob("*") if p.is_file()):
        inside = path.is_relative_to(package)
        parts = path.relative_to(package if inside else ROOT).parts
        if "__pycache__" not in parts and (path.suffix == ".py" or path.suffix in OTHER):
            yield (parts[0] if len(parts) > 1 or not inside else "top"), path


def main() -> None:
    """Print the table."""
    rooms: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0, 0])
    for room, path in files():
        text = path.read_text(encoding="utf-8")
        everything = len(text.splitlines())
        python = path.suffix == ".py"
        code = code_lines(text) if python else sum(bool(line.strip()) for line in text.splitlines())
        for k, number in enumerate((1, everything, code if python else 0, 0 if python else code)):
            rooms[room][k] += number
    print(f"{'room':12} {'files':>6} {'lines':>8} {'code':>8} {'other':>8}")
    for room, numbers in sorted(rooms.items(), key=lambda item: -item[1][2]):
        print(f"{room:12} {numbers[0]:6} {numbers[1]:8,} {numbers[2]:8,} {numbers[3]:8,}")
    whole = [sum(numbers) for numbers in zip(*rooms.values(), strict=True)]
    print(f"{'all':12} {whole[0]:6} {whole[1]:8,} {whole[2]:8,} {whole[3]:8,}")


if __name__ == "__main__":
    main()
