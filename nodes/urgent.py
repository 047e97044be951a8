"""What must not wait for anything else in the process: a stop."""

import threading

from rclpy.executors import SingleThreadedExecutor
from rclpy.task import Future

from gesture_bot.nodes.node import GestureNode, until_shutdown


class UrgentNode(GestureNode):
    """A small node beside another, in a thread of its own; it sleeps until it is called.

    In one process, all other nodes share a thread, and each waits for what the others are at.

    Args:
        owner: The node whose namespace and remappings count.
    """

    def __init__(self, owner: GestureNode):
        # A name given to the process, as `ros2 launch` does, is the owner's.
        super().__init__(
            f"{owner.get_name()}_urgent",
            namespace=owner.get_namespace(),
            context=owner.context,
            use_global_arguments=False,
            start_parameter_services=False,
        )
        self._loop = SingleThreadedExecutor(context=owner.context)
        self._loop.add_node(self)
        self._ended = Future()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def destroy_node(self) -> None:
        """End the thread, too."""
        self._ended.set_result(None)
        self._thread.join()
        self._loop.shutdown()  # only now: it takes apart what a thread that spins still uses
        super().destroy_node()

    def _spin(self) -> None:
        with until_shutdown(self.context):
            self._loop.spin_until_future_complete(self._ended)
