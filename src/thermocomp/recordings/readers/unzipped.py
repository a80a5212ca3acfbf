"""Size limits of unzipped workbooks: the whole content is measured before it is parsed."""

import zipfile
from pathlib import Path
from xml.parsers import expat

from thermocomp.core.exceptions import RecordingError
from thermocomp.recordings.readers.limits import FileLimits

#: equivalent size of an XML element in bytes, because even a short one takes time
_ELEMENT = 72
_BLOCK = 1 << 16
#: elements that are processed completely at their end, by root element of the part
_DONE_WITH = {"worksheet": "row", "sst": "si", "document-content": "table-row"}
#: length of the longest cell name in a spreadsheet
_PLACE = len("XFD1048576")


def check_unzipped(path: Path, limits: FileLimits) -> None:
    """Reject a zip bomb, and XML that would take much more memory or time than its size suggests.

    Sizes stated in the zip file are not trusted. Parts of a valid workbook never define entities.
    """
    unpacked = 0
    with zipfile.ZipFile(path) as parts:
        for part in parts.infolist():
            survey = _Survey(f"{path}: {part.filename}", limits)
            with parts.open(part) as content:
                while block := content.read(_BLOCK):
                    survey.take(block)
                    limits.check_unpacked(unpacked + survey.unpacked, path)
            unpacked += survey.unpacked


class _Survey:
    """Counter of the elements of one part, and of the longest text and row in it."""

    def __init__(self, where: str, limits: FileLimits) -> None:
        self.where = where
        self.limits = limits
        self.size = self.elements = self.begun = self.last = 0
        self.root = ""
        self.parser: expat.XMLParserType | None = expat.ParserCreate()
        self.parser.StartElementHandler = self._element
        self.parser.StartDoctypeDeclHandler = self._doctype

    @property
    def unpacked(self) -> int:
        """Unpacked size in bytes, or the equivalent size of the elements if larger."""
        return max(self.size, _ELEMENT * self.elements)

    def take(self, block: bytes) -> None:
        self.size += len(block)
        if self.parser is None:
            return
        try:
            self.parser.Parse(block)
        except expat.ExpatError:
            self.parser = None  # a picture, or damaged: the actual reader stops here as well
            return
        self.limits.check("line_bytes", self.size - self.last, self.where)

    def _element(self, name: str, attributes: dict[str, str]) -> None:
        assert self.parser is not None
        self.last = self.parser.CurrentByteIndex
        self.elements += 1
        local = name.rpartition(":")[2]
        if not self.root:
            self.root = local
        if local == _DONE_WITH.get(self.root):
            self.begun = self.elements
        elif self.elements - self.begun > self.limits.row_elements:
            self.limits.check("row_elements", self.elements - self.begun, self.where)
        if len(attributes.get("r", "")) > _PLACE:
            raise RecordingError(
                f"{self.where}: {attributes['r'][:40]!r} is not the address of a cell; save the file again"
            )

    def _doctype(self, *_: object) -> None:
        raise RecordingError(
            f"{self.where}: the file defines entities or a document type, as no spreadsheet does; save it again"
        )
