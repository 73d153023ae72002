"""The conditions behind the tracking laws: gains, and the sets their errors do not leave."""
