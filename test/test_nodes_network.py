"""The SROS 2 policy is the graph of the nodes: nothing they do is missing in it, nothing in it is done by none."""

from xml.etree import ElementTree

import pytest

rclpy = pytest.importorskip('rclpy')

from live_bench import Bench, Spinning, start_node, start_together, stop, wait_for  # noqa: E402
from package_process import ROOT  # noqa: E402
from rclpy.serialization import serialize_message  # noqa: E402

from swath_sysid.attitude.prediction.forecaster import ForecasterSettings  # noqa: E402
from swath_sysid.cli.run import _type_of  # noqa: E402
from swath_sysid.formats.bag_replay import ReplaySettings  # noqa: E402
from swath_sysid.formats.output_bag import Recording, offered_qos, writing_bag  # noqa: E402
from swath_sysid.formats.topics import FRAMES_TOPIC, STATIC_FRAMES, TYPES  # noqa: E402
from swath_sysid.nodes.demo_monitor import Listener  # noqa: E402
from swath_sysid.nodes.parameters.table import ATTITUDE_NODES, NODES  # noqa: E402
from swath_sysid.nodes.qos import message_class  # noqa: E402
from swath_sysid.nodes.record import RecorderNode  # noqa: E402
from swath_sysid.nodes.replay import Replay  # noqa: E402

pytestmark = pytest.mark.dds

RULES = (
    ('topic', 'publish', 'publisher'),
    ('topic', 'subscribe', 'subscriber'),
    ('service', 'reply', 'service'),
    ('service', 'request', 'client'),
)


def policy():
    return ElementTree.parse(ROOT / 'config' / 'sros2_policy.xml').getroot()


def profile_of(node):
    return policy().find(f".//profile[@node='{node}']")


def allowed(profile):
    """What a profile allows, with full names: ``{'publish': {'/diagnostics', ...}, ...}``."""
    namespace, node = profile.get('ns').rstrip('/'), profile.get('node')
    found = {rule: profile.findall(f'{kind}s[@{rule}="ALLOW"]/{kind}') for kind, rule, _ in RULES}
    assert sum(map(len, found.values())) == len(profile.findall('*/*'))
    names = {rule: {entry.text.replace('~', node, 1) for entry in entries} for rule, entries in found.items()}
    return {rule: {name if name[0] == '/' else f'{namespace}/{name}' for name in names[rule]} for rule in names}


def done(watcher, node):
    """What a node has to do with the graph, in the words of a policy; nothing while it is not there."""
    if (node, '/') not in watcher.get_node_names_and_namespaces():
        return {}
    return {
        rule: {name for name, _ in getattr(watcher, f'get_{role}_names_and_types_by_node')(node, '/')}
        for _, rule, role in RULES
    }


def kinds_of(node):
    """The topics that a node may hear, with their types; without /tf, whose type PyPI lacks."""
    heard = allowed(profile_of(node))['subscribe'] - {'/clock', FRAMES_TOPIC, STATIC_FRAMES}
    return {topic: _type_of(topic if topic in TYPES else topic.lstrip('/')) for topic in heard}


@pytest.fixture(scope='module')
def watcher():
    """A node that sees all nodes on simulated time, since they hear /clock only then."""
    bench, simulated = Bench(), ('-p', 'use_sim_time:=true')
    others = (start_node(node, *simulated) for node in NODES[len(ATTITUDE_NODES) :])
    processes = [start_together(*simulated), *others]
    # what no node of ours publishes is recorded as well
    for topic, kind in kinds_of('record').items():
        bench.publisher(message_class(kind), topic)
    try:
        yield bench.node
    finally:
        bench.close()
        for process in processes:
            stop(process)


def test_the_policy_has_the_form_that_sros2_reads_and_a_profile_of_all_that_we_start():
    found = policy()
    assert found.tag == 'policy' and found.attrib == {'version': '0.2.0'}
    profiles = found.findall("enclaves/enclave[@path='/swath_sysid']/profiles/profile")
    assert [profile.get('node') for profile in profiles] == [*NODES, 'page', *STARTED]


@pytest.mark.long
@pytest.mark.parametrize('node', NODES)
def test_the_policy_allows_what_a_node_does_and_no_more(node, watcher):
    expected = allowed(profile_of(node))
    # what needs tf2_msgs, which PyPI lacks
    expected['subscribe'].discard(STATIC_FRAMES)
    if node == 'predictor':
        # with frames_at_s
        expected['publish'].remove(FRAMES_TOPIC)
    # services and topics of a node are discovered one by one, and are too many until none is missing
    wait_for(
        lambda: all(names <= done(watcher, node).get(rule, set()) for rule, names in expected.items()),
        f'all that the policy allows {node}',
    )
    assert done(watcher, node) == expected


def replay(folder):
    """Of a bag that holds all that a recorder may record."""
    with writing_bag(folder / 'all.mcap') as write:
        for topic, kind in kinds_of('record').items():
            write(topic, kind, 0, serialize_message(message_class(kind)()), [offered_qos(False, True)])
    return Replay(folder / 'all.mcap', ReplaySettings(clock=True, in_step=True), lambda: False)


STARTED = {
    'record': lambda folder: RecorderNode(Recording(folder / 'all.mcap')),
    'replay': replay,
    'demo': lambda folder: Listener('roll', ForecasterSettings().leads),
}


@pytest.mark.long
@pytest.mark.parametrize('node', STARTED)
def test_the_policy_allows_what_other_processes_of_ours_do_and_no_more(node, watcher, tmp_path):
    assert_does_what_is_allowed(node, STARTED[node], watcher, tmp_path)


def assert_does_what_is_allowed(node, started, watcher, folder):
    expected = allowed(profile_of(node))
    expected['subscribe'].discard(FRAMES_TOPIC)
    rclpy.init(args=['--ros-args', '-p', 'use_sim_time:=true'] if node == 'record' else [])
    spinning = Spinning(started(folder))
    try:
        wait_for(lambda: done(watcher, node) == expected, f'what the policy allows {node}')
    except AssertionError:
        assert done(watcher, node) == expected
    finally:
        spinning.close()
        rclpy.try_shutdown()
