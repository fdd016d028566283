"""clothsim: a physically based cloth engine.

Units are SI everywhere: m, kg, s, N, rad; areal density in kg/m². +y is up unless a scene says otherwise.
"""

from clothsim import collision, errors
from clothsim._core import __version__
from clothsim.mesh import Mesh

__all__ = ["Mesh", "__version__", "collision", "errors"]
