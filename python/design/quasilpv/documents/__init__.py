"""What files say, typed: numbers, tables, programs and robots, shared by whoever writes, reads or checks them.

Shapes only. No document computes anything of a design, so that a checker and what it checks may both read them.
"""
