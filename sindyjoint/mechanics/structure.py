"""A chain of beams, joints and lumped masses on a base, assembled and reduced.

The unknowns are deflections w, rotations φ, and the angle θ of every joint: the rotation behind a joint is
φ + θ. So the joint angles are separate coordinates, and a joint that sticks is a coordinate at standstill.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, eigh

from sindyjoint.errors import InputError, UnknownNameError, refuse
from sindyjoint.mechanics import Law
from sindyjoint.mechanics.beam import Beam, element_mass, element_stiffness, hermite_shapes
from sindyjoint.numeric import Array


@dataclass(frozen=True)
class Hinge:
    """A joint in a chain: a law and what its hardware weighs.

    Parameters
    ----------
    name : str
    law : Law
        Its transfer moment acts on the angle; its inertia belongs to the test rig and is not used here.
    mass : float
        kg.
    inertia : float
        kg·m², on the side away from the base.
    """

    name: str
    law: Law
    mass: float = 0.0
    inertia: float = 0.0


@dataclass(frozen=True)
class LumpedMass:
    """A rigid mass at a position in the chain; kg and kg·m²."""

    name: str
    mass: float
    inertia: float = 0.0


Item = Beam | Hinge | LumpedMass


@dataclass(frozen=True, eq=False)
class Structure:
    """Matrices of an assembled chain; the joint angles are the first coordinates.

    Parameters
    ----------
    mass, stiffness, loss : ndarray, shape (n, n)
        Without the joints' moments; `loss` is the stiffness weighted with the beams' loss factors.
    hinges : tuple of Hinge
    points : dict of str to ndarray, shape (n,)
        How the deflection at each named point follows from the coordinates.
    loss_frequency : float, optional
        Hz, at which the beams' loss factors hold: their loss is made viscous there. Default: the first mode.
    viscous : ndarray, shape (n, n), optional
        Damping matrix beside that of the beams' loss.
    base : ndarray, shape (n,), optional
        The coordinates of a rigid motion of one metre of everything that the base carries.
    basis : ndarray, shape (whole, n), optional
        Of a reduced structure: the shapes that its coordinates stand for.
    """

    mass: Array
    stiffness: Array
    loss: Array
    hinges: tuple[Hinge, ...]
    points: dict[str, Array]
    loss_frequency: float | None = None
    viscous: Array | None = None
    base: Array | None = None
    basis: Array | None = None

    @property
    def n_joints(self) -> int:
        """Number of joints."""
        return len(self.hinges)

    @property
    def damping(self) -> Array:
        """Viscous damping matrix C = L/(2π f) + C₀, shape (n, n): the material loss L as at the loss frequency f."""
        lossy = bool(self.loss.any())
        frequency = (self.loss_frequency or float(self.frequencies(1)[0])) if lossy else 1.0
        damping = self.loss / (2 * np.pi * frequency)
        return damping if self.viscous is None else damping + self.viscous

    def tangent_stiffness(self) -> Array:
        """Stiffness of each joint at standstill in the middle, N·m/rad, shape (n_joints,)."""
        return np.array([tangent_of(hinge.law) for hinge in self.hinges])

    def frequencies(self, count: int = 6, locked: bool = False) -> Array:
        """Natural frequencies, Hz, with the joints' stiffness at standstill or with locked joints.

        Parameters
        ----------
        count : int
        locked : bool
        """
        j = self.n_joints
        mass, stiffness = self.mass, self.stiffness.copy()
        stiffness[np.arange(j), np.arange(j)] += self.tangent_stiffness()
        if locked:
            mass, stiffness = mass[j:, j:], stiffness[j:, j:]
        count = min(count, len(mass))
        values = eigh(stiffness, mass, subset_by_index=[0, count - 1], eigvals_only=True)
        if values[0] <= 0:
            raise InputError(
                f"the chain is no structure: its softest motion has stiffness {values[0]:.3g} s⁻² per unit mass; a "
                "joint without stiffness needs a beam or base that holds what is behind it"
            )
        return np.sqrt(values) / (2 * np.pi)

    def point(self, name: str) -> Array:
        """Row of a named point."""
        try:
            return self.points[name]
        except KeyError:
            raise UnknownNameError(
                f"point {name!r} is not in the chain; expected one of {', '.join(self.points)}"
            ) from None


def tangent_of(law: Law) -> float:
    """Return the stiffness of a joint at standstill in the middle, N·m/rad."""
    # Central difference over an angle far below anything a joint is tested at.
    step = 1e-7
    low, high = law.moment([-step, step], 0.0, 0.0)
    return float(high - low) / (2 * step)


def _check_chain(items: Sequence[Item]) -> None:
    names = [item.name for item in items]
    twice = sorted({name for name in names if names.count(name) > 1})
    refuse(
        [(not any(isinstance(item, Beam) for item in items), "the chain has no beam; expected at least one")]
    )
    refuse(
        [
            (
                isinstance(items[0], LumpedMass),
                f"the chain begins with mass {names[0]!r} at the base; begin with a beam or a joint",
            ),
            *(
                (
                    isinstance(before, Hinge) and not isinstance(item, Beam),
                    f"the chain is disconnected: joint {before.name!r} is followed by "
                    f"{'nothing' if item is None else repr(item.name)}; expected a beam behind it",
                )
                for before, item in zip(items, [*items[1:], None], strict=True)
            ),
            (
                twice,
                f"name(s) {', '.join(twice)} used twice in the chain; expected a different name for each part",
            ),
            (
                "tip" in names,
                "a part is called 'tip', as the free end of every chain is; expected another name",
            ),
            *(
                (
                    not 0 <= getattr(item, name) < np.inf,
                    f"{item.name!r}: {name} is {getattr(item, name)!r}; expected a number that is not negative",
                )
                for item in items
                if not isinstance(item, Beam)
                for name in ("mass", "inertia")
            ),
        ]
    )


def assemble(
    items: Sequence[Item],
    clamp_stiffness: float = np.inf,
    stations: Mapping[str, tuple[str, float]] | None = None,
    loss_frequency: float | None = None,
) -> Structure:
    """Assemble a chain from the base to its free end.

    Parameters
    ----------
    items : sequence of Beam, Hinge, LumpedMass
        In order from the base.
    clamp_stiffness : float
        Rotational stiffness of the base, N·m/rad; infinite for a rigid clamp.
    stations : mapping of str to (str, float), optional
        Further points by name: a beam, and how far from its end at the base, m.
    loss_frequency : float, optional
        Hz; see :class:`Structure`.

    Raises
    ------
    InputError
        For a chain that does not hang together, or a negative stiffness.
    """
    _check_chain(items)
    if not clamp_stiffness > 0:
        raise InputError(f"clamp_stiffness is {clamp_stiffness!r}; expected a number above zero, or inf")
    hinges = tuple(item for item in items if isinstance(item, Hinge))
    soft_clamp = np.isfinite(clamp_stiffness)
    size = len(hinges) + 2 * sum(item.elements for item in items if isinstance(item, Beam)) + soft_clamp
    mass, stiffness, loss = np.zeros((3, size, size))
    # Deflection and slope where the chain has got to, as rows over all unknowns; the joints' angles come first.
    joints, free = iter(np.eye(size)[: len(hinges)]), iter(np.eye(size)[len(hinges) :])
    w, phi = np.zeros(size), next(free) if soft_clamp else np.zeros(size)
    if soft_clamp:
        stiffness += clamp_stiffness * np.outer(phi, phi)
    points: dict[str, Array] = {}
    base = np.zeros(size)
    for item in items:
        if isinstance(item, Beam):
            length = item.length / item.elements
            bending = element_stiffness(item.bending_stiffness, length)
            for number in range(item.elements):
                ends = np.stack([w, phi, next(free), next(free)])
                element = ends.T @ bending @ ends
                stiffness += element
                loss += item.loss_factor * element
                mass += ends.T @ element_mass(item.mass_per_length, length) @ ends
                for name, (where, at) in (stations or {}).items():
                    along = at / length - number
                    # The far end of an element belongs to it; that of the base stands still in any case.
                    if where == item.name and 0 < along <= 1 + 1e-9:
                        points[name] = hermite_shapes(along, length) @ ends
                w, phi = ends[2:]
                base += w
        else:
            phi = phi + next(joints) if isinstance(item, Hinge) else phi
            mass += item.mass * np.outer(w, w) + item.inertia * np.outer(phi, phi)
        points[item.name] = w
    points["tip"] = w
    _check_stations(items, stations or {}, points)
    return Structure(mass, stiffness, loss, hinges, points, loss_frequency, base=base)


def _check_stations(
    items: Sequence[Item], stations: Mapping[str, tuple[str, float]], points: Mapping[str, Array]
) -> None:
    lengths = {item.name: item.length for item in items if isinstance(item, Beam)}
    for name, (beam, at) in stations.items():
        if beam not in lengths:
            raise UnknownNameError(
                f"point {name!r}: beam {beam!r} is not in the chain; expected one of {', '.join(lengths)}"
            )
        if name not in points:
            raise InputError(
                f"point {name!r}: at is {at:g} m; expected a place above 0 up to the {lengths[beam]:g} m of {beam!r}"
            )


def craig_bampton(structure: Structure, points: Sequence[str], modes: int = 12) -> Structure:
    """Reduce a structure to its joint angles, the named points and fixed-interface modes.

    Craig & Bampton, AIAA Journal 6(7), 1968: static shapes for each kept coordinate, and the lowest modes with all
    of them held.

    Parameters
    ----------
    structure : Structure
    points : sequence of str
        Where forces act and motion is asked for.
    modes : int

    Returns
    -------
    Structure
        Coordinates: joint angles, deflections at the points, modes.
    """
    n, rows = len(structure.mass), {name: structure.point(name) for name in points}
    still = [name for name in points if not rows[name].any()]
    if still:
        raise InputError(f"point(s) {', '.join(still)} do not move: they sit at the base")
    largest = (int(np.argmax(row)) for row in rows.values())
    kept = np.array(list(dict.fromkeys([*range(structure.n_joints), *largest])), dtype=int)
    internal = np.setdiff1d(np.arange(n), kept)
    k_internal, m_internal = (m[np.ix_(internal, internal)] for m in (structure.stiffness, structure.mass))
    basis = np.zeros((n, len(kept) + min(modes, len(internal))))
    basis[kept, np.arange(len(kept))] = 1.0
    if len(internal):
        held = cho_factor(k_internal)
        basis[internal, : len(kept)] = -cho_solve(held, structure.stiffness[np.ix_(internal, kept)])
        _, shapes = eigh(k_internal, m_internal, subset_by_index=[0, min(modes, len(internal)) - 1])
        basis[internal, len(kept) :] = shapes
    return projected(structure, basis)


def with_coordinate(structure: Structure, name: str) -> Structure:
    """Return a structure one of whose coordinates, none of the joints', is the deflection of a point.

    With the row r of the point and its largest entry r_c behind the joints, q_c = (w − Σ r_i q_i)/r_c, i ≠ c.

    Raises
    ------
    UnknownNameError
    InputError
        For a point that stands still, or moves with the joints alone.
    """
    row, joints = structure.point(name), structure.n_joints
    if not row[joints:].any():
        how = "moves with the joints alone" if row.any() else "does not move: it sits at the base"
        raise InputError(f"point {name!r} {how}; expected one on the structure beyond them")
    place = joints + int(np.argmax(np.abs(row[joints:])))
    if np.count_nonzero(row) == 1 and row[place] == 1:
        return structure
    basis = np.eye(row.size)
    basis[place] = -row / row[place]
    basis[place, place] = 1 / row[place]
    return projected(structure, basis)


def projected(structure: Structure, basis: Array) -> Structure:
    """Return a structure in the coordinates of a basis, shape (whole, n), whose first ones are the joints' angles."""

    def project(matrix: Array) -> Array:
        reduced = basis.T @ matrix @ basis
        return (reduced + reduced.T) / 2

    return Structure(
        project(structure.mass), project(structure.stiffness), project(structure.loss), structure.hinges,
        {name: row @ basis for name, row in structure.points.items()}, structure.loss_frequency,
        viscous=None if structure.viscous is None else project(structure.viscous), basis=basis,
    )  # fmt: skip
