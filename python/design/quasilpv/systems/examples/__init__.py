"""Descriptor systems of Dehak 2022 that the catalogue knows by name."""
