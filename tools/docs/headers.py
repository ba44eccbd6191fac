# SPDX-License-Identifier: BSD-3-Clause
"""Pages of the public headers, one for each layer of the core, each part of lib and each library of a subject, from Doxygen's XML.

Classes are laid out by Breathe. Functions, enumerations and aliases of the namespace are shown as they are declared, each
with its comment: by name alone Breathe could not distinguish overloads.
"""
import re
import xml.etree.ElementTree as ElementTree

# In the order of docs/architecture.md.
LAYERS = ["runtime", "types", "graph", "linear", "solve", "plugin"]
LIB = ["lie", "io", "geometry", "information", "update", "evaluation", "typed"]
# What else has headers for C++ callers, and where.
BESIDE = {"report": "lib/report", "online": "plugins/online/library", "sparsification": "plugins/sparsify/library",
          "policy": "plugins/compact/library", "grid": "plugins/exploration/library/grid",
          "exploration": "plugins/exploration/library/exploration"}


def folders(source):
    for layer in LAYERS:
        yield "core", layer, source / "core" / "include" / "cairn" / layer
    for part, folder in [*((part, f"lib/{part}") for part in LIB), *BESIDE.items()]:
        yield "lib", part, source / folder / "include" / "cairn" / part


def simplify(xml):
    """Takes out of Doxygen's XML what Breathe cannot read: friends, and initialisers with designated members."""
    for file in xml.glob("*.xml"):
        text = file.read_text(encoding="utf-8")
        if "<memberdef" not in text:
            continue
        tree = ElementTree.ElementTree(ElementTree.fromstring(text))
        for section in tree.iter("sectiondef"):
            for member in list(section):
                if member.get("kind") == "friend":
                    section.remove(member)
                    continue
                for initializer in member.findall("initializer"):
                    if "{." in "".join(initializer.itertext()).replace(" ", ""):
                        member.remove(initializer)
        tree.write(file, encoding="utf-8", xml_declaration=True)


def text_of(element):
    return re.sub(r"\s+", " ", "".join(element.itertext())).strip() if element is not None else ""


BLOCKS = ("programlisting", "verbatim", "itemizedlist", "orderedlist", "para", "table", "parblock", "simplesect")


def code_of(element):
    lines = ["".join(line.itertext()) for line in element.iter("codeline")] or ["".join(element.itertext())]
    text = "\n".join(lines).strip("\n")
    return f"```{'cpp' if text.isascii() else 'text'}\n{text}\n```"  # mathematics is no C++


def paragraphs_of(element):
    """A paragraph and the blocks in it, in their order."""
    line = escape(element.text or "")
    for child in element:
        if child.tag in BLOCKS:
            yield line
            line = ""
            if child.tag in ("programlisting", "verbatim"):
                yield code_of(child)
            else:
                yield from paragraphs_of(child)
        else:
            inner = "".join(child.itertext())
            line += f"`{inner}`" if child.tag == "computeroutput" and inner else escape(inner)
        line += escape(child.tail or "")
    yield line


def description(member):
    """Brief and detailed comment as Markdown: paragraphs, and code as it stands."""
    found = []
    for part in (member.find("briefdescription"), member.find("detaileddescription")):
        for one in paragraphs_of(part) if part is not None else []:
            found.append(one if one.startswith("```") else re.sub(r"\s+", " ", one).strip())
    return [one for one in found if one]


def escape(text):
    return re.sub(r"([\\`*_\[\]<>$])", r"\\\1", text)


def declaration(member):
    kind = member.get("kind")
    if kind == "enum":
        values = ", ".join(value.findtext("name") for value in member.findall("enumvalue"))
        return f"enum class {member.findtext('name')} {{ {values} }};"
    template = member.find("templateparamlist")
    lines = []
    if template is not None:
        parameters = [" ".join(filter(None, (text_of(one.find("type")), text_of(one.find("declname"))))) for one in template]
        lines.append(f"template <{', '.join(parameters)}>")
    definition = member.findtext("definition").replace("cairn::", "")
    lines.append(definition + (member.findtext("argsstring") or "") + ";")
    return "\n".join(lines)


def free_members(xml):
    """Of the namespace, by header: functions, enumerations, aliases."""
    found = {}
    for section in ElementTree.parse(xml / "namespacecairn.xml").getroot().iter("sectiondef"):
        for member in section.findall("memberdef"):
            if member.get("kind") in ("function", "enum", "typedef"):
                found.setdefault(member.find("location").get("file"), []).append(member)
    return found


def classes(xml):
    """By header, the names of the classes that are not nested, with their kind."""
    found = {}
    for file in xml.glob("*_8hpp.xml"):
        compound = ElementTree.parse(file).getroot().find("compounddef")
        names = found.setdefault(compound.find("location").get("file"), [])
        for inner in compound.findall("innerclass"):
            if inner.text.count("::") == 1 and "<" not in inner.text:
                names.append((inner.text, "struct" if inner.get("refid").startswith("struct") else "class"))
    return found


def write(stage, source, xml):
    """Returns the names of the pages."""
    simplify(xml)
    free, types = free_members(xml), classes(xml)
    text = ["# C++: headers", "", "One page for each layer of the core and each subject of the library ([architecture](../docs/architecture.md)); the guide is [cpp.md](../docs/cpp.md).", ""]
    pages = ["headers/index"]
    for part, name, folder in folders(source):
        found = sorted(folder.glob("*.hpp"))
        if not found:
            raise SystemExit(f"no headers in {folder}")
        lines = [f"# {part}: {name}", ""]
        for header in found:
            lines += [f"## cairn/{name}/{header.name}", ""]
            for class_name, kind in types.get(str(header.relative_to(source)), []):
                lines += [f"```{{doxygen{kind}}} {class_name}", ":members:", "```", ""]
            for member in free.get(str(header.relative_to(source)), []):
                lines += ["```cpp", declaration(member), "```", "", *[line + "\n" for line in description(member)]]
        stage.write(f"headers/{name}.md", "\n".join(lines))
        pages.append(f"headers/{name}")
        text.append(f"- [{part}: {name}]({name}.md)")
    stage.write("headers/index.md", "\n".join(text) + "\n")
    return pages
