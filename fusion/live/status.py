"""How it goes: one JSON object to whoever connects on the loopback interface, one line on the terminal."""

from __future__ import annotations

import json
import math
import socket
import threading
from collections.abc import Callable
from typing import Any

from axialnav.fusion.errors import ConfigError

LOOPBACK = "127.0.0.1"


class StatusServer:
    """Answers every connection on 127.0.0.1 with one line of JSON and closes it.

    Parameters
    ----------
    port
        TCP port; 0 lets the system choose one.
    status
        Makes the plain data to send.

    Raises
    ------
    ConfigError
        The port is taken.
    """

    def __init__(self, port: int, status: Callable[[], dict[str, Any]]) -> None:
        self._status = status
        try:
            self._socket = socket.create_server((LOOPBACK, port), backlog=4)
        except OSError as error:
            raise ConfigError(f"status.port {port}: {error.strerror}; choose another, or 0 for none") from None
        self._socket.settimeout(0.2)

    @property
    def port(self) -> int:
        """The port that is listened on."""
        return int(self._socket.getsockname()[1])

    def run(self, stop: threading.Event) -> None:
        """Answer until told to stop."""
        with self._socket:
            while not stop.is_set():
                try:
                    connection, _ = self._socket.accept()
                except OSError:  # nobody came
                    continue
                self._answer(connection)

    def _answer(self, connection: socket.socket) -> None:
        with connection:
            connection.settimeout(0.5)
            try:
                connection.sendall(encode(self._status()) + b"\n")
            except OSError:
                return  # whoever asked has gone


def encode(data: Any) -> bytes:
    """Strict JSON: what is not a finite number becomes null."""
    return json.dumps(_plain(data), allow_nan=False).encode()


def _plain(data: Any) -> Any:
    if isinstance(data, dict):
        return {str(key): _plain(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_plain(value) for value in data]
    if isinstance(data, float):
        return data if math.isfinite(data) else None
    return data


def status_line(status: dict[str, Any]) -> str:
    """The status in one line of about a hundred characters."""
    state, output = status["state"], status["output"]
    if state is None:
        speed = "no state yet"
    else:
        speed = f"v {state['axial_velocity_m_s']:+.2f} +-{state['sigma_axial_velocity_m_s']:.2f} m/s"
    silent = status["filter"]["silent"]
    without = f", without {', '.join(silent)}" if state is not None and silent else ""
    p99 = status["latency"]["queue"]["p99_ms"]
    behind = "-" if p99 is None else f"{p99:.1f} ms"
    return (
        f"{speed}{without} | sent {output['sent']} (reset {output['reset_counter']}) | "
        f"lost {sum(status['link']['lost'].values())}, damaged {status['link']['counts'].get('damaged', 0)}, "
        f"queue {behind} | {status['sentence']}"
    )
