"""A toy force law: springs that stiffen with the square of the penetration, which damp as they do."""

from gapwalk.laws import CLEARANCE, STIFFNESS, Law, Parameter, register


class Quadratic(Law):
    """``f = k xi + b xi^2 + d xi^2 v`` on either side, with the penetration ``xi``."""

    name, words = "quadratic", "springs that stiffen with the square of the penetration"
    parameters = (Parameter("drag", None, "it is the damping by the square of the penetration", 0.0, 0.0, -3, 1),)
    stage_parameters = (
        CLEARANCE,
        STIFFNESS,
        Parameter("bend", None, "it is the force by the square of the penetration", angle=-2, torque=1),
    )

    def force(self, rate, stages, numbers):
        """See `Law.force`."""
        spring = stages.total(
            s.closed * (s["stiffness"] * s.depth + s.sign * s["bend"] * (s.depth * s.depth)) for s in stages
        )
        return spring + numbers["drag"] * (stages.total(s.closed * (s.depth * s.depth) for s in stages) * rate)


register(Quadratic())
