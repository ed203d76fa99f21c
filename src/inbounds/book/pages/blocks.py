"""A program as its top-level blocks, so that a chapter can replace some of them and add others.

A block is a definition or an assignment with the comments above it; its name is what it defines. Imports are no
blocks: those of all chapters are joined, sorted once, and left out where nothing uses them.
"""

from __future__ import annotations

import ast
import difflib
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

Import = tuple[str, str, str]
"""Module, name in it (empty for a plain ``import``), and the name that it gets here (empty: its own)."""
ANCHOR = "train"
"""The block before which a new one goes, where the cell itself says nothing of its place."""
IMPORTS = "imports"
DEFINED = re.compile(r"^(?:async def|def|class) ", re.M)


@dataclass(frozen=True)
class Program:
    """A program in parts."""

    imports: frozenset[Import] = frozenset()
    blocks: Mapping[str, str] = field(default_factory=dict)
    """Name → source, in the program's order."""


def parts(source: str) -> Program:
    r"""Take a piece of a program apart.

    Args:
        source: imports, definitions and assignments.

    Raises:
        ValueError: another statement stands at its top level.

    Example:
        >>> parts("import math\n\ndef half(x):\n    return x / 2\n").blocks
        {'half': 'def half(x):\n    return x / 2'}
    """
    imports: set[Import] = set()
    blocks, lines, start = {}, source.splitlines(), 0
    for node in ast.parse(source).body:
        text = "\n".join(lines[start : node.end_lineno]).strip("\n")  # with the comments above it
        start = node.end_lineno or 0
        if isinstance(node, ast.Import):
            imports |= {(alias.name, "", alias.asname or "") for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imports |= {(node.module or "", alias.name, alias.asname or "") for alias in node.names}
        else:
            blocks[_name_of(node)] = text
    return Program(frozenset(imports), blocks)


def grown(program: Program, source: str, anchor: str = "") -> Program:
    r"""Return a program after one more cell.

    A block takes the place of the one of its name. A new one goes before the next block of the same cell that the
    program has already, else before ``anchor``, else to the end. A class that names itself as its base, ``class
    Policy(Policy):``, gives the methods that join the class or replace its own.

    Args:
        program: the program so far.
        source: of the cell.
        anchor: name of a block.

    Example:
        >>> first = parts("def a():\n    return 1\n\n\ndef b():\n    return a()")
        >>> list(grown(first, "c = 3\n\n\ndef b():\n    return c").blocks)
        ['a', 'c', 'b']
    """
    more = parts(source)
    new = {
        name: _with_methods(program.blocks[name], text) if _extends(name, text) else text
        for name, text in more.blocks.items()
    }
    return Program(program.imports | more.imports, _merged(program.blocks, new, anchor))


def without(program: Program, names: Sequence[str]) -> Program:
    """Return a program without some of its blocks.

    Raises:
        ValueError: it has none of that name.
    """
    if unknown := set(names) - set(program.blocks):
        raise ValueError(f"nothing to drop: the program has no {', '.join(sorted(unknown))}")
    return Program(program.imports, {k: v for k, v in program.blocks.items() if k not in names})


def text_of(program: Program) -> str:
    r"""Return a program as text: the imports that it uses, sorted, then its blocks.

    Example:
        >>> print(text_of(parts("import torch\nimport math\nx = math.pi\ny = 2")))
        import math
        <BLANKLINE>
        <BLANKLINE>
        x = math.pi
        y = 2
    """
    text, before = _imports(program), ""
    for block in program.blocks.values():
        close = before and not DEFINED.search(before) and not DEFINED.search(block)
        text += ("\n" if close else "\n\n\n") + block
        before = block
    return text.strip("\n")


def difference(before: Program, after: Program) -> str:
    """Return what changed, block by block, as a unified diff with the block's name above each change."""
    old = {IMPORTS: _imports(before), **before.blocks}
    new = {IMPORTS: _imports(after), **after.blocks}
    return "\n".join(
        line for name in _merged(old, new) for line in _changes(name, old.get(name, ""), new.get(name, ""))
    )


def _changes(name: str, old: str, new: str) -> Iterator[str]:
    """Yield the diff of one block; two lines of it before and after each change."""
    heading = f"@@ {name} @@"
    for line in list(difflib.unified_diff(old.splitlines(), new.splitlines(), n=2, lineterm=""))[2:]:
        yield heading if line.startswith("@@") else line
        heading = f"@@ {name}, further down @@"


def _merged(old: Mapping[str, str], new: Mapping[str, str], anchor: str = "") -> dict[str, str]:
    blocks, names = dict(old), list(new)
    for number, name in enumerate(names):
        if name in blocks:
            blocks[name] = new[name]
            continue
        next_one = next((later for later in names[number + 1 :] if later in old), anchor)
        place = list(blocks).index(next_one) if next_one in blocks else len(blocks)
        known = list(blocks.items())
        blocks = dict([*known[:place], (name, new[name]), *known[place:]])
    return blocks


def _name_of(node: ast.stmt) -> str:
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return node.name
    if isinstance(node, ast.Assign):
        return ", ".join(ast.unparse(target) for target in node.targets)
    if isinstance(node, ast.AnnAssign):
        return ast.unparse(node.target)
    raise ValueError(
        f"a program has imports, definitions and assignments; line {node.lineno} has none: {ast.unparse(node)}"
    )


def _extends(name: str, text: str) -> bool:
    """Whether a block is a class that names itself as its base."""
    (node,) = ast.parse(text).body
    return isinstance(node, ast.ClassDef) and [ast.unparse(base) for base in node.bases] == [name]


def _with_methods(old: str, new: str) -> str:
    """Return a class with another's methods."""
    (header, methods), (_, more) = _class_parts(old), _class_parts(new)
    return "\n\n".join([header, *_merged(methods, more).values()]).replace("\n\n", "\n", 1)


def _class_parts(text: str) -> tuple[str, dict[str, str]]:
    """Return a class as far as its first line, comments and decorators included, and its methods by name."""
    lines = text.splitlines()
    (node,) = ast.parse(text).body
    assert isinstance(node, ast.ClassDef)
    header, methods, start = "\n".join(lines[: node.lineno]), {}, node.lineno
    for member in node.body:
        methods[_name_of(member)] = "\n".join(lines[start : member.end_lineno]).strip("\n")
        start = member.end_lineno or 0
    return header, methods


def _imports(program: Program) -> str:
    """Return the imports that a program uses as text: the standard library's, then the others."""
    blocks = [ast.parse(text) for text in program.blocks.values()]
    used = {node.id for block in blocks for node in ast.walk(block) if isinstance(node, ast.Name)}
    kept = [one for one in program.imports if (one[2] or one[1] or one[0].partition(".")[0]) in used]
    ours = [[one for one in kept if (_root(one) in sys.stdlib_module_names) is own] for own in (True, False)]
    return "\n\n".join("\n".join(_import_lines(section)) for section in ours if section)


def _root(one: Import) -> str:
    return one[0].partition(".")[0]


def _import_lines(section: Sequence[Import]) -> Iterator[str]:
    for module, _, alias in sorted(one for one in section if not one[1]):
        yield f"import {module}" + (f" as {alias}" if alias else "")
    for module in sorted({one[0] for one in section if one[1]}):
        names = sorted((one[1:] for one in section if one[0] == module and one[1]), key=_rank)
        yield f"from {module} import " + ", ".join(n + (f" as {a}" if a else "") for n, a in names)


def _rank(name: tuple[str, str]) -> tuple[int, str]:
    """Constants, classes, then the rest, as ruff sorts them."""
    return (0 if name[0].isupper() and len(name[0]) > 1 else 1 if name[0][0].isupper() else 2, name[0])
