"""Robots with their physical parameters: planar mechanisms, chains in space, and the registry."""
