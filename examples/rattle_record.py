"""Make rattle.csv: a synthetic record of a rattling clutch, as measured by an accelerometer and a speed sensor.

python examples/rattle_record.py [file]

The motion is that of the clutch of figure 8 of Padmanabhan and Singh (1995) under a mean load of 0.05 at
Omega = 0.35, with impacts on both sides. Units are physical: w = 480 rad/s, deflections are in units of 2 degrees, and
there are two forcing periods per turn. Noise is added to the acceleration; its seed is fixed, so that the file never
changes.
"""

import math
import sys

import numpy as np

import gapwalk as gw

W, BC, ORDER = 480.0, math.radians(2.0), 2  # rad/s, rad, forcing periods per turn
RATE, PERIODS = 3000, 10  # samples per second, forcing periods
PHASE, NOISE, SEED = 1.234, 0.03, 1995  # rad; in units of the model; of the noise

system = gw.paper.case("8a").at({"mean.q1": 0.05, "mean.q3": 0.05, "frequency": 0.35})
orbit = gw.settle(system).orbit
assert orbit is not None
turned = W * system.frequency * np.arange(int(PERIODS * 2 * math.pi / (W * system.frequency) * RATE) + 1) / RATE
motion = gw.integrate(system, orbit.state, 2, 20_000)  # finely enough to interpolate: to 1e-7
exact = np.interp((turned + PHASE) % (2 * math.pi), motion.theta, motion.signal("q1''"))
acceleration = BC * W**2 * (exact + np.random.default_rng(SEED).normal(0.0, NOISE, len(turned)))
speed = W * system.frequency / ORDER * 60 / (2 * math.pi)

head = f"""# SYNTHETIC RECORD, NOT A MEASUREMENT: computed by examples/rattle_record.py, with noise of a known size.
# The twist of a clutch in a light rattle: acceleration of q1 = u1 - u2 in rad/s^2, and speed of the engine in rpm.
# True: stage2.impact_damping 0.1, mean.q1 0.05, stage2.clearance 1; white noise of {NOISE * BC * W**2:.1f} rad/s^2.
time,acceleration,speed
"""
with open(sys.argv[1] if len(sys.argv) > 1 else "examples/rattle.csv", "w", encoding="utf-8", newline="\n") as file:
    file.write(head)
    for t, a in zip(np.arange(len(turned)) / RATE, acceleration, strict=True):
        file.write(f"{t:.7f},{a:.2f},{speed:.4f}\n")
