"""The whole graph, one process a node: ros2 launch gesture_bot gesture_bot.launch.py NAME:=VALUE ..."""

from launch.actions import DeclareLaunchArgument, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from gesture_bot.base.files import config_dir
from gesture_bot.nodes.graph import ARGUMENTS, COMMON, NODES
from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Declare the arguments and start the nodes of nodes/graph.py; they stand and fall together.

    The others go on without a node that has a switch.
    """
    settings = str(config_dir() / "gesture_bot.yaml")
    values = {
        argument.name: ParameterValue(LaunchConfiguration(argument.name), value_type=type(argument.default))
        for argument in ARGUMENTS
    }
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                argument.name,
                # Without a file of the user's, ours is given twice: a name must stand there.
                default_value=settings if argument.name == "parameters" else str(argument.default),
                description=argument.description,
            )
            for argument in (*ARGUMENTS, *COMMON)
        ]
        + [
            Node(
                package="gesture_bot",
                executable=node.name,
                name=node.name,
                namespace=LaunchConfiguration("namespace"),
                parameters=[
                    settings,
                    LaunchConfiguration("parameters"),
                    {name: values[name] for name in node.arguments},
                ],
                output="screen",
                condition=IfCondition(LaunchConfiguration(node.switch)) if node.switch else None,
                on_exit=None if node.switch else Shutdown(),
            )
            for node in NODES
        ]
    )
