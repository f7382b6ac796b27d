"""Is there a drone? Asked before the SDK is, which would wait for three quarters of a minute."""

from __future__ import annotations

import socket

from sim_bridge.olympe.config import OlympeConfig
from uav_bt.errors import DroneError

__all__ = ["probe"]

_ADVICE = {
    "anafi": (
        "switch the drone on, join its Wi-Fi (or plug the SkyController in and say "
        "anafi:192.168.53.1), and try again"
    ),
    "sphinx": "start Sphinx and its drone, and try again",
}


def probe(config: OlympeConfig) -> None:
    """Return when somebody listens where the drone should be.

    Raises:
        DroneError: nobody does, within the time that the configuration gives.
    """
    try:
        socket.create_connection(
            (config.host, config.discovery_port), timeout=config.probe_limit_s
        ).close()
    except TimeoutError as error:
        raise DroneError(
            f"no answer from {config.where} within {config.probe_limit_s:.0f} s: "
            f"{_ADVICE[config.kind]}"
        ) from error
    except socket.gaierror as error:
        raise DroneError(f"nobody knows the host '{config.host}': check its spelling") from error
    except OSError as error:
        raise DroneError(
            f"cannot reach {config.where} ({error.strerror or error}): {_ADVICE[config.kind]}"
        ) from error
