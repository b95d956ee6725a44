"""The values that a system may have: what is wrong with others, in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from gapwalk.errors import ModelError
from gapwalk.model.contact import ContactForm
from gapwalk.model.laws import HYSTERESIS, Elastic, Friction, Hysteretic, Law, Piecewise, Pushing
from gapwalk.model.problems import HALF, WITHIN, did_you_mean
from gapwalk.model.structure import Structure, Variation

_LARGEST = 1e150  # its square is finite, too
_ALONG = 1e-12  # share of the sizes of its vectors by which friction must act along its own deflection
_ANGLES = 1441  # at which what varies is bounded
_DEPENDENT = 1e-12  # share of the largest singular value below which friction would stick in two ways at once


def checked(structure: Structure, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values that a system may have; raise a ModelError with all reasons for others."""
    finite = np.isfinite(values)
    problems = [
        *(
            f"{structure.names[int(place)]} is {values[place]}; it must be a finite number"
            for place in np.flatnonzero(~finite)
        ),
        *(
            f"{structure.names[int(place)]} is {values[place]:g}; it must be at most {_LARGEST:g} in size, for its "
            "square must be a number too: choose other units"
            for place in np.flatnonzero(finite & (np.abs(values) > _LARGEST))
        ),
    ]
    if problems := problems or [*value_problems(structure, values)]:
        raise ModelError("\n".join(problems))
    return values


def value_problems(structure: Structure, values: NDArray[np.float64]) -> Iterator[str]:
    """List the errors of finite values, one sentence each."""
    problems = [*_number_problems(structure, values), *_host_problems(structure, values)]
    yield from problems or (*_dissipation_problems(structure, values), *_variation_problems(structure, values))


def _number_problems(structure: Structure, values: NDArray[np.float64]) -> Iterator[str]:
    if not values[0] > 0:
        yield f"{structure.pace} is {values[0]}; it must be > 0"
    elif values[0] < 1.0 / _LARGEST:
        yield f"{structure.pace} is {values[0]:g}; it must be at least {1.0 / _LARGEST:g}: choose other units"
    if structure.assembly:
        yield from structure.assembly.problems(values)
    else:
        n = structure.size
        yield from mass_problems(structure.coordinates, values[structure.block("mass", n, n)])
        for contact in structure.contacts:
            for vector in contact.vectors:
                if not values[structure.block(vector, n)].any():
                    yield f"{vector} is zero for every coordinate; it must name at least one that moves it"
    for load in structure.harmonics:
        if not all(name in structure.names for name in load.parameters):
            continue  # a train makes loads of its own
        given = {each.name: float(values[structure.place(f"{load.name}.{each.name}")]) for each in load.kind.parameters}
        yield from (f"{load.name}.{problem}" for problem in load.kind.problems(given))
    for contact in structure.contacts:
        names = {each.name: f"{contact.name}.{each.name}" for each in contact.law.parameters}
        if not all(name in structure.names for name in names.values()):
            continue  # a train computes the others
        own = {each: float(values[structure.place(name)]) for each, name in names.items()}
        yield from (f"{contact.name}.{problem}" for problem in contact.law.problems(own))
    inner: dict[tuple[int, int], float] = {}
    sizes = zip(structure.breakpoints, structure.clearance_sizes, strict=True)
    for (index, side, place), size in sorted(sizes, key=lambda each: (each[0].contact, -each[0].side)):
        clearance, inside = float(values[place]) * size, inner.get((index, side), -math.inf)
        if clearance < 0:
            units, name = structure.units, structure.names[place]
            shown, hint = (f"{values[place]:g} {units.parameter(name)}", HALF) if units else (clearance, WITHIN)
            yield f"{name} is {shown}; it must be >= 0: {hint}"
        elif clearance <= inside:
            yield f"{structure.names[place]} is {clearance}; it must exceed that of the stage inside it, {inside}"
        if clearance == 0.0 == inner.get((index, -side)) and structure.contacts[index].law.rebounds:
            yield (
                f"{structure.names[place]} is 0 on both sides, so that {structure.contacts[index].name} locks its "
                "deflection; leave the coordinate out, or give the gap a width"
            )
        inner[index, side] = clearance


def mass_problems(coordinates: Sequence[str], mass: NDArray[np.float64]) -> Iterator[str]:
    """List the errors of a finite mass matrix.

    A symmetric one is that of the kinetic energy, so it must be positive definite. Where equations were combined with
    each other, the matrix is not symmetric, and must only be regular.
    """
    rows = f" (its rows are {mass.tolist()})" if len(mass) < 4 else ""
    inertia = np.diagonal(mass)
    sizes = np.abs(mass).max(axis=1)
    symmetric = np.allclose(mass, mass.T, rtol=1e-9, atol=1e-12 * sizes.min())
    if symmetric and inertia.min() < 0:
        lowest = int(inertia.argmin())
        yield (
            f"mass gives {coordinates[lowest]} the inertia {inertia[lowest]:g}; it must be > 0. Write equations in "
            "which M q'' has the sign of K q"
        )
        return
    # scaled first, so that a small inertia is not taken for zero next to a large one
    unit = np.sqrt(np.where(sizes > 0, sizes, 1.0))
    scaled = mass / np.outer(unit, unit)
    if np.count_nonzero(mass) == np.count_nonzero(inertia):
        values = np.diagonal(scaled)
    else:
        values = np.linalg.eigvalsh(scaled) if symmetric else np.linalg.svd(scaled, compute_uv=False)
    if np.abs(values).min() <= 1e-13 * np.abs(values).max():
        yield (
            f"mass is singular{rows}; every coordinate needs an inertia, or damping by which it has a rate. "
            "A system that can turn as a whole is written in relative coordinates"
        )
    elif symmetric and values.min() < 0:
        yield (
            f"mass is not positive definite{rows}, so that some motions have a negative kinetic energy; check the "
            "signs and sizes of the entries off its diagonal"
        )


def _host_problems(structure: Structure, values: NDArray[np.float64]) -> Iterator[str]:
    """List the errors of friction by another contact: that contact, and the numbers by which it presses."""
    by_name = {form.name: form for form in structure.contacts}
    hosted = {form.law.host for form in structure.contacts if getattr(form.law, "by", "") == "stages"}
    for form in structure.contacts:
        law = form.law
        if isinstance(law, Hysteretic):
            for stage in form.stages:
                name = f"{form.stage_prefix(stage)}.{HYSTERESIS.name}"
                if not (given := values[structure.place(name)]) >= 0.0:
                    yield f"{name} is {given:g}; it must be >= 0: friction only takes energy"
            if form.name not in hosted:
                yield (
                    f"{form.name} has stages with hysteresis, but no friction uses it; add "
                    f'gw.friction("{form.name}_friction", ..., stages_of="{form.name}")'
                )
        if not isinstance(law, Friction) or not law.host:
            continue
        key = "normal" if law.by == "normal" else "stages_of"
        host = by_name.get(law.host)
        if host is None:
            known = [each.name for each in structure.contacts if each.stages] or ["none"]
            yield (
                f"{form.name}.{key} is {law.host!r}, which is no contact with a clearance; "
                f"{did_you_mean(law.host, known, 'there is')}"
            )
        elif law.by == "stages" and not isinstance(host.law, Hysteretic):
            yield (
                f"{form.name}.{key} is {law.host!r}, whose stages have no hysteresis; give one of them a hysteresis, "
                f"or give {form.name} a limit"
            )
        elif law.by == "normal" and (reason := _pull(host, structure, values)):
            yield f"{form.name}.{key} is {law.host!r}, {reason}"


def _pull(host: ContactForm, structure: Structure, values: NDArray[np.float64]) -> str:
    """Return the reason why the force of a contact may pull, or is no force that presses; empty if it only presses."""
    base: Law = host.law.base if isinstance(host.law, Hysteretic) else host.law
    presses = 'write law = "elastic" or "pushing", or a limit in place of the coefficient'
    if isinstance(base, Friction):
        return "which is friction itself; name the contact that presses"
    if base.rebounds:
        return "which is rigid: its force is a reaction, which friction cannot depend on; give that stop a stiffness"
    if not host.stages:
        acts = structure.expand(values)[structure.equations.block(host.push, structure.size)].any()
        return "which is a formula, without stages, and may pull; name a contact with a clearance" if acts else ""
    if type(base) not in (Elastic, Pushing, Piecewise):
        return f"whose law {base.name!r} may pull as the contact opens, because of its damping; {presses}"

    def number(name: str) -> float:
        return float(values[structure.place(name)])

    if isinstance(base, Piecewise):
        scale, offset, even = (number(f"{host.name}.{each}") for each in ("scale", "offset", "even_quadratic"))
        if scale < 0.0 or offset or even:
            return f"whose force is not 0 at the clearance, or has the sign of a pull; {presses}"
    for sign in (1, -1):
        total: dict[str, float] = {}
        for stage in (each for each in host.stages if sign in each.side.signs):
            for each in base.stage_parameters[1:]:
                total[each.name] = total.get(each.name, 0.0) + number(f"{host.stage_prefix(stage)}.{each.name}")
            for name in ("preload", "stiffness", "cubic"):
                if total.get(name, 0.0) < 0.0:
                    return f"whose force may pull, for its {name} beyond a clearance is {total[name]:g}; {presses}"
    return ""


def _dissipation_problems(structure: Structure, values: NDArray[np.float64]) -> Iterator[str]:
    """List friction and rigid stops that would feed energy in, and friction whose reactions are not determined."""
    forms = structure.contacts
    found = [place for place, form in enumerate(forms) if form.law.is_dry or form.law.rebounds]
    if not found:
        return
    plain, n = structure.equations, structure.size
    expanded = structure.expand(values)
    ways = np.array([expanded[plain.block(forms[place].vectors[0], n)] for place in found])
    with np.errstate(all="ignore"):
        table = structure.assembly.accelerations(values) if structure.assembly else None
        if table is not None:
            pushes = table[:, [2 * n + place for place in found]]
        else:
            pushed = np.array([expanded[plain.block(forms[place].push, n)] for place in found])
            try:
                pushes = np.linalg.solve(expanded[plain.block("mass", n, n)], pushed.T)
            except np.linalg.LinAlgError:  # it is reported as such
                return
        moved = ways @ pushes
    if not np.isfinite(moved).all():
        return
    sizes = np.linalg.norm(ways, axis=1) * np.linalg.norm(pushes, axis=0)
    for place, own, size in zip(found, np.diagonal(moved), sizes, strict=True):
        form = forms[place]
        if not own > _ALONG * size and size > 0.0:
            what = "friction that slips" if form.law.is_dry else "an impact"
            yield (
                f"{form.name}.force accelerates its own deflection by {own:.4g} per unit of force, which must be > 0: "
                f"{what} would feed energy in; change its sign, or leave it out: by default it is the deflection"
            )
            return
    rigid = [place for place, index in enumerate(found) if forms[index].law.is_dry and not forms[index].law.has_memory]
    yield from _sticking_problems([forms[found[place]].name for place in rigid], moved[np.ix_(rigid, rigid)])


def _variation_problems(structure: Structure, values: NDArray[np.float64]) -> Iterator[str]:
    """List numbers of friction and rigid stops that leave their bounds over the angle, or must not vary."""
    for variation in structure.variations:
        form = structure.contacts[variation.contact]
        if problems := [*_friction_problems(structure, variation)]:
            yield from problems
            continue
        law, name = form.law, variation.name
        prefix = form.name if variation.stage < 0 else form.stage_prefix(form.stages[variation.stage])
        least, most = {"restitution": (0.0, 1.0), "static": (1.0, math.inf)}.get(name, (0.0, math.inf))
        of_friction = law.is_dry and name not in law.arguments
        if not (of_friction or name == HYSTERESIS.name or (law.rebounds and name == "restitution")):
            continue
        value = float(values[structure.place(f"{prefix}.{name}")])
        low, high = (value * (1.0 + each) for each in _wave(structure, values, variation))
        if low < least - _ALONG or high > most + _ALONG:
            bounds = f">= {least:g}" if most == math.inf else f"between {least:g} and {most:g}"
            yield f"{prefix}.{name} varies from {low:.4g} to {high:.4g} over the angle; it must be {bounds}"


def _friction_problems(structure: Structure, variation: Variation) -> Iterator[str]:
    """List the numbers of friction that cannot vary: the speed of a base, the stiffness of a Jenkins element."""
    varied = structure.contacts[variation.contact]
    if varied.law.is_dry and variation.name == "speed":
        yield (
            f"{varied.name}.speed varies over the angle, but the speed of a base is constant; a base that shakes as "
            f'a cos(theta) is a load with varies = "{varied.name}.deflection" and the amplitude -a'
        )
    if varied.law.has_memory and variation.name == "stiffness":
        yield f"{varied.name}.stiffness varies over the angle; only the limit of friction can: vary {varied.name}.limit"
    if not any(structure.harmonics[load].kind.has_levels for load, _ in variation.loads):
        return
    for place in structure.memories:
        form, host = structure.contacts[place], structure.host(place)
        by = getattr(form.law, "by", "")
        pressed = host == variation.contact and (by == "normal" or variation.name == HYSTERESIS.name)
        if pressed or (place == variation.contact and variation.name == "limit"):
            yield (
                f"the force in slip of {form.name} jumps with {varied.name}.{variation.name}, but a spring in series "
                "cannot follow a jump: vary it by harmonics, or leave the stiffness out"
            )


def _wave(structure: Structure, values: NDArray[np.float64], variation: Variation) -> tuple[float, float]:
    """Return the smallest and the largest fraction by which a number varies over the angle."""
    theta = np.linspace(0.0, 2.0 * np.pi, _ANGLES)
    wave, low, high = np.zeros(_ANGLES), 0.0, 0.0
    frequency = float(values[0]) * structure.frequency
    for number, factor in variation.loads:
        load = structure.harmonics[number]
        numbers = [float(values[structure.place(name)]) for name in load.parameters]
        if load.kind.has_levels:
            ends = [factor * each for each in load.levels(frequency, numbers)[:2]]
            low, high = low + min(ends), high + max(ends)
            continue
        for order, cosine, sine in load.lines(frequency, numbers):
            wave += factor * (cosine * np.cos(order * theta) + sine * np.sin(order * theta))
    return low + float(wave.min()), high + float(wave.max())


def _sticking_problems(names: Sequence[str], moved: NDArray[np.float64]) -> Iterator[str]:
    """List rigid friction that sticks in two ways at once, from the matrix E M^-1 D of its elements."""
    if len(names) < 2:
        return
    unit = np.sqrt(np.diagonal(moved))
    scaled = moved / np.outer(unit, unit)
    _, sizes, right = np.linalg.svd(scaled)
    if sizes[-1] > _DEPENDENT * sizes[0]:
        return
    shares = np.abs(right[-1])
    together = [name for name, share in zip(names, shares, strict=True) if share > 1e-6]
    words = " and ".join((", ".join(together[:-1]), together[-1]))
    if len(together) == 2:
        yield (
            f"{words} stick on one deflection, and nothing says how they share its force; "
            "write one friction with the sum of their limits, or give one of them a stiffness"
        )
    else:
        yield (
            f"{words} stick in more ways than the system can move, and nothing says how they share the force "
            "between them; give one of them a stiffness"
        )
