"""Messages of manoeuvres: what the nodes use of `swath_sysid.formats.manoeuvring_messages`."""
from swath_sysid.formats.manoeuvring_messages import odometry_message, odometry_reading, path_message  # noqa: F401
