"""The whole graph, one process a node: ros2 launch gesture_bot gesture_bot.launch.py NAME:=VALUE ..."""

from launch.actions import DeclareLaunchArgument, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from gesture_bot.base.files import config_dir
from gesture_bot.nodes.graph import ARGUMENTS, NAMESPACE, NODES
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the nodes of nodes/graph.py; they stand and fall together.

    The others go on without a node that has a switch.
    """
    values = {
        argument.name: ParameterValue(LaunchConfiguration(argument.name), value_type=type(argument.default))
        for argument in ARGUMENTS
    }
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                argument.name, default_value=str(argument.default), description=argument.description
            )
            for argument in (*ARGUMENTS, NAMESPACE)
        ]
        + [
            Node(
                package="gesture_bot",
                executable=node.name,
                name=node.name,
                namespace=LaunchConfiguration(NAMESPACE.name),
                parameters=[
                    str(config_dir() / "gesture_bot.yaml"),
                    {name: values[name] for name in node.arguments},
                ],
                output="screen",
                condition=IfCondition(LaunchConfiguration(node.switch)) if node.switch else None,
                on_exit=None if node.switch else Shutdown(),
            )
            for node in NODES
        ]
    )
