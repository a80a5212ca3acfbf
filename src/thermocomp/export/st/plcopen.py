"""PLCopen XML (TC6, version 2.01): types, functions and function blocks as one file to import (CODESYS, Beremiz)."""

import re
from collections.abc import Sequence
from xml.etree import ElementTree as ET

from thermocomp.export.facts import Facts
from thermocomp.export.st.structuredtext import SourceUnit

NAMESPACE = "http://www.plcopen.org/xml/tc6_0201"
_XHTML = "http://www.w3.org/1999/xhtml"
_ELEMENTARY = ("LREAL", "DINT", "BOOL")
_SECTIONS = {"VAR_INPUT": "inputVars", "VAR_IN_OUT": "inOutVars", "VAR_OUTPUT": "outputVars", "VAR": "localVars"}


def write_project(units: Sequence[SourceUnit], name: str, facts: Facts, about: str) -> str:
    """Return a project of units in structured text of the second edition, see `secondedition.adapt`."""
    root = ET.Element("project", xmlns=NAMESPACE)
    ET.SubElement(
        root,
        "fileHeader",
        companyName="thermocomp",
        productName="thermocomp",
        productVersion=facts.version,
        creationDateTime=f"{facts.date}T00:00:00",
        contentDescription=about,
    )
    scales = ET.SubElement(ET.SubElement(root, "contentHeader", name=name), "coordinateInfo")
    for language in ("fbd", "ld", "sfc"):
        ET.SubElement(ET.SubElement(scales, language), "scaling", x="1", y="1")
    types = ET.SubElement(root, "types")
    kinds, pous = ET.SubElement(types, "dataTypes"), ET.SubElement(types, "pous")
    for unit in units:
        if unit.end:
            _pou(pous, unit)
        else:
            _data_type(kinds, unit)
    ET.SubElement(ET.SubElement(root, "instances"), "configurations")
    ET.indent(root)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ET.tostring(root, encoding="unicode")}\n'


def _type(parent: ET.Element, kind: str) -> None:
    if kind in _ELEMENTARY:
        ET.SubElement(parent, kind)
    else:
        ET.SubElement(parent, "derived", name=kind)


def _data_type(parent: ET.Element, unit: SourceUnit) -> None:
    base = ET.SubElement(ET.SubElement(parent, "dataType", name=unit.name), "baseType")
    if sized := re.search(r": ARRAY\[0\.\.(\d+)\] OF (\w+);", unit.declaration):
        array = ET.SubElement(base, "array")
        ET.SubElement(array, "dimension", lower="0", upper=sized[1])
        _type(ET.SubElement(array, "baseType"), sized[2])
    else:
        _variables(ET.SubElement(base, "struct"), unit.declaration)


def _variables(parent: ET.Element, text: str) -> None:
    """Add the variables of a section, with their comments."""
    for names, kind, start, about in re.findall(
        r"^ +([\w, ]+) : (\w+)(?: := ([^;]*))?;(?:\s+\(\*(.*?)\*\))?", text, re.MULTILINE | re.DOTALL
    ):
        for name in names.split(", "):
            _variable(parent, name, kind, start, about)


def _variable(parent: ET.Element, name: str, kind: str, start: str, about: str) -> None:
    variable = ET.SubElement(parent, "variable", name=name)
    _type(ET.SubElement(variable, "type"), kind)
    if start:
        values = ET.SubElement(ET.SubElement(variable, "initialValue"), "arrayValue")
        for v in start.strip("[]").split(","):
            ET.SubElement(ET.SubElement(values, "value"), "simpleValue", value=v.strip())
    if about:
        _text(ET.SubElement(variable, "documentation"), about.strip())


def _pou(parent: ET.Element, unit: SourceUnit) -> None:
    result = re.match(r"FUNCTION \w+ : (\w+)", unit.declaration)
    pou = ET.SubElement(parent, "pou", name=unit.name, pouType="function" if result else "functionBlock")
    interface = ET.SubElement(pou, "interface")
    if result:
        _type(ET.SubElement(interface, "returnType"), result[1])
    for word, retain, text in re.findall(
        r"^(VAR\w*)( RETAIN)?\n(.*?)END_VAR", unit.declaration, re.MULTILINE | re.DOTALL
    ):
        _variables(ET.SubElement(interface, _SECTIONS[word], {"retain": "true"} if retain else {}), text)
    _text(ET.SubElement(ET.SubElement(pou, "body"), "ST"), unit.statements.rstrip("\n"))


def _text(parent: ET.Element, text: str) -> None:
    ET.SubElement(parent, "xhtml", xmlns=_XHTML).text = text
