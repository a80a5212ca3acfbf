"""The scripts of a page that draw its curves; nothing else on a page may be a script."""

import re
from importlib.resources import files

STATIC = files("thermocomp.report") / "static"


def without_scripts(page: str) -> str:
    """Return a page without the curves' scripts as they are in the package, and without their data."""
    for name in ("uplot.min.js", "uplot.LICENSE", "curves.js"):
        page = page.replace((STATIC / name).read_text(encoding="utf-8").rstrip("\n"), "")
    data = r'<script type="application/json"(?: id="words")?>[^<>&]*</script>'
    return re.sub(rf"<script>\s*(/\*\s*\*/)?\s*</script>|{data}", "", page)
