"""What the manoeuvring wing hands in to the core."""

from swath_sysid.common.wings import Wing
from swath_sysid.formats.topics import ODOMETRY, STRING
from swath_sysid.manoeuvring.formats.topics import LEADS, PATH, PATH_TOPIC

WING = Wing(
    name='manoeuvring',
    order=2,
    nodes={
        'manoeuvring_identifier': 'manoeuvring.nodes.identifier',
        'manoeuvring_predictor': 'manoeuvring.nodes.predictor',
    },
    topics={
        PATH_TOPIC: PATH,
        LEADS: ODOMETRY,
        'manoeuvring/model': STRING,
        'manoeuvring_identifier/progress': 'std_msgs/msg/Float32',
    },
    other_types={
        'odometry': ODOMETRY,
        'thrusters/left/thrust': 'std_msgs/msg/Float64',
        'thrusters/right/thrust': 'std_msgs/msg/Float64',
        'manoeuvring/future_thrust': 'std_msgs/msg/Float64MultiArray',
    },
    model_parameters={'manoeuvring_identifier': 'model_path', 'manoeuvring_predictor': 'model_file'},
    read_model='manoeuvring.formats.model_file read_manoeuvring_model',
    papers={'wam-v': 'manoeuvring.cli.paper repeat_study'},
    warm_up='manoeuvring.identification.refit warm_up',
    plays_bag='manoeuvring.cli.play_bag play',
)
