"""What the page asks of the nodes: their services, called in the thread that spins the page's node."""

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from rcl_interfaces.msg import ParameterType, ParameterValue, SetParametersResult
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from std_srvs.srv import Trigger

from swath_sysid.nodes.model_intake import MAX_WAITING

RELEASE = 'simulated_craft/release'


def _plain(value: ParameterValue) -> Any:
    return parameter_value_to_python(value) if value.type <= ParameterType.PARAMETER_STRING_ARRAY else None


class PageRequests:
    """Calls services and reports one line for each answer; ``on_kept`` takes whether the model is now kept."""

    def __init__(self, node: Node, report: Callable[[str], None], on_kept: Callable[[bool], None]):
        self._node = node
        self._report = report
        self._on_kept = on_kept
        self._waiting: deque[Callable[[], None]] = deque(maxlen=MAX_WAITING)
        self._clients: dict[str, Any] = {}
        self._asked: dict[str, Any] = {}

    def press(self, button: str) -> None:
        """A button was pressed, in any thread: a service of the identifier, ``push``, ``accept`` or ``refine``."""
        if button in ('accept', 'refine'):
            self._waiting.append(partial(self._keep, button == 'accept'))
        elif button == 'push':
            self._ask(RELEASE, lambda answer: self._report('pushed and released'))
        else:
            self._ask(f'identifier/{button}', lambda answer: self._report(answer.message))

    def can_push(self) -> bool:
        """Whether there is a simulated craft."""
        return self._client(RELEASE, Trigger).service_is_ready()

    def _ask(self, service: str, on_answer: Callable) -> None:
        self._waiting.append(partial(self._call, service, Trigger, Trigger.Request(), on_answer))

    def carry_out(self) -> None:
        """Call what was asked for since the last time."""
        while self._waiting:
            self._waiting.popleft()()

    def get_parameters(self, node: str, names: list[str], on_answer: Callable[..., None]) -> None:
        """Call ``on_answer`` with the values of a node's parameters, where the node is there."""
        self._call(
            f'{node}/get_parameters',
            GetParameters,
            GetParameters.Request(names=names),
            lambda answer: on_answer(*map(_plain, answer.values)),
            quietly=True,
        )

    def _client(self, service: str, kind: Any) -> Any:
        if service not in self._clients:
            self._clients[service] = self._node.create_client(kind, service)
        return self._clients[service]

    def _call(self, service: str, kind: Any, request: Any, on_answer: Callable, quietly: bool = False) -> None:
        client = self._client(service, kind)
        if client.service_is_ready():
            if quietly and service in self._asked:
                # what is asked for all the time and never answered would be kept for ever
                client.remove_pending_request(self._asked[service])
            self._asked[service] = client.call_async(request)
            self._asked[service].add_done_callback(lambda future: on_answer(future.result()))
        elif not quietly:
            self._report(f'{client.service_name} does not answer: start the nodes with swath-sysid run')

    def _keep(self, is_kept: bool) -> None:
        """An accepted model stays until Identify is pressed: windows are not refitted by themselves."""
        parameter = Parameter('auto_identify', value=not is_kept).to_parameter_msg()

        def on_answer(answer: SetParameters.Response) -> None:
            result = answer.results[0] if answer.results else SetParametersResult(reason='another node has answered')
            if result.successful:
                self._on_kept(is_kept)
            self._report(result.reason or ('the model is kept' if is_kept else 'further releases refine the model'))

        self._call('identifier/set_parameters', SetParameters, SetParameters.Request(parameters=[parameter]), on_answer)
