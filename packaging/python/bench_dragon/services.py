"""A publisher's services in shared memory: names, opening, refusals."""

from __future__ import annotations

import pathlib
import tomllib
import typing
from typing import Any

import iceoryx2 as iox2

from bench_dragon.layouts import Message

iox2.set_log_level(iox2.LogLevel.Fatal)


class LayoutError(RuntimeError):
    """The publisher's messages have another layout than this module's."""


def new_node() -> Any:
    """Returns a node of iceoryx2, which leaves signals to Python."""
    return iox2.NodeBuilder.new().signal_handling_mode(iox2.SignalHandlingMode.Disabled).create(iox2.ServiceType.Ipc)


def open_messages(node: Any, service: str, payload: Any, header: type[Message] | None = None) -> Any:
    """Returns a publish-subscribe service, or None if it does not exist.

    `payload` is a layout, or `iox2.Slice` of one. Raises `LayoutError` if its messages have another layout.
    """
    builder = node.service_builder(iox2.ServiceName.new(service)).publish_subscribe(payload)
    try:
        return (builder.user_header(header) if header else builder).open()
    except iox2.PublishSubscribeOpenError as error:
        if "IncompatibleTypes" not in str(error):
            return None
        # `iox2.Slice[X]` names X.
        named = [*(typing.get_args(payload) or [payload]), *([header] if header else [])]
        raise layout_error(service, [layout for layout in named if issubclass(layout, Message)]) from error


def layout_error(service: str, own: list[type[Message]]) -> LayoutError:
    """Returns the error of a service whose messages have another layout than `own`."""
    here = " and ".join(layout.type_name() for layout in own)
    theirs = " and ".join(layouts_of(service)) or "another layout"
    return LayoutError(
        f'"{service}" has another layout of its messages: its publisher has {theirs}, this module reads {here}. '
        "Use the module of the publisher's version of bench-dragon; `bench-dragon --version` prints its layouts"
    )


def layouts_of(service: str) -> list[str]:
    """Returns the type names of a service, as far as iceoryx2's files contain them: the payload's name first."""
    settings = iox2.config.global_config().global_cfg
    folder = pathlib.Path(settings.root_path.to_string()) / settings.service.directory.to_string()
    for file in folder.glob(f"{settings.prefix.to_string()}*"):
        try:
            description = tomllib.loads(file.read_text())
        except (OSError, ValueError):
            continue  # Another user's, or just being written or removed.
        if description.get("service_name") == service:
            return _type_names(description.get("messaging_pattern", {}))
    return []


def _type_names(pattern: dict[str, Any]) -> list[str]:
    names = []
    for kind in pattern.values():
        for details in (value for key, value in kind.items() if key.endswith("message_type_details")):
            names += [details[part]["type_name"] for part in ("payload", "user_header")]
    return [name for name in names if name != "()"]
