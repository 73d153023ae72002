"""Documents that are known by their hash: what artifacts of robots and of general systems have in common."""

from __future__ import annotations

from quasilpv.documents.canonical import Document, document_hash, with_hash
from quasilpv.documents.strict_model import StrictModel


class HashedDocument(StrictModel):
    """The hash is not stored; it is computed from the content."""

    @property
    def hash(self) -> str:
        """SHA-256 of the canonical JSON of the content, 64 hexadecimal digits."""
        return document_hash(self.content())

    def content(self) -> Document:
        """Return the artifact as a JSON tree without its hash."""
        return self.model_dump(mode="json", by_alias=True)

    def to_document(self) -> Document:
        """Return the artifact as a normalised JSON tree, hash included."""
        return with_hash(self.content())
