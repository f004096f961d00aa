"""What is recorded, as ROS 2 messages: standard ones where they carry our numbers exactly, our own where none does.

``sensor_msgs/Range`` for example holds 32-bit floats, and a flight that was rounded would not replay to the same
digest.  Definitions of our own are made from the reading classes, so that the two cannot drift apart; NaN and the
empty text mean "not given".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, get_type_hints

import msgspec
import numpy as np

from axialnav.fusion import readings as r
from axialnav.fusion.live.recorder.cdr import Codec
from axialnav.fusion.outcome import AxialState, Outcome

_LINE = "\n" + "=" * 80 + "\nMSG: "
_VECTOR = _LINE + "geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z"
_POINT = _LINE + "geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z"
_QUATERNION = _LINE + "geometry_msgs/Quaternion\nfloat64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1"
_TIME = _LINE + "builtin_interfaces/Time\nint32 sec\nuint32 nanosec"
_HEADER_BODY = "builtin_interfaces/Time stamp\nstring frame_id"
_HEADER = f"{_LINE}std_msgs/Header\n{_HEADER_BODY}{_TIME}"
_POSE = _LINE + "geometry_msgs/Pose\nPoint position\nQuaternion orientation" + _POINT + _QUATERNION
_POSE_COVARIANCE = _LINE + "geometry_msgs/PoseWithCovariance\nPose pose\nfloat64[36] covariance" + _POSE
_TWIST = _LINE + "geometry_msgs/Twist\nVector3 linear\nVector3 angular" + _VECTOR
_TWIST_COVARIANCE = _LINE + "geometry_msgs/TwistWithCovariance\nTwist twist\nfloat64[36] covariance" + _TWIST
_IMU = (
    "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"
)
_MULTI_ARRAY = (
    "MultiArrayLayout layout\nuint8[] data"
    + _LINE
    + "std_msgs/MultiArrayLayout\nMultiArrayDimension[] dim\nuint32 data_offset"
    + _LINE
    + "std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride"
)
_LOG = "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line"
STANDARD = {
    "sensor_msgs/msg/Imu": _IMU + _HEADER + _QUATERNION + _VECTOR,
    "sensor_msgs/msg/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data" + _HEADER,
    "geometry_msgs/msg/PoseWithCovarianceStamped": "std_msgs/Header header\nPoseWithCovariance pose"
    + _HEADER
    + _POSE_COVARIANCE,
    "nav_msgs/msg/Odometry": "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    "geometry_msgs/TwistWithCovariance twist" + _HEADER + _POSE_COVARIANCE + _TWIST_COVARIANCE,
    "rcl_interfaces/msg/Log": _LOG + _TIME,
    "std_msgs/msg/UInt8MultiArray": _MULTI_ARRAY,
}
OWN = "axialnav_msgs/msg/"
OWN_READINGS: tuple[type[r.Reading], ...] = (
    r.PixelMotion,
    r.BlurLength,
    r.WallRange,
    r.UwbRange,
    r.UwbTdoa,
    r.Height,
    r.Attitude,
)
EXPOSURE = OWN + "Exposure"
STATUS = OWN + "AxialStatus"
OUTCOME = OWN + "Outcome"
INFO_LEVEL = 20
NO_ROTATION = (0.0, 0.0, 0.0, 1.0)


def _own_definition(kind: type[r.Reading]) -> str:
    """Definition with one float64 per number and one string per text of a reading class."""
    hints = get_type_hints(kind)
    lines = ["std_msgs/Header header"]
    lines += [f"{'string' if hints[name] is str else 'float64'} {name}" for name in value_fields(kind)]
    return "\n".join(lines) + _HEADER


def value_fields(kind: type[r.Reading]) -> list[str]:
    """Fields of a reading class beside stamp and sensor, in order."""
    return [f.name for f in msgspec.structs.fields(kind) if f.name not in {"t_ns", "sensor"}]


DEFINITIONS: dict[str, str] = {
    **STANDARD,
    **{OWN + kind.__name__: _own_definition(kind) for kind in OWN_READINGS},
    EXPOSURE: "std_msgs/Header header\nfloat64 exposure_s" + _HEADER,
    STATUS: "std_msgs/Header header\nfloat64 axial_position_m\nfloat64 axial_velocity_m_s\n"
    "float64 sigma_axial_position_m\nfloat64 sigma_axial_velocity_m_s\nfloat64 blur_scale\nfloat64[8] uwb_bias_m\n"
    "float64 wall_offset_m\nuint32 flags\nuint32 resets" + _HEADER,
    OUTCOME: "std_msgs/Header header\nstring sensor\nuint8 verdict\nuint8 reason\nfloat64 nis\nfloat64 gate\n"
    "float64 weight\nfloat64[3] innovation\nfloat64[3] variance" + _HEADER,
}


@dataclass(frozen=True, slots=True)
class Encoded:
    """One message ready to be written: below which topic, of which type, its bytes."""

    topic: str
    type: str
    data: bytes


Encoder = Callable[[r.CameraFrame], tuple[str, bytes]]
Message = r.Reading | AxialState | Outcome | bytes | str


class MessageEncoder:
    """Turns what the vehicle has at hand into messages.

    Parameters
    ----------
    picture
        Turns a camera frame into (format, bytes).
    ros1
        Give headers the sequence number that ROS 1 expects in them.
    """

    def __init__(self, picture: Encoder, *, ros1: bool = False) -> None:
        self._picture = picture
        self._codecs = {name: HeaderCodec(name, text, ros1=ros1) for name, text in DEFINITIONS.items()}
        self._own = {kind: (OWN + kind.__name__, value_fields(kind)) for kind in OWN_READINGS}

    def encode(self, channel: str, t_ns: int, message: Message) -> list[Encoded]:
        """Messages for one object; ``t_ns`` is the stamp of what carries none itself."""
        topic = "/" + channel.lstrip("/")
        return [
            Encoded(topic + end, kind, self._codecs[kind].encode(v)) for end, kind, v in self._values(t_ns, message)
        ]

    def _values(self, t_ns: int, message: Message) -> Iterable[tuple[str, str, list[Any]]]:
        if isinstance(message, r.ImuSample):
            yield "", "sensor_msgs/msg/Imu", _imu(message)
        elif isinstance(message, OWN_READINGS):
            name, fields = self._own[type(message)]
            yield "", name, [*_header(message.t_ns, message.sensor), *(_plain(getattr(message, f)) for f in fields)]
        elif isinstance(message, r.CameraFrame):
            head = _header(message.t_ns, message.sensor)
            if message.exposure_s is not None:
                yield "/exposure", EXPOSURE, [*head, message.exposure_s]
            yield "", "sensor_msgs/msg/CompressedImage", [*head, *self._picture(message)]
        elif isinstance(message, r.UwbFix):
            yield "", "geometry_msgs/msg/PoseWithCovarianceStamped", _fix(message)
        elif isinstance(message, AxialState):
            yield "", "nav_msgs/msg/Odometry", _odometry(message)
            yield "/status", STATUS, _status(message)
        elif isinstance(message, Outcome):
            yield "", OUTCOME, _outcome(message)
        elif isinstance(message, bytes):
            yield "", "std_msgs/msg/UInt8MultiArray", [0, 0, message]
        elif isinstance(message, str):
            yield "", "rcl_interfaces/msg/Log", [*divmod(t_ns, 10**9), INFO_LEVEL, "axialnav", message, "", "", 0]
        else:
            raise TypeError(
                f"a {type(message).__name__} cannot be recorded; there are readings, states, bytes and text"
            )


class HeaderCodec:
    """Encoder of one message type; with ``ros1`` a sequence number of 0 comes first in its header."""

    def __init__(self, name: str, definition: str, *, ros1: bool = False) -> None:
        self._numbered = ros1 and definition.startswith("std_msgs/Header header")
        text = definition.replace(_HEADER_BODY, f"uint32 seq\n{_HEADER_BODY}") if self._numbered else definition
        self._codec = Codec(name, text)

    def encode(self, values: list[Any]) -> bytes:
        """Message from its values, header first."""
        return self._codec.encode([0, *values] if self._numbered else values)


def _header(t_ns: int, frame: str) -> list[Any]:
    return [*divmod(t_ns, 10**9), frame]


def _plain(value: Any) -> Any:
    return math.nan if value is None else value


def _imu(sample: r.ImuSample) -> list[Any]:
    unknown = [-1.0, *[0.0] * 8]
    return [
        *_header(sample.t_ns, sample.sensor),
        *NO_ROTATION,
        *unknown,
        *sample.gyro_rad_s,
        *[0.0] * 9,
        *sample.accel_m_s2,
        *[0.0] * 9,
    ]


def _fix(fix: r.UwbFix) -> list[Any]:
    covariance = [0.0] * 36
    for axis, sigma in enumerate(fix.sigma_m or ()):
        covariance[7 * axis] = sigma * sigma
    return [*_header(fix.t_ns, fix.sensor), *fix.position_m, *NO_ROTATION, *covariance]


def _odometry(state: AxialState) -> list[Any]:
    """Pose in the corridor frame, velocity in body axes (REP 105 and 103)."""
    from axialnav.models.rotations import rotation_matrix

    to_body = rotation_matrix(state.quaternion_WB).T
    pose, twist = np.zeros((6, 6)), np.zeros((6, 6))
    covariance = np.asarray(state.covariance)
    if covariance.shape[0] >= 9:
        pose[:3, :3], pose[3:, 3:] = covariance[:3, :3], covariance[6:9, 6:9]
        twist[:3, :3] = to_body @ covariance[3:6, 3:6] @ to_body.T
    w, x, y, z = state.quaternion_WB.tolist()
    velocity = (to_body @ state.velocity_m_s).tolist()
    values = [*_header(state.t_ns, "corridor"), "base_link", *state.position_m.tolist(), x, y, z, w]
    return [*values, *pose.ravel().tolist(), *velocity, 0.0, 0.0, 0.0, *twist.ravel().tolist()]


def _status(state: AxialState) -> list[Any]:
    axial = (state.axial_position_m, state.axial_velocity_m_s)
    sigmas = (state.sigma_axial_position_m, state.sigma_axial_velocity_m_s)
    other = (state.blur_scale, *state.uwb_bias_m.tolist(), state.wall_offset_m, int(state.flags), state.resets)
    return [*_header(state.t_ns, "corridor"), *axial, *sigmas, *other]


def _outcome(outcome: Outcome) -> list[Any]:
    def padded(values: tuple[float, ...]) -> list[float]:
        """Three numbers, NaN where there are fewer."""
        return [*values[:3], *[math.nan] * (3 - len(values[:3]))]

    gate = (outcome.nis, outcome.gate, outcome.weight)
    head = [*_header(outcome.t_ns, outcome.sensor), outcome.sensor, int(outcome.verdict), int(outcome.reason)]
    return [*head, *gate, *padded(outcome.innovation), *padded(outcome.variance)]
