"""Where the URDFs of robots that nobody here drew are, if their packages are installed."""

import sysconfig
from pathlib import Path

_PACKAGES = Path(sysconfig.get_path("purelib"))
EXTRAS = _PACKAGES / "cmeel.prefix/share/example-robot-data/robots"
"""Of example-robot-data: 130 MB, not asked for by default."""

URDFS = {
    "jvrc": _PACKAGES / "jvrc_description/urdf/jvrc1.urdf",
    "nao": _PACKAGES / "qibullet/robot_data/nao.urdf",
    "pepper": _PACKAGES / "qibullet/robot_data/pepper.urdf",
    "poppy": _PACKAGES / "poppy_torso/poppy_torso.urdf",
    "g1": EXTRAS / "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "g1_hand": EXTRAS / "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf",
    "tiago_pro": EXTRAS / "tiago_pro_description/robots/tiago_pro.urdf",
    "baxter": EXTRAS / "baxter_description/urdf/baxter.urdf",
}
"""By the robot's name."""
