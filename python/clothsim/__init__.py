"""clothsim: a physically based cloth engine.

Units are SI everywhere: m, kg, s, N, rad; areal density in kg/m². +y is up unless a scene says otherwise.

Examples
--------
>>> import clothsim as cs
>>> scene = cs.Scene(duration=0.05, contact={"thickness": 0.005})
>>> scene.add_cloth(cs.Mesh.grid(1.0, 1.0, 11, 11), "cotton", position=(0.0, 0.51, 0.0))
>>> scene.add_collider("ball", shape={"type": "sphere", "radius": 0.5, "tolerance": 0.005})
>>> frames = cs.record(cs.Simulation(scene), progress=False)
>>> frames.positions("cloth", -1).shape
(121, 3)
"""

from clothsim import bending, collision, errors, friction, stability, study, sweep
from clothsim._core import __version__
from clothsim.animation import Animation
from clothsim.errors import (
    CheckpointError,
    ClothSimError,
    ClusterError,
    DeviceError,
    GpuUnavailable,
    IntersectingStart,
    InvalidInput,
    InvalidScene,
    MeshError,
    MissingDependency,
    OutputError,
    OutputExists,
    SimulationDiverged,
    SimulationStuck,
    SolverFailed,
)
from clothsim.material import Fabric, Material, materials
from clothsim.mesh import Mesh
from clothsim.recording import Body, Recording
from clothsim.scene import Scene
from clothsim.simulation import Frame, Plan, Simulation, record

__all__ = [
    "Animation",
    "Body",
    "CheckpointError",
    "ClothSimError",
    "ClusterError",
    "DeviceError",
    "Fabric",
    "Frame",
    "GpuUnavailable",
    "IntersectingStart",
    "InvalidInput",
    "InvalidScene",
    "Material",
    "Mesh",
    "MeshError",
    "MissingDependency",
    "OutputError",
    "OutputExists",
    "Plan",
    "Recording",
    "Scene",
    "Simulation",
    "SimulationDiverged",
    "SimulationStuck",
    "SolverFailed",
    "__version__",
    "bending",
    "collision",
    "errors",
    "friction",
    "materials",
    "record",
    "stability",
    "study",
    "sweep",
]
