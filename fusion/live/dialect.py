"""The MAVLink 2 dialect, imported by its full name: no environment variable has a say in what we speak.

ArduPilot's dialect contains the common messages that PX4 speaks, and VISION_POSITION_DELTA and EKF_STATUS_REPORT.
"""

from __future__ import annotations

from typing import Any

import pymavlink.dialects.v20.ardupilotmega as _dialect

mavlink: Any = _dialect
Message = Any  # generated classes, one a message, that share no useful static type
