"""What the book knows of its own pages: which there are, of which kind, and how much a reader meets on each.

* `contents` — core chapters and the pages of *Going deeper*, from the table of contents.
* `programs` — the program of a chapter as one file, and what the chapter changed in it; `blocks` — its parts.
* `cells` — what a stored notebook holds; `glue` — the numbers that a page takes from another.
* `counts` — words, visible lines of code, statements and intervals of a page.
* `plans` — the plans of *Teach it* and the courses; `graded` — which exercises a grader marks.
* `citing` — how to cite the book, and how to clone it.

The book's extension, the tools, the tests and `inbounds grade` read this, and the pages that show a program; it loads
nothing but the standard library and YAML.
"""
