"""How Sphinx builds the documentation; see docs/build."""

import os
import re
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "agg")
HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))

import ngalpha_pin  # noqa: E402  (after the number of threads)

project, author = "ngalpha_pin", "The ngalpha_pin developers"
version = release = ngalpha_pin.__version__
html_title = f"ngalpha_pin {version}"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "run_blocks",
]
exclude_patterns = ["_site", "_generated"]
default_role = "code"

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence"]
myst_heading_anchors = 3

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_class_signature = "mixed"
autodoc_preserve_defaults = True
maximum_signature_line_length = 88
napoleon_use_ivar = True
napoleon_use_rtype = False
copybutton_selector = "div.highlight-python pre"

# nothing comes from the network: MathJax lies beside the pages, in one file with its fonts
mathjax_path = "mathjax/tex-svg.js"
mathjax3_config = {"svg": {"fontCache": "global"}}

html_theme, html_show_copyright, html_show_sphinx = "furo", False, False
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_extra_path = ["_generated/extra"]
(HERE / "_generated" / "extra").mkdir(parents=True, exist_ok=True)


def several_names(app, what, name, obj, options, lines):
    """`q, v: ...` of a docstring is two names: with a space between them Sphinx takes the first for a type."""
    for i, line in enumerate(lines):
        lines[i] = re.sub(r"^:(?:param|ivar) [^:]+, [^:]+:", lambda found: found[0].replace(", ", ",\u200b"), line)


def setup(app):
    """What Sphinx calls."""
    app.connect("autodoc-process-docstring", several_names, priority=900)  # behind napoleon, which makes the fields
