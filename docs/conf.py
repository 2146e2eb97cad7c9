"""How `make docs` builds the pages: from the repository's root, so that links between files are links of the site."""

import tltlrl

project = "tltlrl"
author = "the tltlrl authors"
version = release = tltlrl.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
include_patterns = [
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "runs/README.md",
    "docs/*.md",
    "examples/*/README.md",
]
exclude_patterns = ["docs/package.md"]  # the page of a package index
root_doc = "docs/index"
myst_heading_anchors = 3
myst_fence_as_directive = []
autodoc_typehints = "description"
suppress_warnings = ["misc.highlighting_failure"]  # TLTL has no lexer

html_theme = "furo"
html_title = f"tltlrl {release}"
