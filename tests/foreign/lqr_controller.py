"""LQR state feedback for the cart with inverted pendulum, exported with PythonFMU.

Uses the standard library only: the importer's process decides which Python runs this code, and this
Python may have no numpy.
"""

from xml.etree.ElementTree import SubElement

from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real

STATES = {"x_p": "m", "theta": "rad", "v_p": "m/s", "omega": "rad/s"}

# Largest values to be reached: each is weighted by the inverse of its square (Bryson's rule).
LARGEST_STATES = (0.1, 0.1, 1.0, 1.0)  # m, rad, m/s, rad/s
LARGEST_FORCE = 30.0  # N

# k = B' P / r with A' P + P A - P B B' P / r + Q = 0, A and B being the friction-free pendulum
# linearised about the upright position; build.py solves it and refuses other gains.
GAINS = (-300.0, -668.908002, -205.252153, -108.995437)


class LqrController(Fmi2Slave):
    """u = -(k1 x_p + k2 theta + k3 v_p + k4 omega)."""

    description = "Linear quadratic state feedback for the cart with inverted pendulum"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        for name, unit in STATES.items():
            self.declare_input(name, unit)
        for number, gain in enumerate(GAINS, start=1):
            self.declare_gain(f"k{number}", gain)
        self.register_variable(
            Real(
                "u",
                causality=Fmi2Causality.output,
                description="actuator force in N",
                getter=self.force,
            )
        )

    def declare_input(self, name, unit):
        """Adds one state of the pendulum as an input that starts at zero."""
        setattr(self, name, 0.0)
        text = f"measured {name} in {unit}"
        self.register_variable(Real(name, causality=Fmi2Causality.input, description=text))

    def declare_gain(self, name, value):
        """Adds one gain as a tunable parameter."""
        setattr(self, name, value)
        self.register_variable(
            Real(
                name,
                causality=Fmi2Causality.parameter,
                variability=Fmi2Variability.tunable,
                initial=Fmi2Initial.exact,
                description="feedback gain",
            )
        )

    def force(self):
        """The force for the present inputs."""
        gains = (self.k1, self.k2, self.k3, self.k4)
        states = (self.x_p, self.theta, self.v_p, self.omega)
        return -sum(gain * state for gain, state in zip(gains, states))

    def to_xml(self, *options):
        """The model description with the list of initial unknowns, which PythonFMU omits."""
        root = super().to_xml(*options)
        structure = root.find("ModelStructure")
        initial_unknowns = SubElement(structure, "InitialUnknowns")
        for unknown in structure.find("Outputs"):
            SubElement(initial_unknowns, "Unknown", unknown.attrib)
        return root

    def do_step(self, current_time, step_size):
        """Does nothing: the output depends directly on the inputs."""
        return True
