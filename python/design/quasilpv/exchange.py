"""Gains and models for other tools: ``.npz``, ``.mat``, JSON vertex tables, and `control.StateSpace`.

A gain K(z) is written as its vertices with the box of the premises; ``u = K(z) x``, added. The arrays are
``<name>_vertices`` (N, rows, columns), ``premise_lower``, ``premise_upper``, ``premise_centre`` and ``block_sizes``:
vertices of every block, in order; inside a block the first premise is the most significant bit and 0 is its lower
bound; the weights of a block sum to 1 over the number of blocks.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from quasilpv.arguments import checked
from quasilpv.artifact import Artifact
from quasilpv.certificate.exact.vertex_tables import VertexTable
from quasilpv.documents.system_artifact import SystemArtifactDocument
from quasilpv.documents.tables import PolytopeTable
from quasilpv.errors import InputError
from quasilpv.files import write_atomically
from quasilpv.studies.law import Law
from quasilpv.system_chain import SystemController

Exportable: TypeAlias = Law | SystemController | SystemArtifactDocument | Artifact
Arrays: TypeAlias = dict[str, Any]

FORMATS = ("npz", "mat", "json")


@checked
def export(what: Exportable, path: Path | str, form: str | None = None) -> Path:
    """Write the gains of a law or an artifact, and the model where there is one, for other tools.

    >>> import quasilpv as ql
    >>> from tempfile import TemporaryDirectory
    >>> answer = ql.solve("ex-I.1", "II.6", parameters={"b": 2.5})
    >>> with TemporaryDirectory() as folder:
    ...     ql.export(answer.law, f"{folder}/law.npz").suffix
    '.npz'

    Args:
        what: the law of an answer, a controller of a system, or an artifact.
        path: of the file.
        form: ``npz`` (numpy), ``mat`` (MATLAB 5) or ``json``; as the path ends by default.

    Raises:
        InputError: there is no such format, or the file cannot be written.
    """
    path = Path(path)
    own = path.suffix[1:] if form is None else form
    if own not in FORMATS:
        raise InputError(str(path), "format", own or "none", f"one of {', '.join(FORMATS)}")
    arrays, buffer = arrays_of(what), io.BytesIO()
    if own == "npz":
        np.savez(buffer, **arrays)
    elif own == "mat":
        from scipy.io import savemat  # noqa: PLC0415 -- nobody else needs it

        savemat(buffer, arrays)
    else:
        tree = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in arrays.items()}
        buffer.write(json.dumps(tree, indent=1).encode())
    write_atomically({path: buffer.getvalue()})
    return path


def arrays_of(what: Exportable) -> Arrays:
    """What `export` writes, by name."""
    if isinstance(what, Law):
        return _of_law(what)
    if isinstance(what, Artifact):
        return _of_robot(what)
    return _of_system(what.artifact if isinstance(what, SystemController) else what)


@checked
def state_space(
    what: SystemController | SystemArtifactDocument, premises: Mapping[str, float], *, closed: bool = False
) -> Any:
    """The system at one premise vector, as `control.StateSpace` from u to x_d, algebraic states eliminated.

    >>> import quasilpv as ql
    >>> pendulum = ql.DescriptorSystem.from_equations(
    ...     ["x' = v", "v' = 9.81*sin(x) + u"], state="x v", inputs="u", domain={"x": (-1, 1), "v": (-3, 3)}
    ... )
    >>> found = ql.stabilise(pendulum, decay_rate=1.0, input_limits={"u": 30.0})
    >>> ql.state_space(found, {"z1": 9.81}, closed=True).nstates
    2

    Args:
        what: a controller of a system.
        premises: z by name; those not named are in the middle of their box.
        closed: with the feedback; u is then added to it.

    Raises:
        InputError: a premise is unknown, or the package ``control`` is not installed.
    """
    try:
        control = import_module("control")
    except ImportError:
        raise InputError("state_space", "package", "no control", "it to be installed: pip install control") from None
    artifact = what.artifact if isinstance(what, SystemController) else what
    A, B = frozen(artifact, premises, closed=closed)
    q, m = B.shape
    return control.ss(A, B, np.eye(q), np.zeros((q, m)))


def frozen(artifact: SystemArtifactDocument, premises: Mapping[str, float], *, closed: bool = False) -> tuple[Any, Any]:
    """A and B of ``x_d' = A x_d + B u`` at one premise vector. Arguments and errors as `state_space`."""
    model = artifact.model
    for name in premises:
        if name not in model.names:
            raise InputError("state_space", "premise", name, f"among {', '.join(model.names) or 'none'}")
    middle = [0.5 * (low + high) for low, high in zip(model.lower, model.upper, strict=True)]
    z = np.array([premises.get(name, value) for name, value in zip(model.names, middle, strict=True)])
    E, A, B = (matrix.evaluate(z) for matrix in (model.E, model.A, model.B))
    q = model.differential
    if closed:
        A = A.copy()
        A[:, :q] += B @ VertexTable.of(artifact.law.gain).evaluate(z[None])[0]
    onto = -np.linalg.solve(A[q:, q:], np.hstack([A[q:, :q], B[q:]])) if q < len(A) else np.zeros((0, q + B.shape[1]))
    reduced = np.linalg.solve(E[:q, :q], np.hstack([A[:q, :q], B[:q]]) + A[:q, q:] @ onto)
    return reduced[:, :q], reduced[:, q:]


def _of_table(name: str, table: PolytopeTable) -> Arrays:
    return {
        f"{name}_vertices": np.array([vertex for block in table.blocks for vertex in block.vertices]),
        "premise_lower": np.array(table.lower),
        "premise_upper": np.array(table.upper),
        "premise_centre": np.array(table.centre),
        "block_sizes": np.array([len(block.vertices) for block in table.blocks]),
    }


def _of_law(law: Law) -> Arrays:
    return {
        "system": law.system,
        "condition": law.condition,
        "state": list(law.state),
        "inputs": list(law.inputs),
        "premises": [f"{p.name} = {p.expression}" for p in law.premises],
        "gain_vertices": law.vertices,
        "premise_lower": np.array([p.lower for p in law.premises]),
        "premise_upper": np.array([p.upper for p in law.premises]),
        "lyapunov": law.lyapunov,
    }


def _of_system(artifact: SystemArtifactDocument) -> Arrays:
    model = artifact.model
    matrices = {
        f"{name}_{part}": np.array(value)
        for name, matrix in (("E", model.E), ("A", model.A), ("B", model.B))
        for part, value in (("constant", matrix.constant), ("slopes", matrix.coefficients))
    }
    return {
        "name": artifact.name,
        "hash": artifact.hash,
        "sample_period_s": artifact.sample_period_s,
        "state": [signal.name for signal in artifact.states],
        "inputs": [signal.name for signal in artifact.inputs],
        "trim": np.array([signal.trim for signal in (*artifact.states, *artifact.inputs)]),
        "premises": list(model.names),
        **_of_table("gain", artifact.law.gain),
        **matrices,
        "lyapunov": np.array(artifact.region.lyapunov),
    }


def _of_robot(artifact: Artifact) -> Arrays:
    tables = {name: getattr(artifact.law, name) for name in type(artifact.law).model_fields}
    found: Arrays = {"name": artifact.name, "hash": artifact.hash, "law": artifact.law.kind}
    for name, value in tables.items():
        if isinstance(value, PolytopeTable):
            found.update(_of_table(name, value))
        elif isinstance(value, int | float):
            found[name] = value
        elif isinstance(value, tuple):
            found[name] = np.array(value)
    return {**found, "sample_period_s": artifact.sample_period_s}
