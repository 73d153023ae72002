"""The checker decides every kind of robot somewhere, in one way; a kind that is nowhere is an error by name."""

from __future__ import annotations

import pytest

from quasilpv.certificate.robot.equations_of_motion import EQUATIONS
from quasilpv.certificate.robot.registry import EXACT, IN_SPACE, NUMERIC, exact_robot, is_in_space, numeric_robot
from quasilpv.documents.mechanism import MECHANISM_KINDS, MechanismDocument
from quasilpv.documents.robot import read_mechanism
from quasilpv.errors import InputError
from quasilpv.systems.robots.registry import robots
from quasilpv.systems.robots.ur5 import ur5


class Ferry(MechanismDocument):
    """A kind that nobody decides."""

    kind: str = "ferry"


def test_every_kind_of_robot_is_in_the_plane_with_both_evaluators_or_a_chain_in_space() -> None:
    assert set(EXACT) == set(NUMERIC) == set(EQUATIONS)
    assert not set(EXACT) & IN_SPACE
    assert set(EXACT) | IN_SPACE == set(MECHANISM_KINDS)


def test_when_a_robot_is_in_space_expect_the_tables_of_the_plane_to_refuse_it_and_say_so() -> None:
    mechanism = read_mechanism(ur5().model.parameters_document(), 2, "ur5")
    assert is_in_space(mechanism)
    for evaluator in (exact_robot, numeric_robot):
        with pytest.raises(InputError, match=r"kind: got tree, expected one of serial-arm, .*\(of robots in a plane\)"):
            evaluator(mechanism)


def test_when_a_robot_is_in_the_plane_expect_its_evaluators() -> None:
    planar = [entry for entry in robots() if not entry.in_space]
    assert planar
    for entry in planar:
        mechanism = read_mechanism(entry.model.parameters_document(), 2, entry.id)
        assert not is_in_space(mechanism)
        assert exact_robot(mechanism).joints == mechanism.joints
        assert numeric_robot(mechanism)


def test_when_a_kind_is_decided_nowhere_expect_it_refused_by_name() -> None:
    for ask in (is_in_space, exact_robot, numeric_robot):
        with pytest.raises(InputError, match=r"robot\.parameters\.kind: got ferry, expected one of serial-arm"):
            ask(Ferry())
