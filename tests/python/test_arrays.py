"""What is done with arrays everywhere."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from quasilpv.arrays import distinct


@given(st.lists(st.integers(-3, 3) | st.integers(-(2**62), 2**62)))
def test_distinct_values_are_those_of_the_set_in_order(values: list[int]) -> None:
    assert distinct(np.array(values, dtype=np.intp)).tolist() == sorted(set(values))
