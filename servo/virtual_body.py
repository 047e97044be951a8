"""The robot's body behind its virtual servos: its URDF in MuJoCo, with gravity and a motor at each joint.

A servo is a geared direct-current motor under a voltage: its torque is the stall torque times the share of
the full voltage, and falls to zero at the no-load speed. Links fall, sag and swing as their inertia has it; a
link for which the URDF gives neither inertia nor shape weighs a gram. The robot stands on a fixed base and
touches nothing, not even itself. Joints that no servo turns stand still, also those that mimic others.
"""

from collections.abc import Iterable

import mujoco

from gesture_bot.base.errors import RobotError
from gesture_bot.retarget.urdf_model import urdf_spec
from gesture_bot.servo.models import RPM, find_model
from gesture_bot.servo.virtual_joint import Drive
from gesture_bot.servo.virtual_servo import ServoSpec

STEP = 0.004
"""Time step [s]."""

MOTOR_TIME = 0.0415
"""Time in which a motor without load nears its speed [s]. MuJoCo Menagerie has it for an XM430-W350
(robotis_op3: armature 0.045 kg m^2, damping 1.084 N m s/rad); it is taken for all models."""

FRICTION = 0.006
"""Dry friction as a share of the stall torque, from the same source."""

COASTING = 0.1
"""Damping without torque, as a share of that with it. A guess: no source was found."""

STUCK = 1e6
"""Damping of a joint that cannot turn [N m s/rad]."""


class Body:
    """All joints of a robot that servos turn. Time passes for all when the first of them asks for it.

    Args:
        name: Name of the robot.
        urdf: Its URDF, as XML.
        servos: The servos on all buses, each with its joint.

    Raises:
        RobotError: MuJoCo cannot make a model of the URDF, or it lacks a joint.
    """

    def __init__(self, name: str, urdf: str, servos: Iterable[ServoSpec]):
        spec = urdf_spec(name, urdf)
        spec.option.timestep = STEP
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
        for equality in list(spec.equalities):  # of joints that mimic others
            spec.delete(equality)
        by_joint = {servo.joint: servo for servo in servos}
        for joint in list(spec.joints):
            if joint.name not in by_joint:
                spec.delete(joint)
                continue
            model = find_model(by_joint[joint.name].model)
            damping = model.torque / (model.speed * RPM)
            joint.armature = MOTOR_TIME * damping
            joint.frictionloss = FRICTION * model.torque
            spec.add_actuator(
                name=joint.name,
                target=joint.name,
                trntype=mujoco.mjtTrn.mjTRN_JOINT,
                biastype=mujoco.mjtBias.mjBIAS_AFFINE,
                forcelimited=True,
                forcerange=[-model.torque, model.torque],
            )
        for name in by_joint.keys() - {joint.name for joint in spec.joints}:
            raise RobotError("the URDF lacks a joint that a servo is to turn", name)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._joints = {servo.joint: BodyJoint(self, servo) for servo in by_joint.values()}

    def joint(self, servo: ServoSpec) -> "BodyJoint":
        """The joint that a servo turns."""
        return self._joints[servo.joint]

    def advance(self, time: float) -> None:
        """Let time pass until a moment since the start [s]."""
        while self.data.time + STEP <= time:
            mujoco.mj_step(self.model, self.data)


class BodyJoint:
    """A joint of a body. What its motor is told acts from the next time step on."""

    def __init__(self, body: Body, servo: ServoSpec):
        self._body, self._servo = body, servo
        self._model = find_model(servo.model)
        self._back_emf = self._model.torque / (self._model.speed * RPM)
        model, data = body.model, body.data
        joint, motor = model.joint(servo.joint), int(model.actuator(servo.joint).id)
        at, dof = int(joint.qposadr[0]), int(joint.dofadr[0])
        # Views of one number each.
        self._qpos, self._qvel = data.qpos[at : at + 1], data.qvel[dof : dof + 1]
        self._ctrl, self._force = data.ctrl[motor : motor + 1], data.actuator_force[motor : motor + 1]
        self._gain, self._bias = model.actuator_gainprm[motor], model.actuator_biasprm[motor]
        self._range, self._damping = model.actuator_forcerange[motor], model.dof_damping[dof : dof + 1]
        self._time = 0.0
        self._told = float("nan")

    def move(
        self, position: float, velocity: float, drive: Drive | None, stuck: bool, seconds: float
    ) -> tuple[float, float, float]:
        """As `virtual_joint.Joint.move`.

        The load is the torque at the joint where the model measures its current, else the voltage.
        """
        scale, stall, direction = self._model.ticks_per_radian, self._model.torque, self._servo.direction
        if position != self._told:
            self._qpos[0], self._qvel[0] = self._angle(position), 0.0
        gain = drive.stiffness * scale * stall if drive else 0.0
        self._gain[0], self._bias[1] = gain, -gain
        self._bias[2] = -drive.damping * scale * stall if drive else 0.0
        if drive:
            self._ctrl[0] = self._angle(drive.end)
            self._range[:] = -drive.limit * stall, drive.limit * stall
        self._damping[0] = STUCK if stuck else self._back_emf * (1.0 if drive else COASTING)
        self._time += seconds
        self._body.advance(self._time)
        turning = float(self._qvel[0])
        force = float(self._force[0]) if drive else 0.0
        if drive and self._model.current_unit:
            force -= self._back_emf * turning
        angle = direction * float(self._qpos[0]) + self._servo.offset
        self._told = self._model.centre + scale * angle
        return self._told, direction * scale * turning, direction * force / stall

    def _angle(self, ticks: float) -> float:
        """Angle of the joint [rad] at a position of its servo [ticks]."""
        servo = self._servo
        return servo.direction * ((ticks - self._model.centre) / self._model.ticks_per_radian - servo.offset)
