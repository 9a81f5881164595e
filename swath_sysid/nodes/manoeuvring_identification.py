"""What the identifier does for manoeuvres: it keeps odometry and thrust, and publishes and saves the model."""
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64, String

from swath_sysid import __version__
from swath_sysid.formats.manoeuvring_model_file import (
    manoeuvring_to_yaml,
    read_manoeuvring_model,
    write_manoeuvring_model,
)
from swath_sysid.manoeuvring.identification.refit import ManoeuvreRefitRequest, ManoeuvreRefitter
from swath_sysid.manoeuvring.identification.settings import ManoeuvringSettings
from swath_sysid.manoeuvring.motion.window import ManoeuvringWindow
from swath_sysid.nodes.health import OK, Report
from swath_sysid.nodes.kept_model import ModelFile
from swath_sysid.nodes.manoeuvring_messages import odometry_reading
from swath_sysid.nodes.qos import LATCHED, watched_publisher, watched_subscription

SENSOR = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


class ManoeuvreIdentification:
    """odometry and thrusters in, manoeuvring/model out.

    Parameters
    ----------
    node : rclpy.node.Node
    parameters : NodeParameters
        Of the identifier.
    health : IdentifierHealth
    """

    def __init__(self, node, parameters, health):
        self.parameters, self._health = parameters, health
        self._file = ModelFile(
            parameters['manoeuvre_model_path'], 'manoeuvre_model_path', read_manoeuvring_model,
            write_manoeuvring_model, health)
        known = self._file.read()
        self.refitter = ManoeuvreRefitter(known)
        self.window = ManoeuvringWindow(parameters['manoeuvre_window_s'], parameters['manoeuvre_stop_after_s'])
        self._publisher = watched_publisher(node, String, 'manoeuvring/model', LATCHED, health)
        self._kept = [
            watched_subscription(node, Odometry, 'odometry', self._on_odometry, SENSOR, health),
            *(watched_subscription(node, Float64, f'thrusters/{name}/thrust', self._thrust_taker(side), SENSOR, health)
              for name, side in (('left', 'port'), ('right', 'starboard'))),
        ]  # fmt: skip
        if known is not None:
            self._publish()

    def request(self):
        """All that a refit on the window needs.

        Raises
        ------
        InputError
            The window is empty.
        """
        settings = ManoeuvringSettings(
            mass=self.parameters['manoeuvre_mass_kg'] or None, lever=self.parameters['manoeuvre_lever_m'] or None)
        trial = self.window.trial(self.parameters['manoeuvre_thrust_input'], 'odometry')
        provenance = {
            'software': f'swath_sysid {__version__}',
            'sources': [{'topic': 'odometry', 'first_stamp_s': float(trial.time[0]), 'rows': int(trial.time.size)}],
        }
        return ManoeuvreRefitRequest(
            trial, self.refitter.model, settings, self.parameters['least_improvement'], provenance)

    def take(self, outcome):
        """Believe a better model; whether there was one, and one line about it."""
        if not self.refitter.take(outcome):
            return False, outcome.message
        return True, outcome.message + self._publish()

    def rollback(self):
        """Return to the model before; whether there was one, and one line about it."""
        if not self.refitter.rollback():
            return False, 'there is no manoeuvring model before this one'
        return True, f'back to the manoeuvring model before{self._publish()}'

    def report(self):
        """What to tell in the diagnostics."""
        return Report('manoeuvres', OK, f'{self.window.size} rows of odometry and thrust kept', {
            'rows': self.window.size, 'model': self.refitter.described, **self.window.counts})  # fmt: skip

    def _publish(self):
        """Publish the model and save it; a remark where it could not be saved."""
        self._publisher.publish(String(data=manoeuvring_to_yaml(self.refitter.model)))
        return self._file.keep(self.refitter.model)

    def _on_odometry(self, message):
        reading = odometry_reading(message)
        self.window.add_motion(
            reading.stamp, reading.surge, reading.sway, reading.yaw_rate, reading.heading, reading.x, reading.y)

    def _thrust_taker(self, side):
        return lambda message: self.window.add_thrust(side, message.data)
