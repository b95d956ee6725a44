"""Systems and results that examples of several docstrings share: each page prints the lines that its example needs.

This file is read, statement by statement, and never imported: `docs/_ext/printed_examples.py`.
"""

import io

import numpy as np

import gapwalk as gw

system = gw.System(
    ["x"],
    mass=[1.0],
    damping=[0.1],
    stiffness=[1.0],
    contacts=[gw.stop("stop", {"x": 1.0}, 1.0, 20.0, impact_damping=0.2)],
    harmonics=[gw.Harmonic(0.5, {"x": 1.0})],
    frequency=0.6,
)

orbit = gw.find_orbit(system)
branch = gw.follow(orbit, "frequency", 1.6)
fold = branch.special("fold")[0]
grazing = branch.special("grazing")[0]

settled = gw.settle(system)
attractor = gw.classify(system)
impacting = gw.find_orbit(system, frequency=1.1)

diagram = gw.diagram(system, "frequency", (0.6, 1.0), max_period=2)
locus = gw.follow_locus(fold, "frequency", "stop.clearance", ((1.0, 1.6), (0.9, 1.1)))

loci = gw.bifurcation_map(system, {"frequency": (1.0, 1.6), "stop.clearance": (0.9, 1.1)}, sections=1)

family = gw.family(system, "frequency", (1.0, 1.6), over={"stop.clearance": [0.9, 1.0]})

found = gw.search(system, "frequency", [1.3], options=gw.SearchOptions(starts=8, newton_starts=4))

sweep = gw.sweep(system, "frequency", (0.6, 1.0), steps=9, points=13)

two = system.at(frequency=1.3)  # two motions are stable there
basins = gw.basins(two, {"x": (-2, 1), "x'": (-2, 2)}, 8)
shares = gw.basin_shares(two, {"x": (-2, 1)}, 20)

regimes = gw.regimes(system, {"frequency": (0.6, 1.2), "stop.clearance": (0.8, 1.2)}, 8)

bands = gw.ask.rattle_bands(system, "frequency", (1.1, 1.6), search=0)

threshold = gw.ask.threshold(
    system,
    "harmonic1.amplitude",
    (0.5, 0.05),
    {"frequency": (0.9, 1.1)},
    values=4,
    starts=2,
)

design = gw.ask.design(
    system,
    {"stop.clearance": 0.5},
    gw.ask.NoPoint("fold", (1.35, 1.42)),
    "frequency",
    (1.1, 1.5),
    search_values=0,
    starts=0,
)

tolerance = gw.ask.tolerance(
    system,
    "frequency",
    (1.6, 1.0),
    [gw.ask.Spread("stop.clearance", sd=0.02)],
    samples=8,
    check=1,
)

run = gw.ask.run_up(system, gw.ask.SpeedCourse.ramp(0.6, 1.6, 0.02))

runs = gw.ask.run_ups(system, [gw.ask.SpeedCourse.ramp(0.6, 1.6, rate) for rate in (0.02, 0.04)], bins=20)

motion = orbit.motion(64)
record = gw.measure.Record(motion.time[:-1], np.roll(motion.signal("x''")[:-1], 7))


file = """
title = "A sprung mass with a stop"
coordinates = ["x"]
stiffness = [[1.0]]
damping = [[0.1]]

[[contact]]
name = "stop"
deflection = { x = 1.0 }
clearance = 1.0
stiffness = 20.0
side = "positive"

[[harmonic]]
amplitude = 0.5
acts_on = { x = 1.0 }

[study]
kind = "response"
parameter = "frequency"
from = 1.1
to = 1.5
"""
study = gw.read_study(io.StringIO(file))
result = gw.run(study)

rubbing = gw.System(
    ["x"],
    mass=[1.0],
    damping=[0.1],
    stiffness=[1.0],
    contacts=[gw.friction("brake", {"x": 1.0}, 0.3)],
    harmonics=[gw.Harmonic(0.5, {"x": 1.0})],
    frequency=0.6,
)
slipping = gw.find_orbit(rubbing)

train = gw.train.Train(
    inertias=[
        gw.train.Inertia("engine", "0.1 kg m^2"),
        gw.train.Inertia("gear", "0.01 kg m^2"),
        gw.train.Inertia("box", "0.02 kg m^2"),
    ],
    shafts=[gw.train.Shaft("clutch", ("engine", "gear"), stiffness="1500 N m/rad", damping="2 N m s/rad")],
    gears=[
        gw.train.Gear(
            "mesh",
            ("gear", "box"),
            ratio=2,
            teeth=20,
            stiffness="1e5 N m/rad",
            damping="2 N m s/rad",
            clearance="0.1 deg",
        )
    ],
    mean={"engine": "10 N m"},
    reaction="box",
    harmonics=[gw.Harmonic("30 N m", acts_on={"engine": 1.0}, order=2)],
    speed="800 rpm",
)
driveline = train.system()

line = gw.train.Train(
    inertias=[
        gw.train.Inertia("wheel", "0.2 kg m^2"),
        gw.train.Inertia("hub", "0.01 kg m^2"),
        gw.train.Inertia("box", "0.05 kg m^2"),
    ],
    shafts=[
        gw.train.Shaft("clutch", ("wheel", "hub"), stiffness="5 N m/deg", stages=[gw.Stage("3 deg", "40 N m/deg")]),
        gw.train.Shaft("shaft", ("hub", "box"), stiffness="100 N m/deg"),
    ],
    mean={"wheel": "10 N m"},
    reaction="box",
    harmonics=[gw.Harmonic("20 N m", acts_on={"wheel": 1.0})],
    frequency="25 Hz",
).system()

scan = gw.ask.scan(
    system.at(frequency=1.2),
    [
        gw.ask.MotionClaim("period 1", {"frequency": 1.2}),
        gw.ask.PointClaim("fold", parameter="frequency", low=1.3, high=1.45, absent=True, over=(1.6, 1.1)),
    ],
    ["stop.clearance", "harmonic1.amplitude"],
    factors=(0.5,),
    neighbours=10,
    starts=2,
    workers=1,
)

backbone = gw.free.backbone(system, 1, options=gw.free.BackboneOptions(largest_amplitude=3.0))

duffing = gw.System(
    ["x"],
    mass=[1.0],
    damping=[0.02],
    stiffness=[1.0],
    contacts=[gw.force("spring", {"x": 1.0}, law="x*x*x")],
    harmonics=[gw.Harmonic(0.1, {"x": 1.0})],
)
foretold = gw.free.foretell(duffing, gw.free.backbone(duffing, 1, (0.5, 2.0)), harmonics=[1, 3])

oscillator = gw.System(
    ["x"], mass=[1.0], stiffness=[1.0], contacts=[gw.force("damper", {"x": 1.0}, law="(x*x - mu)*v", mu=-0.5)]
)
rests = gw.free.follow_rest(oscillator, "damper.mu", 1.0)
cycle = gw.free.follow_self_excited(rests.hopf_points[0], oscillator, "damper.mu", (-0.5, 1.0))

circle = gw.System(
    ["x", "y"],
    mass=[1.0, 1.0],
    damping=[0.0, 0.2],
    stiffness=[1.0, 3.0],
    contacts=[gw.force("excitation", {"x": 1.0}, law="(x*x + v*v - 1)*v")],
    harmonics=[gw.Harmonic(0.5, {"y": 1.0})],
    frequency=np.sqrt(5.0),
)
torus = gw.tori.find_torus(gw.settle(circle, [0.3, 0.2, 0.1, 0.0]))

tori = gw.tori.follow_tori(torus, "frequency", (2.21, 2.3))

ring = gw.System(
    ["x"],
    damping=[0.0],
    stiffness=[1.0],
    contacts=[gw.force("excitation", {"x": 1.0}, law="mu*(x*x + v*v - 1)*v", mu=0.1)],
    harmonics=[gw.Harmonic(0.3, {"x": 1.0})],
    frequency=3.04,
)
locking = gw.tori.find_torus(gw.settle(ring))

window = gw.tori.find_window(locking, "1/3", "frequency", 3.0, (2.9, 3.1))
tongue = gw.tori.follow_tongue(window, "frequency", "harmonic1.amplitude", ((2.9, 3.1), (0.0, 0.5)))
