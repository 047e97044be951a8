"""The one list of nodes and arguments, from which the launch file and `gesture-bot run` both draw.

Nothing here imports a node or rclpy, so that listing the graph costs nothing.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Argument:
    """A value that a user may give as NAME:=VALUE; its type is its default's."""

    name: str
    default: str | int
    description: str


@dataclass(frozen=True)
class GraphNode:
    """A node: a file of this folder, its class, and the arguments that it takes as parameters.

    One with a `switch` runs only where the argument of that name is true, always in a process of its own, and
    the others go on without it.
    """

    name: str
    class_name: str
    arguments: tuple[str, ...]
    switch: str = ""


ARGUMENTS = (
    Argument("speech", "say", "What is heard: 'say' (text on the topic `say`), or a sound file to play once"),
    Argument("text", "", "Text to speak once, or what is said in the sound file; the graph ends behind it"),
    Argument(
        "voice", "embedded", "Voice that speaks text: embedded, or of the extra espeak, espeak:LANGUAGE"
    ),
    Argument(
        "loudspeaker", "default", "Sound card that plays speech: 'default', 'off', or a part of its name"
    ),
    Argument(
        "microphone",
        "off",
        "Where others are heard: 'off', 'default', a part of a sound card's name, or 'topic' (audio_common)",
    ),
    Argument("database", "demo", "Gesture database: a file, or 'demo' (built on first use)"),
    Argument(
        "model",
        "shipped",
        "Refinement network: a file of `gesture-bot train`, 'shipped' (if it fits the database), 'none'",
    ),
    Argument("banks", "shipped", "Semantic banks: a folder of YAML files, or 'shipped'"),
    Argument("emotion", "neutral", "Emotion at the start: a name of config/emotions.yaml"),
    Argument("robot", "toa", "Robot: a name in config/robots, or a YAML file"),
    Argument(
        "port",
        "virtual",
        "Serial port of the servo bus; of several, 'left=PORT right=PORT'; or 'virtual' (simulated)",
    ),
    Argument("rviz", "false", "What RViz and Foxglove show, beside the usual topics: true or false"),
    Argument("studio", "false", "Page in the browser to see and steer the robot: true or false"),
    Argument(
        "studio_address",
        "127.0.0.1:8080",
        "Where the page is, HOST:PORT; beyond this machine it asks for a token, which the log tells",
    ),
    Argument("seed", 0, "Seed of everything that is drawn at random"),
)
"""The arguments of the graph that nodes take as parameters."""

COMMON = (
    Argument("namespace", "", "ROS namespace of the nodes and topics"),
    Argument("parameters", "", "Other parameters of the nodes: a ROS 2 parameter file (YAML)"),
)
"""Those that every node takes as ROS gives them."""

NODES = (
    GraphNode("speech_source", "SpeechSource", ("speech", "text", "voice", "emotion")),
    GraphNode("loudspeaker", "Loudspeaker", ("loudspeaker",)),
    GraphNode("microphone", "Microphone", ("microphone",)),
    GraphNode("feature_streamer", "FeatureStreamer", ()),
    GraphNode("word_recogniser", "WordRecogniser", ("banks",)),
    GraphNode("keyword_spotter", "KeywordSpotter", ("banks",)),
    GraphNode("gesture_selector", "GestureSelector", ("database", "banks", "emotion", "seed")),
    GraphNode("gesture_refiner", "GestureRefiner", ("database", "model")),
    GraphNode("retargeter", "Retargeter", ("robot",)),
    GraphNode("joy_teleop", "JoyTeleop", ("robot",)),
    GraphNode("motion_mux", "MotionMux", ("robot",)),
    GraphNode("visualizer", "Visualizer", ("robot",), switch="rviz"),
    GraphNode("studio", "Studio", ("robot", "database", "banks", "studio_address"), switch="studio"),
    GraphNode("servo_driver", "ServoDriver", ("robot", "port")),
)
"""In the order of the data; the bus comes last, so that nothing can move before all of it stands."""
