"""The design inertia of a law: what it believes of its robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

from pydantic import Discriminator, Tag

from quasilpv.documents.mechanism import Tree
from quasilpv.documents.tables import PolytopeTable

TABLE_TAG, ROBOT_TAG = "polytope-table", "tree"
DESIGN_INERTIA_TAGS = (TABLE_TAG, ROBOT_TAG)
"""Names of cases, not of members, in paths of errors."""


def _form_of(value: Any) -> str:
    """A robot is tagged, a table is not."""
    tagged = "kind" in value if isinstance(value, Mapping) else isinstance(value, Tree)
    return ROBOT_TAG if tagged else TABLE_TAG


DesignInertia: TypeAlias = Annotated[
    Annotated[PolytopeTable, Tag(TABLE_TAG)] | Annotated[Tree, Tag(ROBOT_TAG)], Discriminator(_form_of)
]
"""A matrix M(z) as a table, with programs for z and for gravity; or the robot itself, which has both of its own."""
