"""Methods to compute orbits: the contract that every method fulfils, and the registry of all methods."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from gapwalk.errors import ModelError
from gapwalk.model.bounds import Bounded
from gapwalk.model.registry import Registry

if TYPE_CHECKING:
    from gapwalk.model.system import System
    from gapwalk.orbit.orbit import Orbit
    from gapwalk.orbit.orbit_equation import OrbitEquation


class Method(Bounded):
    """Method to pose orbits as equations, with its options, such as `Shooting` and `Balance`.

    To add one, write a frozen dataclass that derives from this, and register it: its fields are its options, `pose`
    makes its equation (see `OrbitEquation`). `find_orbit`, walks, special points, verification, model files and the
    command line then know it by its name.

    Its orbits are of the class `Orbit`, or of a class that derives from it, names the method in `found_by`, and
    overrides `truncation` and `harmonics`. Three functions depend on the class of the orbits, and may be registered
    with a method: the space in which orbits are distinguished (`gapwalk.bifurcation.orbit_on_branch.space_of`), the
    plane in which loci are followed (`gapwalk.bifurcation.loci.follow_locus.plane_of`), and the residual of Fourier
    lines (`gapwalk.verification.verify_orbits.imbalance`). Their defaults suit unknowns that are states at some
    angles, one after the other, the first at theta = 0.

    Attributes
    ----------
    name
        Name in model files, tables and JSON.
    columns
        Attributes of its orbits that tables and JSON include.
    needs_contacts
        Clause that says why it cannot be used without contacts; empty if it can.

    Examples
    --------
    >>> gw.Shooting(segments=2).name
    'shooting'
    """

    __slots__ = ()

    name: ClassVar[str]
    columns: ClassVar[tuple[str, ...]] = ()
    needs_contacts: ClassVar[str] = ""

    @staticmethod
    def known() -> tuple[type[Method], ...]:
        """Return all methods, the default first."""
        return tuple(METHODS.values())

    @staticmethod
    def named(name: str) -> type[Method]:
        """Return the method of a name, such as ``shooting``."""
        return METHODS.named(name)

    @classmethod
    def resolving(cls, orbit: Orbit, count: int) -> Method:
        """Return the method of this class that fits an orbit whose equation has `count` unknowns."""
        return cls()

    def pose(self, system: System, parameter: str | None = None, period: int = 1) -> OrbitEquation:
        """Pose the orbits of a system over `period` forcing periods as an equation, optionally along a parameter."""
        raise NotImplementedError(f"the method {self.name} has no equation for orbits; its class must define pose()")

    def suited_to(self, system: System) -> Method:
        """Return the method by which studies find the orbits of a system: another one if that is far faster."""
        return self

    def for_loci(self) -> Method:
        """Return the method by which loci are followed from an orbit that this method found."""
        return self

    @staticmethod
    def words(orbits: Sequence[Orbit]) -> str:
        """Describe the resolution of orbits, such as their number of harmonics, in a sentence; empty if it has none."""
        return ""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        """Return the schema of options that contain a method: any method, or one class of methods by its fields."""
        from pydantic_core import core_schema  # imported late: walks need no files

        return core_schema.is_instance_schema(Method) if cls is Method else handler(source)


METHODS: Registry[type[Method]] = Registry("method")


def register(method: type[Method]) -> None:
    """Register a method under its name; a class that is defined again replaces its earlier definition.

    Parameters
    ----------
    method
        The class of the method.

    Raises
    ------
    ModelError
        If another method has the name.

    Examples
    --------
    >>> gw.methods.register(gw.Shooting)  # as gapwalk has done
    >>> gw.methods.Method.named("shooting")
    <class 'gapwalk.orbit.shooting.Shooting'>
    """
    METHODS.add(method.name, method)


def chosen(method: Method | None) -> Method:
    """Return the method that was asked for, or the default."""
    if method is None:
        return Method.known()[0]()
    if not isinstance(method, Method):
        raise ModelError(
            f"method is {method!r}; write method=gw.Balance() for harmonic balance, or method=gw.Shooting()"
        )
    return method
