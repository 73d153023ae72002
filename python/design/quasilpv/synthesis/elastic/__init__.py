"""Laws for arms whose joints give."""
