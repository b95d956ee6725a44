"""The machine of a drive train: its inertias, shafts and gears, from its own topology."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gapwalk.model.drivetrain.train_assembly import TrainAssembly, TrainNumbers
from gapwalk.model.drivetrain.train_form import LinkForm
from gapwalk.model.system import System
from gapwalk.plot.machine.elements import BASE, STAGES, Body, Element, Link, Machine, Push, elements_of

MOST = 24
"""Inertias of a train that is drawn whole; of a longer one, only links with contacts are."""


def machine_of_train(system: System, assembly: TrainAssembly) -> Machine:
    """Return the machine of a train, with displacements referred to the first inertia."""
    form, numbers = assembly.form, assembly.numbers(system.values)
    speeds = np.real(numbers.speeds)
    rows = np.real(numbers.angles) / speeds[:, None]
    loads: list[list[Push]] = [[] for _ in form.inertias]
    # a displacement is the angle divided by the speed: the torque of an inertia that turns backwards pushes back
    constant, *others = numbers.torques
    for part, sizes, lines in zip(form.acting, others, numbers.sizes[1:], strict=True):
        if part.reacts:
            constant = constant + sizes * sum(line.cosine for line in lines)
            continue
        for number in np.flatnonzero(sizes):
            loads[number].append(Push.of(part.form.name, float(np.real(sizes[number])) * speeds[number]))
    for number, mean in enumerate(np.real(constant).tolist()):
        if mean:
            name = "reaction" if number == form.reaction else "mean"
            loads[number].append(Push.of(name, mean * speeds[number]))
    bodies = tuple(
        Body(name, _row(row), float(mass), f"{name}''", tuple(loads[number]))
        for number, (name, row, mass) in enumerate(
            zip(form.inertias, rows.tolist(), np.real(numbers.inertia).tolist(), strict=True)
        )
    )
    displaced = {link for torque in form.torques for link, _ in torque.displaces}
    notes = []
    links = tuple(_link(system, numbers, place, place in displaced) for place in range(len(form.links)))
    if len(bodies) > MOST:
        notes.append(f"{len(bodies)} inertias: only the shafts and gears with contacts are drawn")
        links = tuple(link for link in links if any(each.contact for each in link.elements))
    if np.ptp(speeds):
        notes.append(f"angles are referred to {form.inertias[0]}")
    return Machine(bodies, links, tuple(notes), turns=True)


def _row(row: list[float]) -> tuple[tuple[int, float], ...]:
    return tuple((place, factor) for place, factor in enumerate(row) if factor)


def _link(system: System, numbers: TrainNumbers, place: int, is_displaced: bool) -> Link:
    form, speeds, ratio = numbers.form, np.real(numbers.speeds), float(np.real(numbers.ratios[place]))
    link = form.links[place]
    elements = tuple(_elements(system, link, ratio, is_displaced))
    first, second = link.ends
    if first == form.ground:  # the base is always second
        return Link((second, BASE), -int(np.sign(ratio * speeds[second])), elements)
    return Link((first, BASE if second == form.ground else second), int(np.sign(speeds[first])), elements)


def _elements(system: System, link: LinkForm, ratio: float, is_displaced: bool) -> Iterator[Element]:
    signal = f"{link.name}.torque"
    geared = f", ratio {ratio:.4g}" if link.geared else ""
    what = "gear" if link.geared else "shaft"
    label = link.name + "(θ)" * is_displaced
    named = False
    if link.rigid:
        yield Element("gear", label, f"{link.name}: rigid gear{geared}")
        return
    if link.always:
        stiffness = _with_unit(system, f"{link.name}.stiffness")
        yield Element("spring", label, f"{link.name}: {what}{geared}, stiffness {stiffness}", "", signal)
        named = True
    for form in link.parts:
        of_link = form.name == link.name
        for number, element in enumerate(elements_of(system, form, "" if not of_link or named else label)):
            yield _renamed(element, number, of_link and named)
        named = named or of_link
    damper = f"{link.name}.damping"
    if damper in system.parameters and system[damper]:
        words = f"{link.name}: damper{geared}, {_with_unit(system, damper)}"
        yield Element("damper", "" if named else label, words, "", signal)


def _renamed(element: Element, number: int, is_later: bool) -> Element:
    """Number the stages of a link after the spring that acts always, which is the first."""
    if not is_later:
        return element
    return replace(element, name=STAGES[min(number, len(STAGES) - 1)])


def _with_unit(system: System, name: str) -> str:
    unit = system.units.parameter(name) if system.units else ""
    return f"{system[name]:.4g} {unit}".strip()
