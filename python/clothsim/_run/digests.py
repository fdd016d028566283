"""Fingerprints of what a run begins with."""

from __future__ import annotations

import hashlib
import json

import numpy as np

from clothsim.scene import Scene

__all__ = ["digest"]


def digest(scene: Scene) -> str:
    """Fingerprint of a scene and all its arrays."""
    sha = hashlib.sha256(scene.check().to_json().encode())
    for group in scene.assets():
        for name, arrays in sorted(group.items()):
            sha.update(name.encode())
            for array in arrays if isinstance(arrays, tuple) else (arrays,):
                if isinstance(array, np.ndarray):
                    sha.update(str(array.shape).encode() + array.tobytes())
                elif array:  # groups, a rate
                    sha.update(json.dumps(array, sort_keys=True).encode())
    return str(sha.hexdigest())
