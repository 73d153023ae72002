"""The source's figures and tables, regenerated one by one, each with a verdict computed from the numbers."""

from quasilpv.reproduction.item import Effort, Finding, Item, ItemResult, ItemVerdict
from quasilpv.reproduction.registry import ITEMS, item
from quasilpv.reproduction.runner import reproduce

__all__ = ["ITEMS", "Effort", "Finding", "Item", "ItemResult", "ItemVerdict", "item", "reproduce"]
