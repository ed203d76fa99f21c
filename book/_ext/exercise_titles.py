"""A dot divides an exercise's number from its name, in place of brackets; a solution's title has the number alone."""

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms.post_transforms import SphinxPostTransform
from sphinx_exercise.nodes import is_exercise_node, solution_node


class PlainTitles(SphinxPostTransform):
    """Rewrites the titles of a page's exercises and solutions."""

    default_priority = 23  # after sphinx-exercise's own transforms, 20 to 22

    def run(self, **kwargs: Any) -> None:
        """Rewrite them in place."""
        for solution in self.document.findall(solution_node):
            shorten(solution[0])
        for exercise in self.document.findall(is_exercise_node):
            open_brackets(exercise[0])


def open_brackets(title: nodes.title) -> None:
    """Take the brackets from around an exercise's name.

    Raises:
        ValueError: it has none.
    """
    first, last = title.children[0], title.children[-1]
    if (first.astext(), last.astext()) != (" (", ")"):
        raise ValueError(f"the exercise's title {title.astext()!r} has no brackets")
    title.remove(last)
    title.replace(first, nodes.Text("· "))  # a space follows the number


def shorten(title: nodes.title) -> None:
    """Leave of *Solution to Exercise 4.1 (Name)* what comes before the brackets.

    Raises:
        ValueError: it has none.
    """
    to, exercise = title.children
    number, bracket, *_ = exercise.children
    if bracket.astext() != " (":
        raise ValueError(f"the solution's title {title.astext()!r} has no brackets")
    exercise.children = [nodes.Text(number.astext().strip())]
    title.replace(to, nodes.Text(f"{to.astext()} "))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the transform (called by Sphinx)."""
    app.add_post_transform(PlainTitles)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
