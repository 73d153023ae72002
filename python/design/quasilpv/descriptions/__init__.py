"""Robots from description files: URDF and MJCF as they are met, and `robot.toml` for what they lack.

    file -> DescribedTree (what the file says) -> KinematicTree (the chain to a tip, everything else merged into it)

A description is untrusted: XML without entities, included files only below the folder of the file, no meshes.
"""
