"""An example of the API's page runs as it is read there: it imports what it uses, but for the object that it is of.

Doctest would not notice: it lends an example whatever its module has imported or defined.
"""

import ast
import builtins
import doctest
import functools
import re
import symtable
from collections.abc import Iterator
from itertools import pairwise

import pytest

from tests.test_architecture import API, BY_NAME

ENTRIES = [name.rpartition(".")[::2] for name in re.findall(r"\.\. auto\w+:: (\S+)", API)]
"""Module and name of each entry."""
PARSER = doctest.DocTestParser()


def tables(table: symtable.SymbolTable) -> Iterator[symtable.SymbolTable]:
    """A scope and those inside it."""
    yield table
    for child in table.get_children():
        yield from tables(child)


def missing(docstring: str, known: set[str]) -> set[str]:
    """Names that an example uses before it has bound them, although they are neither known nor built in."""
    known, found = known | set(dir(builtins)), set()
    for example in PARSER.get_examples(docstring):
        top = symtable.symtable(example.source, "<example>", "exec")
        names = [it for table in tables(top) for it in table.get_symbols() if table is top or it.is_global()]
        known |= {it.get_name() for it in names if it.is_assigned() or it.is_imported()}
        found |= {it.get_name() for it in names if it.is_referenced()} - known
    return found


def documented(body: list[ast.stmt]) -> Iterator[tuple[str, str, list[ast.stmt]]]:
    """What a module or a class defines: name, docstring (for data the string after it), and body if it is a class."""
    for node, after in pairwise([*body, ast.Pass()]):
        match node, after:
            case ((ast.ClassDef() | ast.FunctionDef()), _):
                inside = node.body if isinstance(node, ast.ClassDef) else []
                yield node.name, ast.get_docstring(node) or "", inside
            case (
                (ast.Assign(targets=[ast.Name(name)]) | ast.AnnAssign(target=ast.Name(name))),
                ast.Expr(ast.Constant(str(text))),
            ):
                yield name, text, []


@functools.cache
def tree(module: str) -> ast.Module:
    return ast.parse(BY_NAME[module].read_text(encoding="utf8"))


def docstrings(module: str, name: str) -> Iterator[tuple[str, str]]:
    """An entry, and what is public in it if it is a class: the title and the docstring of each."""
    for defined, text, inside in documented(tree(module).body):
        if defined == name:
            yield name, text
            members = [it for it in documented(inside) if not it[0].startswith("_")]
            yield from ((f"{name}.{inner}", inner_text) for inner, inner_text, _ in members)
            return
    for node in ast.walk(tree(module)):
        if isinstance(node, ast.ImportFrom) and name in [alias.name for alias in node.names]:
            yield from docstrings(node.module, name)
            return
    raise LookupError(f"{module} neither defines nor imports {name}, or without a docstring")


@pytest.mark.parametrize("module", dict.fromkeys(module for module, _ in ENTRIES))
def test_an_example_imports_what_it_uses(module: str) -> None:
    names = [name for where, name in ENTRIES if where == module]
    told = {title: missing(text, {name}) for name in names for title, text in docstrings(module, name)}
    assert {title: sorted(unbound) for title, unbound in told.items() if unbound} == {}, module


def test_the_examples_are_found() -> None:
    found = [text for entry in ENTRIES for _, text in docstrings(*entry) if ">>>" in text]
    assert len(found) > len(ENTRIES) / 2


@pytest.mark.parametrize(
    ("example", "unbound"),
    [
        (">>> thing(np.ones(3))\n1", {"np"}),
        (">>> import numpy as np\n>>> thing(np.ones(3))\n1", set()),
        (">>> thing(np.ones(3))\n1\n>>> import numpy as np", {"np"}),
        (">>> from torch import nn\n>>> nn.Tanh(), torch.ones(3)\n1", {"torch"}),
        (">>> [a * b for a in thing() if (c := a)], c\n1", {"b"}),
        (">>> [a for a in thing()], a\n1", {"a"}),
        (">>> def mean(xs, *, of=sum):\n...     return of(xs) / size(xs)\n>>> mean(thing)\n1", {"size"}),
        (">>> with thing() as (x, y):\n...     x.z = lambda k: k + y + w\n", {"w"}),
        (">>> for i, *rest in thing():\n...     print(f'{i} {rest} {j}')\n1", {"j"}),
        (
            ">>> class Of(Base):\n...     a = 1\n...     def b(self):\n...         return self.a + a\n",
            {"Base", "a"},
        ),
    ],
)
def test_an_omission_is_noticed(example: str, unbound: set[str]) -> None:
    assert missing(f"Do it.\n\nExample:\n{example}\n", {"thing"}) == unbound
