"""Rational linear algebra, polynomials, balls, tables and programs: what claims are decided with."""
