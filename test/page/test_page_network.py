"""The SROS 2 policy of the page's node: see test_nodes_network.py."""

import pytest

rclpy = pytest.importorskip('rclpy')

from test_nodes_network import assert_does_what_is_allowed, watcher  # noqa: E402, F401

from swath_sysid.page.nodes.page_node import ASKED, PageNode  # noqa: E402

pytestmark = pytest.mark.dds


def page(folder):
    node = PageNode(lambda line: None)
    node._requests.get_parameters('predictor', ASKED, lambda *found: None)
    for button in ('identify', 'cancel', 'rollback', 'undo_rollback', 'push', 'accept'):
        node.press(button)
    node._requests.carry_out()
    return node


@pytest.mark.long
def test_the_policy_allows_what_the_page_does_and_no_more(watcher, tmp_path):  # noqa: F811
    assert_does_what_is_allowed('page', page, watcher, tmp_path)
