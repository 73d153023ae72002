"""Every name of the front door has an example that runs as it says; notebooks show results as tables and plots."""

import doctest
import inspect
from xml.etree import ElementTree

import pytest
from matplotlib.figure import Figure

import quasilpv as ql
from quasilpv.system_chain import SystemController

NAMES = [name for name in ql.__all__ if not name.startswith("_")]


@pytest.mark.parametrize("name", NAMES)
def test_the_example_of_a_public_name_runs_and_prints_what_it_says(name: str) -> None:
    text = inspect.getdoc(getattr(ql, name)) or ""
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert example.examples
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL)
    said: list[str] = []
    assert runner.run(example, out=said.append).failed == 0, "".join(said)


def controller() -> SystemController:
    """Of a pendulum."""
    pendulum = ql.DescriptorSystem.from_equations(
        ["x' = v", "v' = 9.81*sin(x) + u"], state="x v", inputs="u", domain={"x": (-1, 1), "v": (-3, 3)}
    )
    return ql.stabilise(pendulum, decay_rate=1.0, input_limits={"u": 30.0})


SHOWN = {
    "answer": lambda: ql.solve("ex-I.1", "II.6", parameters={"b": 2.5}),
    "artifact": lambda: ql.design("arm3", law="ctc").release(),
    "boundary": lambda: ql.boundary("ex-I.1", "II.6", ("b", 0.0, 30.0), tolerance=0.1, parameters={"a": 1.0}),
    "system": lambda: ql.DescriptorSystem.from_equations(
        ["x' = -a*x + u"], state="x", inputs="u", domain={"x": (-1, 1), "a": (1, 2)}, unknown="a", name="<b>"
    ),
    "verification": lambda: controller().verify(),
}


@pytest.mark.parametrize("what", SHOWN)
def test_a_notebook_shows_a_table_of_a_few_rows_in_which_text_is_text(what: str) -> None:
    shown = SHOWN[what]()._repr_html_()
    assert 2 <= shown.count("<tr>") <= 12
    assert ElementTree.fromstring(shown).tag == "table"  # whatever a name holds


def test_a_map_and_a_region_are_drawn_into_the_plot_that_is_given() -> None:
    figure = Figure()
    left, right = figure.subplots(1, 2)
    found = ql.region("ex-I.1", "II.6", ("a", -8.0, 8.0, 3), ("b", -20.0, 20.0, 3))
    assert ql.plot_region(found, ax=left) is figure
    assert (left.get_xlabel(), len(left.collections)) == ("a, parameter of ex-I.1", 2)
    run = controller().simulate(start={"x": 0.1}, duration_s=0.05)
    assert run.plot("region", ax=right) is figure
    assert (right.get_xlabel(), right.get_ylabel()) == ("x", "v")
    with pytest.raises(ql.InputError, match="ax: got one plot for signals"):
        run.plot("signals", ax=right)
