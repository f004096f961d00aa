"""Sphinx configuration: Markdown pages, numpydoc docstrings, no network while building."""

from importlib import metadata

project = "axialnav"
author = "The axialnav authors"
copyright = "2026, The axialnav authors"
release = metadata.version("axialnav")
version = ".".join(release.split(".")[:2])

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "numpydoc"]
myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]

html_theme = "furo"
html_title = f"axialnav {version}"

autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 100
numpydoc_show_class_members = False
