# SPDX-License-Identifier: BSD-3-Clause
"""A page of all public names of the Python package, from their docstrings."""
import importlib
import inspect
import re
import sys


def prose(docstring):
    """A docstring as Markdown: what is indented below a name is its text, other indented lines are code."""
    lines, code = [], False
    for line in inspect.cleandoc(docstring).split("\n"):
        indented = line.startswith("    ")
        continues = indented and lines and lines[-1].strip() and not code
        if indented and not continues and not code:
            lines.append("```python")
            code = True
        if code and not indented and line.strip():
            while lines[-1] == "":
                lines.pop()
            lines += ["```", ""]
            code = False
        if not code and re.match(r"[a-z_]+(, [a-z_]+)*: ", line):  # an argument
            name, text = line.split(": ", 1)
            line = f"- `{name}`: {text}"
            if lines and lines[-1] and not lines[-1].startswith(("- ", "  ")):
                lines.append("")
        elif continues:
            line = "  " + line.strip()
        elif code:
            line = line[4:]
        lines.append(line)
    if code:
        lines.append("```")
    return "\n".join(lines)


def split(docstring):
    """Signatures and text of what pybind11 documents: each overload has its own."""
    docstring = docstring or ""
    if "Overloaded function." in docstring:
        return [one for part in re.split(r"^\d+\. ", docstring, flags=re.MULTILINE)[1:] for one in split(part)]
    first, _, rest = docstring.partition("\n")
    if re.match(r"[\w.]+\(.*\)", first):
        return [(plain(first), rest.strip("\n"))]
    return [("", docstring)]


def plain(signature):
    """Without the compiled module's names, and without what pybind11 calls self."""
    signature = re.sub(r"cairn\._cairn\.|cairn\.(?=[A-Z])", "", signature)
    signature = re.sub(r"\(self: [\w.:]+(, )?", "(", signature)
    signature = re.sub(r": object|: handle", "", signature)
    return signature.replace("Bound", "").replace("(, *", "(*")


def members(kind):
    for name, member in vars(kind).items():
        if not name.startswith("_") and (callable(member) or isinstance(member, (property, staticmethod))):
            yield name, member


def entry(title, docstrings):
    lines = []
    for signature, text in docstrings:
        if signature:
            lines += ["```python", signature, "```", ""]
        if text.strip():
            lines += [prose(text), ""]
    return [title, "", *lines]


def write(stage, folder):
    """Returns the name of the page."""
    sys.path.insert(0, folder)
    cairn = importlib.import_module("cairn")
    text = ["# Python: all names", "", "Docstrings of the package `cairn`; the guide is [python.md](docs/python.md).", ""]
    for name in cairn.__all__:
        thing = getattr(cairn, name)
        if isinstance(thing, str):
            continue
        if not isinstance(thing, type):
            text += entry(f"## cairn.{name}", split(thing.__doc__))
            continue
        text += entry(f"## cairn.{name}", [("", thing.__doc__ or "")])
        init = vars(thing).get("__init__")
        made = split(init.__doc__) if init is not None and "Initialize self" not in (init.__doc__ or "") else []
        made = [(signature.replace("__init__", name).replace(" -> None", ""), rest) for signature, rest in made]
        if any(signature for signature, _ in made):
            text += entry("", made)[1:]
        kinds = [one for one in thing.__mro__ if one.__module__.startswith("cairn")]
        for one in kinds:
            for member_name, member in members(one):
                docs = member.__doc__ if not isinstance(member, staticmethod) else member.__func__.__doc__
                text += entry(f"### {name}.{member_name}", split(docs))
    stage.write("python_names.md", "\n".join(text))
    return ["python_names"]
