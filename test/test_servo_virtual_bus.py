"""The virtual bus, as an independent client with the DynamixelSDK sees it."""

import itertools
import math
import os
import signal
import subprocess
import sys
import time

import pytest
from dynamixel_sdk import COMM_SUCCESS, GroupSyncRead, GroupSyncWrite, PortHandler, Protocol2PacketHandler
from dynamixel_sdk.protocol2_packet_handler import (
    ERRBIT_ALERT,
    ERRNUM_ACCESS,
    ERRNUM_CRC,
    ERRNUM_DATA_LENGTH,
    ERRNUM_DATA_LIMIT,
    ERRNUM_DATA_RANGE,
    ERRNUM_INSTRUCTION,
)

from gesture_bot.base.errors import InvalidValueError
from gesture_bot.retarget.robot import load_robot
from gesture_bot.servo.virtual_bus import VirtualBus
from gesture_bot.servo.virtual_servo import ServoSpec, VirtualServo
from gesture_bot.servo.virtual_wire import HEADER, VirtualWire, status_packet, with_crc

pytestmark = pytest.mark.live

SDK = Protocol2PacketHandler()
TORQUE, WATCHDOG, PROFILE_ACCELERATION, PROFILE_VELOCITY = 64, 98, 108, 112
GOAL, VELOCITY, POSITION = 116, 128, 132


class Wire(PortHandler):
    """A port straight to the wire, without a pseudo-terminal or a clock."""

    def __init__(self, wire: VirtualWire):
        super().__init__("")
        self.wire = wire
        self.answer = b""

    def clearPort(self):  # noqa: N802
        self.answer = b""

    def writePort(self, packet):  # noqa: N802
        self.answer += self.wire.receive(bytes(packet))
        return len(packet)

    def readPort(self, length):  # noqa: N802
        data, self.answer = self.answer[:length], self.answer[length:]
        return data


@pytest.fixture
def port() -> Wire:
    specs = [
        ServoSpec(1, "XL430-W250", 2048),
        ServoSpec(2, "XM430-W350", 1000),
        ServoSpec(9, "XL430-W250", 3000),
    ]
    return Wire(VirtualWire(map(VirtualServo, specs)))


def write(port, servo_id, address, size, value):
    call = {1: SDK.write1ByteTxRx, 2: SDK.write2ByteTxRx, 4: SDK.write4ByteTxRx}[size]
    result, error = call(port, servo_id, address, value)
    assert result == COMM_SUCCESS
    return error


def test_the_sdk_finds_the_servos_of_a_robot_on_the_pseudo_terminal():
    robot = load_robot("toa")
    with VirtualBus(robot) as bus:
        port = PortHandler(bus.port)
        assert port.openPort()
        found, result = SDK.broadcastPing(port)
        assert result == COMM_SUCCESS
        assert sorted(found) == sorted(servo.id for servo in robot.servos)
        assert SDK.ping(port, robot.servos[0].id) == (1020, COMM_SUCCESS, 0)
        assert SDK.ping(port, 200)[1] != COMM_SUCCESS
        port.closePort()
        assert port.openPort(), "the line outlives a client that hangs up"
        assert SDK.ping(port, robot.servos[0].id)[1] == COMM_SUCCESS
        port.closePort()
    assert not os.path.exists(bus.port)


def test_faults_of_a_running_bus_are_set_in_words_and_taken_back():
    robot = load_robot("toa")
    with VirtualBus(robot) as bus:
        port = PortHandler(bus.port)
        assert port.openPort()

        def answers(servo_id):
            return any(SDK.ping(port, servo_id)[1] == COMM_SUCCESS for _ in range(3))

        bus.inject("silent=14 unplugged=21,22")
        deadline = time.monotonic() + 3
        while answers(14) and time.monotonic() < deadline:
            pass
        assert [answers(servo_id) for servo_id in (11, 14, 21, 22)] == [True, False, False, False]
        bus.inject("")
        while not answers(14) and time.monotonic() < deadline:
            pass
        assert answers(14) and answers(21)
        with pytest.raises(InvalidValueError, match="'rain'; valid: bit_noise, lost_replies, silent"):
            bus.inject("rain=1")
        with pytest.raises(InvalidValueError, match="ID: 99; valid: 11, 12"):
            bus.inject("stuck=99")
        port.closePort()


def test_the_bus_dies_with_its_parent():
    code = (
        "import os, time; from gesture_bot.servo.virtual_bus import VirtualBus;"
        "from gesture_bot.retarget.robot import load_robot;"
        "bus = VirtualBus(load_robot('toa')).__enter__(); print(bus.port, flush=True); time.sleep(60)"
    )
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    port = parent.stdout.readline().strip()
    assert os.path.exists(port)
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 3
    while os.path.exists(port) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not os.path.exists(port)


def test_the_bus_of_a_robot_is_served_from_the_command_line():
    command = [sys.executable, "-m", "gesture_bot.servo.virtual_bus", "toa"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        port = PortHandler(process.stdout.readline().strip())
        assert port.openPort()
        assert SDK.ping(port, 11) == (1020, COMM_SUCCESS, 0)
        process.send_signal(signal.SIGINT)
        assert process.wait(3) == 0


def test_an_unknown_robot_is_named_without_a_traceback():
    command = [sys.executable, "-m", "gesture_bot.servo.virtual_bus", "r2d2"]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == 1
    assert "'r2d2'; valid: toa" in ended.stderr and "Traceback" not in ended.stderr
    asked = subprocess.run([*command[:-1], "-h"], capture_output=True, text=True)
    assert asked.returncode == 0 and "usage" in asked.stdout


def test_group_read_and_write(port):
    goals = GroupSyncWrite(port, SDK, GOAL, 4)
    for servo_id, goal in ((1, 2100), (9, 2900)):
        goals.addParam(servo_id, list(goal.to_bytes(4, "little")))
    assert goals.txPacket() == COMM_SUCCESS
    for fast in (False, True):
        group = GroupSyncRead(port, SDK, GOAL, 4)
        for servo_id in (9, 1, 2):
            group.addParam(servo_id)
        assert (group.fastSyncRead() if fast else group.txRxPacket()) == COMM_SUCCESS
        assert [group.getData(servo_id, GOAL, 4) for servo_id in (1, 2, 9)] == [2100, 1000, 2900]


def test_a_fast_sync_read_breaks_off_at_a_missing_servo(port):
    group = GroupSyncRead(port, SDK, POSITION, 4)
    for servo_id in (1, 5, 2):
        group.addParam(servo_id)
    assert group.fastSyncRead() != COMM_SUCCESS


def test_stuffing(port):
    # The bytes FF FF FD in a value must not look like the beginning of a packet.
    assert status_packet(1, 0, b"\xff\xff\xfd\x01").count(HEADER[:3]) == 2
    port.answer = status_packet(1, 0, b"\xff\xff\xfd\x01")
    port.setPacketTimeout(100)
    assert SDK.readRx(port, 1, 4)[0] == [0xFF, 0xFF, 0xFD, 0x01]
    stuffed = [*HEADER, 1, 10, 0, 3, GOAL, 0, 0xFF, 0xFF, 0xFD, 0xFD, 0xFF]
    port.writePort(with_crc(stuffed))
    assert port.wire.servos[1].get("Goal Position") == 2048, "-131073 is out of the position limits"
    assert port.answer[8] == ERRNUM_DATA_LIMIT


def test_rubbish_between_packets_is_skipped_and_split_packets_are_joined(port):
    ping = with_crc([*HEADER, 1, 3, 0, 1])
    wire = port.wire
    assert wire.receive(b"\x00\xff\xff noise \xff" + ping[:4]) == b""
    answer = status_packet(1, 0, (1060).to_bytes(2, "little") + b"\x30")
    assert wire.receive(ping[4:]) == answer
    assert wire.receive(ping[:5] + b"\x00" + ping[6:] + ping) == answer, "a length that was damaged"


@pytest.mark.parametrize(
    ("address", "size", "value", "error"),
    [
        (POSITION, 4, 0, ERRNUM_ACCESS),  # read-only
        (999, 1, 0, ERRNUM_ACCESS),  # no register
        (11, 1, 17, ERRNUM_DATA_RANGE),
        (WATCHDOG, 1, 200, ERRNUM_DATA_RANGE),
        (GOAL, 2, 2000, ERRNUM_DATA_LENGTH),
        (GOAL, 4, 4096, ERRNUM_DATA_LIMIT),
        (11, 1, 4, 0),
        (GOAL, 4, 2000, 0),
    ],
)
def test_writes_are_checked(port, address, size, value, error):
    assert write(port, 1, address, size, value) == error


def test_errors_of_the_packet_itself(port):
    assert port.wire.receive(with_crc([*HEADER, 1, 3, 0, 1])[:-1] + b"\x00")[8] == ERRNUM_CRC
    assert SDK.factoryReset(port, 1, 0xFF)[1] == ERRNUM_INSTRUCTION


def test_eeprom_is_locked_while_torque_is_on(port):
    assert write(port, 1, 11, 1, 4) == 0
    write(port, 1, TORQUE, 1, 1)
    assert write(port, 1, 11, 1, 3) == ERRNUM_ACCESS
    write(port, 1, TORQUE, 1, 0)
    assert write(port, 1, 11, 1, 3) == 0


def test_hardware_errors_raise_the_alert_bit_and_reboot_clears_them(port):
    port.wire.servos[1].set("Hardware Error Status", 4)
    write_error = write(port, 1, TORQUE, 1, 1)
    assert write_error == ERRBIT_ALERT
    assert SDK.reboot(port, 1) == (COMM_SUCCESS, 0)
    assert SDK.read1ByteTxRx(port, 1, TORQUE)[0] == 0


def test_status_return_level(port):
    write(port, 1, 68, 1, 0)
    assert SDK.ping(port, 1)[1] == COMM_SUCCESS
    assert SDK.read1ByteTxRx(port, 1, TORQUE)[1] != COMM_SUCCESS


def test_a_joint_moves_only_with_torque_and_not_faster_than_its_profile(port):
    servo = port.wire.servos[1]
    write(port, 1, GOAL, 4, 3048)
    port.wire.advance(0.5)
    assert servo.position == 2048
    write(port, 1, PROFILE_VELOCITY, 4, 100)
    write(port, 1, TORQUE, 1, 1)
    for _ in range(30):
        port.wire.advance(0.01)
    assert SDK.read4ByteTxRx(port, 1, VELOCITY)[0] == 100
    # It is 2 / 60 s behind its profile, as the first-order position controller of a servo is.
    assert servo.position == pytest.approx(2048 + (0.3 - 2 / 60) * 100 * 0.229 / 60 * 4096, abs=1)
    assert SDK.read2ByteTxRx(port, 1, 126)[0] > 200, "Present Load"
    for _ in range(300):
        port.wire.advance(0.01)
    assert SDK.read4ByteTxRx(port, 1, POSITION)[0] == 3048
    assert servo.temperature > 25.0


def profile_of(port, servo_id):
    """Velocity and Position Trajectory, and Moving Status."""
    velocity, position = (SDK.read4ByteTxRx(port, servo_id, address)[0] for address in (136, 140))
    return velocity - (velocity >> 31 << 32), position, SDK.read1ByteTxRx(port, servo_id, 123)[0]


def test_profile_acceleration_makes_a_trapezoid_of_the_e_manuals_times(port):
    servo = port.wire.servos[1]
    write(port, 1, PROFILE_ACCELERATION, 4, 10)
    write(port, 1, PROFILE_VELOCITY, 4, 100)
    write(port, 1, TORQUE, 1, 1)
    write(port, 1, GOAL, 4, 3548)
    steps = []
    for _ in range(170):
        port.wire.advance(0.01)
        steps.append(profile_of(port, 1))
    velocity, position, status = zip(*steps, strict=True)
    # t1 = 64 * 100 / 10 ms; t2 = 1500 ticks at 100 units of 0.229 rev/min, 0.96 s; t3 = t1 + t2 = 1.6 s.
    assert (velocity[31], velocity[63], velocity[94], velocity[127]) == (50, 100, 100, 50)
    assert position[150] < 3548 == position[160] and velocity[155] > 0 == velocity[160]
    assert status[50] == 0x32 and status[162] & 0x32 == 0x30, "a trapezoid, which ends"
    for _ in range(40):
        port.wire.advance(0.01)
    assert round(servo.position) == 3548 and profile_of(port, 1)[2] == 0x31, "the joint has arrived"


def test_a_time_based_profile_takes_its_time_however_far_the_goal_is(port):
    for servo_id, goal in ((1, 2148), (9, 1000)):
        write(port, servo_id, 10, 1, 4)
        write(port, servo_id, PROFILE_ACCELERATION, 4, 300)
        write(port, servo_id, PROFILE_VELOCITY, 4, 1000)
        write(port, servo_id, TORQUE, 1, 1)
        write(port, servo_id, GOAL, 4, goal)
    steps = []
    for _ in range(110):
        port.wire.advance(0.01)
        steps.append((profile_of(port, 1), profile_of(port, 9)))
    for servo, goal in ((0, 2148), (1, 1000)):
        velocity, position, status = zip(*(step[servo] for step in steps), strict=True)
        assert position[85] != goal == position[99] and velocity[101] == 0, "1 s"
        assert velocity[14] == pytest.approx(velocity[40] / 2, abs=1), "0.3 s to accelerate"
        assert velocity[84] == pytest.approx(velocity[40] / 2, abs=1)
        assert status[50] == 0x32


def test_a_new_goal_on_the_way_changes_the_velocity_without_a_jump(port):
    servo = port.wire.servos[1]
    write(port, 1, PROFILE_ACCELERATION, 4, 20)
    write(port, 1, PROFILE_VELOCITY, 4, 150)
    write(port, 1, TORQUE, 1, 1)
    velocities = []
    for goal in (4000, 2500, 2600, 1000, 1010):
        write(port, 1, GOAL, 4, goal)
        for _ in range(35 if goal != 1010 else 300):
            port.wire.advance(0.01)
            velocities.append(profile_of(port, 1)[0])
    changes = [abs(after - before) for before, after in itertools.pairwise(velocities)]
    assert max(changes) <= math.ceil(10 / 64 * 20) + 1, "acceleration of 20, in 10 ms"
    assert min(velocities) == -150 and max(velocities) > 100
    assert round(servo.position) == 1010


def point(port, servo_id, first, address, size):
    """Let Indirect Addresses from one on point to a register."""
    for at in range(size):
        assert write(port, servo_id, first + 2 * at, 2, address + at) == 0


def test_indirect_data_gather_registers_in_both_blocks(port):
    for servo_id in (1, 2):
        point(port, servo_id, 168, POSITION, 4)
        point(port, servo_id, 176, 146, 1)
        point(port, servo_id, 578, PROFILE_VELOCITY, 4)
        point(port, servo_id, 586, GOAL, 4)
    goals = GroupSyncWrite(port, SDK, 634, 8)
    for servo_id, goal in ((1, 2100), (2, 1100)):
        goals.addParam(servo_id, list((200 | goal << 32).to_bytes(8, "little")))
    assert goals.txPacket() == COMM_SUCCESS
    assert [SDK.read4ByteTxRx(port, i, GOAL)[0] for i in (1, 2)] == [2100, 1100]
    assert [SDK.read4ByteTxRx(port, i, PROFILE_VELOCITY)[0] for i in (1, 2)] == [200, 200]
    for fast in (False, True):
        group = GroupSyncRead(port, SDK, 224, 5)
        for servo_id in (1, 2):
            group.addParam(servo_id)
        assert (group.fastSyncRead() if fast else group.txRxPacket()) == COMM_SUCCESS
        assert [group.getData(i, 224, 4) for i in (1, 2)] == [2048, 1000]
        assert [group.getData(i, 228, 1) for i in (1, 2)] == [25, 25], "temperature"


def test_an_indirect_data_inherits_the_rules_of_its_register(port):
    assert write(port, 1, 224, 1, 77) == 0, "at first it is a byte of its own"
    assert SDK.read1ByteTxRx(port, 1, 224)[0] == 77
    assert write(port, 1, 168, 2, 11) == ERRNUM_DATA_RANGE, "EEPROM"
    point(port, 1, 168, GOAL, 4)
    assert write(port, 1, 224, 4, 5000) == ERRNUM_DATA_LIMIT
    assert write(port, 1, 224, 2, 2000) == ERRNUM_DATA_LENGTH
    point(port, 1, 168, POSITION, 4)
    assert write(port, 1, 224, 4, 2000) == ERRNUM_ACCESS
    assert SDK.reboot(port, 1) == (COMM_SUCCESS, 0)
    assert SDK.read2ByteTxRx(port, 1, 170)[0] == 225, "as the factory sets it"


def test_the_watchdog_stops_a_servo_that_hears_nothing(port):
    servo = port.wire.servos[1]
    write(port, 1, PROFILE_VELOCITY, 4, 50)
    write(port, 1, TORQUE, 1, 1)
    write(port, 1, WATCHDOG, 1, 5)
    write(port, 1, GOAL, 4, 4000)
    for _ in range(20):
        port.wire.advance(0.05)
        SDK.ping(port, 9)  # any packet on the bus counts
    assert servo.velocity > 0
    port.wire.advance(0.11)
    for _ in range(20):
        port.wire.advance(0.01)
    assert servo.get("Bus Watchdog") == 0xFF
    stopped = servo.position
    assert stopped < 3500
    assert write(port, 1, GOAL, 4, 3900) == ERRNUM_DATA_RANGE
    assert write(port, 1, WATCHDOG, 1, 0) == 0
    assert write(port, 1, GOAL, 4, 3900) == 0
    port.wire.advance(0.01)
    assert servo.position > stopped
