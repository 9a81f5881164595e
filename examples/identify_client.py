"""A client of the identifier that shows its progress; Ctrl-C cancels the fit and waits for its end.

python examples/identify_client.py                                  beside swath-sysid run
python examples/identify_client.py --ros-args -r __ns:=/boat1       of the nodes of a namespace
"""

import signal
import sys

import rclpy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float32
from std_srvs.srv import Trigger


def identify(node, wait_s=10.0):
    """Ask `identifier/identify`; whether a model was published, and the identifier's sentence about it."""
    ask, cancel = (node.create_client(Trigger, f'identifier/{name}') for name in ('identify', 'cancel'))
    if not ask.wait_for_service(wait_s):
        return False, f'{ask.service_name} does not answer: start the nodes with swath-sysid run'

    def show(message):
        print(f'\r{100.0 * message.data:3.0f} %', end='', file=sys.stderr, flush=True)

    node.create_subscription(Float32, 'identifier/progress', show, 10)
    answer = ask.call_async(Trigger.Request())
    try:
        while not answer.done():
            # a wait without end would hear Ctrl-C with the next message only
            rclpy.spin_once(node, timeout_sec=0.2)
    except KeyboardInterrupt:
        # it answers the first call, too: that it was cancelled
        rclpy.spin_until_future_complete(node, cancel.call_async(Trigger.Request()), timeout_sec=wait_s)
        rclpy.spin_until_future_complete(node, answer, timeout_sec=wait_s)
    print(file=sys.stderr)
    if not answer.done():
        return False, 'the identifier has not answered'
    return answer.result().success, answer.result().message


def main():
    """Print the answer; returns 0 where a model was published, else 1."""
    # a Ctrl-C must leave the node alive, to cancel; a script may have started this with Ctrl-C ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('identify_client')
    try:
        success, sentence = identify(node)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
    print(sentence)
    return 0 if success else 1


if __name__ == '__main__':
    sys.exit(main())
