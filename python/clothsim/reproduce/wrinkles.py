"""How wrinkled a cloth is: shared by the figures that compare folds under friction laws."""

from __future__ import annotations

import numpy as np

from clothsim._arrays import Floats
from clothsim.mesh import Mesh
from clothsim.reproduce import residual

__all__ = ["Wrinkles"]


class Wrinkles:
    """Bending of a mesh against its rest shape.

    Parameters
    ----------
    mesh : Mesh
        The undeformed cloth.
    """

    def __init__(self, mesh: Mesh) -> None:
        x = mesh.vertices
        self._hinges = residual.interior_edges(mesh.triangles)
        self._flat = residual.dihedrals(x, self._hinges)
        a, b, c, d = (x[self._hinges[:, k]] for k in range(4))
        edge = b - a
        length = np.linalg.norm(edge, axis=1)
        areas = np.linalg.norm(np.cross(edge, c - a), axis=1) + np.linalg.norm(np.cross(edge, d - a), axis=1)
        self._height = 0.5 * areas / length
        self.weights: Floats = areas / areas.sum()

    def curvature(self, x: Floats) -> Floats:
        """Change of each hinge's dihedral angle over its height, positions (n, 3) [1/m]."""
        turned = np.remainder(residual.dihedrals(x, self._hinges) - self._flat + np.pi, 2.0 * np.pi) - np.pi
        curvature: Floats = turned / self._height
        return curvature

    def rms(self, curvature: Floats) -> float:
        """Root mean square over the cloth's area [1/m]."""
        return float(np.sqrt(np.sum(self.weights * curvature**2)))
