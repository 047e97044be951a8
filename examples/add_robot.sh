#!/bin/sh
# A robot of yours, from its URDF to a film of it: examples/add_robot.sh mine.urdf
set -e
urdf=$1
robot=${urdf%.urdf}.yaml

gesture-bot robot add "$urdf" -o "$robot"    # links, rest pose and made-up servos; draws the robot, too
gesture-bot robot check "$robot"             # ends here, with status 1, if anything is bad

# Motion for a text, without ROS and faster than real time: look at it before you let the robot move.
python3 - <<'EOF'
import soundfile
from gesture_bot.speech.voice import load_voice
soundfile.write("speech.wav", load_voice("embedded").speak("Hello, I am your new robot.").samples, 16_000)
EOF
gesture-bot render speech.wav --robot "$robot" -o "${urdf%.urdf}.gif"
