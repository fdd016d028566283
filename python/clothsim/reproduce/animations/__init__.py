"""The animations of Wong 2010, by formula: no dynamics, any number of triangles, each frame by itself.

The paper's own are not published. These have what its text and pictures name: how many triangles, what touches what,
and motion by a part of an edge per frame, as its example has it. Cloth starts free of intersections; it lies within the
thickness of bodies and of other cloth in many places, so that there is contact with both.

| file | what it holds |
|---|---|
| `animation` | a sequence of frames |
| `bodies` | meshes of what the cloth touches |
| `pleats` | folds that bulge over each other |
| `drape` | cloth over a body: bumpy and spinning, smooth and carried about, ridged, breathing |
| `cones` | cloth on four cones |
| `garment` | a skirt of two layers on the walking figure |
| `sets` | the paper's experiment sets one and two |
"""

from clothsim.reproduce.animations.animation import Animation, Part
from clothsim.reproduce.animations.sets import SETS, Listed

__all__ = ["SETS", "Animation", "Listed", "Part"]
