"""Configuration of the documentation: everything offline, every warning an error (see the Makefile)."""

import re
import sys
from importlib.metadata import version as version_of
from pathlib import Path

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

# Pages of modules that are gone would be read again, and fail.
listed = re.findall(r"^   (thermocomp\.\S+)$", (HERE / "reference.rst").read_text(encoding="utf-8"), re.MULTILINE)
for page in HERE.glob("reference/generated/*.rst"):
    if page.stem not in listed:
        page.unlink()

project = "thermocomp"
author = "The thermocomp maintainers"
copyright = "the thermocomp maintainers, Apache-2.0"
release = version = version_of("thermocomp")

extensions = [
    "cli_help",
    "cli_run",
    "code_table",
    "component_table",
    "paper_tables",
    "method_table",
    "verdict_table",
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "sphinx_gallery.gen_gallery",
]
# Sources of the galleries are read by sphinx-gallery, what comes of them lies in auto_examples and auto_papers.
exclude_patterns = ["_build", "tutorial", "papers"]
templates_path = ["_templates"]

# `name` in a page or a docstring is a link where it names something of thermocomp, else it is set as code.
default_role = "py:obj"
myst_heading_anchors = 2

autosummary_generate = True
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say types, shapes and units
autodoc_preserve_defaults = True
autodoc_default_options = {
    "members": True,
    "show-inheritance": True,
    # scikit-learn gives them to every estimator; their docstrings refer to its own pages
    "exclude-members": "set_fit_request, set_predict_request, set_score_request",
}
numpydoc_show_class_members = False
toc_object_entries = False

sphinx_gallery_conf = {
    "examples_dirs": ["tutorial", "papers"],
    "gallery_dirs": ["auto_examples", "auto_papers"],
    "filename_pattern": "plot_",
    "abort_on_example_error": True,
    "download_all_examples": False,
    "image_srcset": ["2x"],
    "min_reported_time": 1e6,
    "reference_url": {"thermocomp": None},
    "remove_config_comments": True,
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
}

html_theme = "pydata_sphinx_theme"
html_static_path = ["_static"]
html_css_files = ["thermocomp.css"]
html_title = f"thermocomp {release}"
html_show_sourcelink = False
html_theme_options = {
    "footer_start": ["copyright"],
    "header_links_before_dropdown": 3,  # one row on a screen of 1400 px
    "footer_end": [],
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "show_nav_level": 2,
}
# no empty sidebar beside a page without pages below it
html_sidebars = {
    page.stem: []
    for page in HERE.glob("*.*")
    if page.suffix in (".rst", ".md") and (page.stem == "index" or "toctree:" not in page.read_text("utf-8"))
}
