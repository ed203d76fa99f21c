"""What the book knows of its own pages: which there are, of which kind, and how much a reader meets on each.

* `contents` — core chapters and the pages of *Going deeper*, from the table of contents.
* `programs` — the program of a chapter as one file, and what the chapter changed in it; `blocks` — its parts.
* `cells` — what a stored notebook holds.
* `counts` — words, visible lines of code, statements and intervals of a page.

Only the tools, the tests and the book's extension read this; it loads nothing but the standard library and YAML.
"""
