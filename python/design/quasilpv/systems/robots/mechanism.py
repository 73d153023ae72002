"""What every planar robot of this project offers: dynamics, kinematics, a drawing, and the parameters behind them.

A new mechanism says what S, D, g and f of `dynamics` are, how its tool moves, and where its links are.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any, Self

import numpy as np

from quasilpv.arrays import FloatArray
from quasilpv.systems.descriptor.premise import Premise
from quasilpv.systems.descriptor.system import DescriptorSystem
from quasilpv.systems.robots.arm_parameters import OperatingDomain
from quasilpv.systems.robots.drawing import Drawing
from quasilpv.systems.robots.dynamics import PlanarDynamics
from quasilpv.systems.robots.kinematics import ToolKinematics
from quasilpv.systems.robots.mechanism_symbols import SymbolicMechanism


class PlanarMechanism(PlanarDynamics, ToolKinematics, Drawing):
    """A mechanism in a vertical plane: ``M(theta) theta'' + N(theta, omega) omega + G(theta) = Gamma``.

    Frames: X to the right, Y up, gravity along -Y; angles are positive counter-clockwise.
    """

    @abstractmethod
    def perturbed(self, mass_scale: Sequence[float], com_scale: Sequence[float]) -> Self:
        """The mechanism with masses and centres of mass scaled, inertias about the centres of mass unchanged."""

    @abstractmethod
    def parameters_document(self) -> dict[str, Any]:
        """The physical parameters as JSON-able data."""

    @abstractmethod
    def plant_document(self, label: str) -> dict[str, Any]:
        """The ``plant`` member of a scenario file."""

    def tool_path(self, angles: FloatArray) -> FloatArray:
        """See `Drawing`."""
        return np.array([self.forward_kinematics(row)[:2] for row in angles])

    @cached_property
    def symbolic(self) -> SymbolicMechanism:
        """The same model as sympy expressions of theta_i and omega_i."""
        return SymbolicMechanism.of(self)

    def inertia_premises(self, domain: OperatingDomain) -> tuple[Premise, ...]:
        """The measured premises ``cos(alpha_l - alpha_k)``, k < l, the inertia is affine in, with guaranteed bounds.

        Order: neighbouring links first, then further apart, base to tool; for the arm with n = 3: cos theta_2,
        cos theta_3, cos(theta_2 + theta_3).
        """
        return self.symbolic.inertia_premises(domain)

    def as_descriptor_system(self, domain: OperatingDomain) -> DescriptorSystem:
        """The descriptor model E(z) x' = A(z) x + B u, y = theta, with x = (theta, omega), u = Gamma.

        ``E = diag(I, M)``, ``A = [0, I; -H, -N]``, ``B = [0; I]``, ``C = [I, 0]``, where G(theta) = H(theta) theta. The
        premises are cos(alpha_l - alpha_k), sin(alpha_l - alpha_k) W_k and W_l, and sinc(alpha_k); those of Dehak 2022
        (Example I.2 for n = 2, Table I.3 for n = 3) for its factorisation of N.
        """
        return self.symbolic.descriptor_system(self.name, domain)
