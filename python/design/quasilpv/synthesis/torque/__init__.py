"""The laws at the torque level: Theorem IV.11 on a schedule of measured premises."""
