"""A toy force law that is no polynomial: springs that yield, with a damper that fades as they do."""

from gapwalk.laws import Law, Parameter, QuantityKind, register


class Yielding(Law):
    """``f = (k xi + d v) / (1 + xi^2)`` on either side, with the penetration ``xi``: it jumps with the rate."""

    name, words = "yielding", "springs that yield"
    parameters = (Parameter("fading", QuantityKind.DAMPING, "it is the damping at the breakpoint", 0.0, 0.0),)

    def force(self, rate, stages, numbers):
        """See `Law.force`."""
        return stages.total(
            s.closed * ((s["stiffness"] * s.depth + numbers["fading"] * rate) / (1.0 + s.depth * s.depth))
            for s in stages
        )


register(Yielding())
