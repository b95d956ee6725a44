"""Methods to compute orbits: the contract that every method fulfils, and the registry of all methods."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from gapwalk.errors import ModelError

if TYPE_CHECKING:
    from gapwalk.model.system import System
    from gapwalk.orbit.orbit import Orbit
    from gapwalk.orbit.orbit_equation import OrbitEquation


class Method:
    """A way to pose orbits as equations, with its options: `Shooting` is one, `Balance` another.

    To add one, write a frozen dataclass that derives from this, and register it: its fields are its options, `pose`
    makes its equation (see `OrbitEquation`). `find_orbit`, walks, special points, verification, model files and the
    command line then know it by its name.

    What it finds is an `Orbit`, or a class that derives from it and names the method in `found_by`. What else the rest
    asks of an orbit stands there: `truncation`, `harmonics`. Three things have a form of their own for each method, and
    are registered by who adds one: the space in which orbits are told apart
    (`gapwalk.bifurcation.membership.space_of`), the plane in which loci are followed
    (`gapwalk.bifurcation.loci.locus_start.plane_of`), and the lines that can be verified
    (`gapwalk.verification.balanced.imbalance`). What is there without that suits unknowns that are states at some
    angles, one after the other, the first at theta = 0.

    Attributes
    ----------
    name
        What model files, tables and JSON call it.
    columns
        What it tells of each orbit, in tables and JSON: attributes of its orbits.
    needs_contacts
        Whether it cannot be used without contacts, as a clause that says why; empty if it can.

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
        """All methods, the default first."""
        return tuple(_METHODS.values())

    @staticmethod
    def named(name: str) -> type[Method]:
        """The method of a name.

        Raises
        ------
        ModelError
            If there is none.
        """
        if name not in _METHODS:
            raise ModelError(f"there is no method {name!r}; there are {', '.join(_METHODS)}")
        return _METHODS[name]

    @classmethod
    def resolving(cls, orbit: Orbit, count: int) -> Method:
        """The method that poses an orbit of its own in so many unknowns."""
        return cls()

    def pose(self, system: System, parameter: str | None = None, period: int = 1) -> OrbitEquation:
        """The equation of the orbits of a system over `period` forcing periods, along a named parameter perhaps."""
        raise NotImplementedError(f"the method {self.name} poses no equation")

    def for_loci(self) -> Method:
        """How loci are followed from an orbit that it found."""
        return self

    @staticmethod
    def words(orbits: Sequence[Orbit]) -> str:
        """How finely some of its orbits are resolved, in a sentence; empty where that goes without saying."""
        return ""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> Any:
        """How options that hold a method are checked: any method is one; each itself by its fields."""
        from pydantic_core import core_schema  # imported late: walks need no files

        return core_schema.is_instance_schema(Method) if cls is Method else handler(source)


_METHODS: dict[str, type[Method]] = {}


def register(method: type[Method]) -> None:
    """Register a method under its name; a class that is defined again replaces its earlier definition.

    Raises
    ------
    ModelError
        If another method has the name.
    """
    known = _METHODS.get(method.name, method)
    if known.__qualname__ != method.__qualname__:
        raise ModelError(f"there is a method {method.name!r} already, {known.__qualname__}; choose another name")
    _METHODS[method.name] = method


def chosen(method: Method | None) -> Method:
    """The method that was asked for, or the default.

    Raises
    ------
    ModelError
        For what is no method.
    """
    if method is None:
        return Method.known()[0]()
    if not isinstance(method, Method):
        raise ModelError(
            f"method is {method!r}; write method=gw.Balance() for harmonic balance, or method=gw.Shooting()"
        )
    return method
