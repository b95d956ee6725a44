"""Answers to keys that name a known idea of mechanics: the line to write, or the reason why it cannot be modelled.

An unknown key is often such an idea. The same list, in more words, is the page docs/reference/scope.md.
"""

from __future__ import annotations

import re
from typing import NamedTuple

PAGE = "docs/reference/scope.md"


class Idea(NamedTuple):
    """An idea of mechanics: the words by which keys are recognised, and what to write, or why it cannot be."""

    words: str
    answer: str


IDEAS = (
    Idea(
        "friction|coulomb|slip_?torque|stiction|stick|mu_?[sk]|jenkins|iwan|hysteresis",
        "dry friction is a [[friction]] with its limit, the force in slip; that of a [[contact]], a [[shaft]] or a "
        "stage is its hysteresis",
    ),
    Idea(
        "restitution|bounce|rigid_?(stop|impact)|impulse",
        'a rigid stop is a [[contact]], a [[shaft]] or a stage with stiffness = "rigid", a clearance and a restitution '
        "from 0 to 1",
    ),
    Idea(
        "backlash|gap|play|lash|freeplay|free_?play|deadband|dead_?zone|half_?gap|slack",
        "a gap is the clearance of a [[contact]] (half the backlash), or of a [[gear]] or [[shaft]]: clearance = 0.5",
    ),
    Idea(
        "stop|bumper|wall|barrier|obstacle",
        'a stop on one side is a [[contact]] with side = "positive", a clearance and a stiffness; in a drive train a '
        'stop on both sides is stage = [{ clearance = "5 deg", stiffness = "100 N m/deg" }] of a [[shaft]], and one on '
        'one side a [[force]] with law = "k*max(x - g, 0)"',
    ),
    Idea(
        "torque|moment|force|load",
        'a constant load is mean = { engine = "10 N m" }, by inertia or coordinate, above all tables; one that repeats '
        "is a [[harmonic]]",
    ),
    Idea("preload|pretension|prestress", 'a spring with a preload is a [[contact]] with law = "piecewise" and preload'),
    Idea(
        "hertz|exponent|power_?law|nonlinear\\w*|duffing|quadratic|polynomial|spring_?law|formula|expression|equation",
        'a smooth force is a [[force]] with a formula, as in law = "k*x + a*x**3", and its numbers as further keys',
    ),
    Idea("drag|stribeck|aero\\w*|viscous_?drag", 'a drag is a [[force]], as in law = "c*v*abs(v)" and c = 0.1'),
    Idea(
        "curve|table|lookup|csv|points|characteristic|data",
        'a measured spring is curve = "clutch.csv" in a [[contact]]',
    ),
    Idea(
        "mesh_?(stiffness|variation)|parametric|time_?varying|modulation|contact_?ratio|varying",
        'a stiffness that varies over the angle is a [[harmonic]] with varies = "mesh.stiffness", or a [[rectangle]]',
    ),
    Idea(
        "transmission_?error|runout|base_?(motion|displacement|acceleration)|ground_?motion|kinematic|prescribed",
        'a prescribed displacement is a [[harmonic]] with varies = "mesh.deflection"',
    ),
    Idea(
        "unbalance|imbalance|eccentric\\w*|rotating_?(mass|force)|growth_?(order|power)",
        "the force of an unbalance is a [[harmonic]] with growth = 2: it grows with the square of the frequency",
    ),
    Idea("delay|time_?delay|retard\\w*", "delays cannot be modelled: the state is that of now"),
    Idea(
        "sweep_?rate|run_?up|transient\\w*",
        'loads repeat with the excitation, whose speed may change in a [[study]] of the kind "run-up"',
    ),
    Idea(
        "noise|random|psd|stochastic",
        "loads repeat with the excitation; noise cannot be modelled",
    ),
    Idea("gyroscopic|coriolis", "gyroscopic terms belong in the matrix damping, which need not be symmetric"),
    Idea(
        "control\\w*|feedback|pid",
        "a feedback of positions and velocities belongs in stiffness and damping, or in a [[force]]",
    ),
    Idea("pressure|fluid|thermal|temperature|magnet\\w*|electric\\w*", "only mechanical coordinates exist"),
)
"""All ideas, the most specific first."""


def idea_of(key: str) -> str:
    """Return the line to write for an idea that a key names, with the page that says more; empty if it names none."""
    word = key.lower().replace("-", "_")
    for idea in IDEAS:
        if re.fullmatch(rf"(\w+_)?({idea.words})s?(_\w+)?", word):
            return f"{idea.answer} (see {PAGE})"
    return ""
