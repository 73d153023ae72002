"""Frozen sampled closed loops of n coupled joints, in double arithmetic: what a law does between samples, and on grids.

Nothing here knows how a law is designed: the design searches with these loops, the gate checks what was shipped with
them.
"""
