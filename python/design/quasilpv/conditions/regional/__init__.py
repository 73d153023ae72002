"""Conditions for a law and the set of states inside which it is proved to work."""
