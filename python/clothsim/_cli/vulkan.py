"""Vulkan adapters, asked of the loader itself.

Run as a module of its own (``python -m clothsim._cli.vulkan``), because a broken driver may crash the process that
asks: prints one JSON list.
"""

from __future__ import annotations

import ctypes
import ctypes.util
import json
import subprocess
import sys
from typing import Any

__all__ = ["adapters"]

_TIMEOUT = 30  # s, for a driver that hangs
_TYPES = ("other", "integrated", "discrete", "virtual", "software")
_NAME_SIZE = 256  # VK_MAX_PHYSICAL_DEVICE_NAME_SIZE
_PROPERTIES_SIZE = 2048  # VkPhysicalDeviceProperties has 824 bytes on 64-bit systems


class _ApplicationInfo(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_uint32), ("next", ctypes.c_void_p), ("name", ctypes.c_char_p), ("version", ctypes.c_uint32),
        ("engine", ctypes.c_char_p), ("engine_version", ctypes.c_uint32), ("api", ctypes.c_uint32),
    )  # fmt: skip


class _InstanceInfo(ctypes.Structure):
    _fields_ = (
        ("type", ctypes.c_uint32), ("next", ctypes.c_void_p), ("flags", ctypes.c_uint32),
        ("application", ctypes.POINTER(_ApplicationInfo)), ("layer_count", ctypes.c_uint32),
        ("layers", ctypes.c_void_p), ("extension_count", ctypes.c_uint32), ("extensions", ctypes.c_void_p),
    )  # fmt: skip


class _Properties(ctypes.Structure):
    _fields_ = (
        ("api", ctypes.c_uint32), ("driver", ctypes.c_uint32), ("vendor", ctypes.c_uint32), ("device", ctypes.c_uint32),
        ("kind", ctypes.c_uint32), ("name", ctypes.c_char * _NAME_SIZE),
        ("rest", ctypes.c_byte * _PROPERTIES_SIZE),
    )  # fmt: skip


def adapters() -> tuple[list[dict[str, str]], str]:
    """Return name, type and API version of each adapter, and what went wrong if there are none."""
    try:
        done = subprocess.run(
            [sys.executable, "-m", __name__], capture_output=True, text=True, timeout=_TIMEOUT, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return [], f"asking the Vulkan loader failed: {error}"
    if done.returncode != 0:
        return [], done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"exit code {done.returncode}"
    found: list[dict[str, str]] = json.loads(done.stdout)
    return found, "" if found else "the Vulkan loader lists no adapter"


def _ask() -> list[dict[str, str]]:
    name = ctypes.util.find_library("vulkan")
    if name is None:
        sys.exit("no Vulkan loader (libvulkan1) is installed")
    vulkan = ctypes.CDLL(name)
    application = _ApplicationInfo(type=0, name=b"clothsim", api=1 << 22)
    info = _InstanceInfo(type=1, application=ctypes.pointer(application))
    instance = ctypes.c_void_p()
    _check(vulkan.vkCreateInstance(ctypes.byref(info), None, ctypes.byref(instance)))
    try:
        count = ctypes.c_uint32()
        _check(vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), None))
        devices = (ctypes.c_void_p * count.value)()
        _check(vulkan.vkEnumeratePhysicalDevices(instance, ctypes.byref(count), devices))
        return [_describe(vulkan, device) for device in devices]
    finally:
        vulkan.vkDestroyInstance(instance, None)


def _describe(vulkan: Any, device: int | None) -> dict[str, str]:
    properties = _Properties()
    vulkan.vkGetPhysicalDeviceProperties(ctypes.c_void_p(device), ctypes.byref(properties))
    api = properties.api
    return {
        "name": properties.name.decode(errors="replace"),
        "type": _TYPES[properties.kind] if properties.kind < len(_TYPES) else "other",
        "api": f"Vulkan {api >> 22 & 0x7F}.{api >> 12 & 0x3FF}.{api & 0xFFF}",
    }


def _check(result: int) -> None:
    if result != 0:
        sys.exit(f"the Vulkan loader answers with error {result}")


if __name__ == "__main__":
    sys.stdout.write(json.dumps(_ask()))
