"""How inequalities are written, bounded and shortened: what several theorems share."""
