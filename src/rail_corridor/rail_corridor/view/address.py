"""The address that the live page is served on."""

from __future__ import annotations

import errno
import ipaddress
import socket

from rail_corridor.errors import InputError


def bind(host: str, port: int) -> socket.socket:
    """Socket that listens on an address.

    Raises
    ------
    InputError
        If the host is none of this machine, or the port is taken.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (OSError, UnicodeError):
        raise InputError("there is no such host", field="--host", value=host) from None
    bound = socket.socket(family, kind, protocol)
    try:
        bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        bound.bind(address)
        bound.listen(64)
    except OSError as error:
        bound.close()
        reasons = {
            errno.EADDRINUSE: ("--port", port, f"is in use on {host}; give another with --port"),
            errno.EACCES: ("--port", port, "may only be used by the administrator"),
            errno.EADDRNOTAVAIL: ("--host", host, "is no address of this machine"),
        }
        field, value, reason = reasons.get(
            error.errno or 0, ("--host", host, error.strerror or "cannot be served on")
        )
        raise InputError(reason, field=str(field), value=value) from None
    return bound


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach what listens on ``host``."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
