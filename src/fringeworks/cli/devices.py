"""``fringeworks devices``: which projectors and cameras are there."""

from __future__ import annotations

from typing import Any

from fringeworks.cli.output import JsonFlag, Output


def devices(as_json: JsonFlag = False) -> None:
    """List displays, GenICam and GenTL cameras, webcams and plug-ins, as station.toml names them.

    What is missing for a kind of device is told, with the package that brings it; it is no error.
    A LightCrafter is not looked for: it answers at 192.168.1.100 unless its address was changed.
    """
    output = Output(as_json=as_json)
    from fringeworks.devices.found import find_devices

    with output.working():
        found = find_devices()
    if found.devices:
        output.table(
            ("", "kind", "name", "in station.toml"),
            [(item.role, item.kind, item.name, _toml(item.settings)) for item in found.devices],
        )
    for kind, reason in found.reasons.items():
        output.line(f"  {kind}: {reason}")
    output.result(
        {
            "devices": [
                {
                    "role": item.role,
                    "kind": item.kind,
                    "name": item.name,
                    "settings": item.settings,
                }
                for item in found.devices
            ],
            "reasons": found.reasons,
        }
    )


def _toml(settings: Any) -> str:
    return ", ".join(
        f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {value}"
        for key, value in settings.items()
    )
