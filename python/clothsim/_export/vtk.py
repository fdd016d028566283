"""VTK PolyData per frame with a ParaView collection (PVD) that gives them their times."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from clothsim._arrays import optional
from clothsim._export.names import frame_name, unique_stems
from clothsim._files import whole_folder
from clothsim.recording import Body, Recording

__all__ = ["write"]

# What XML cannot hold, not even escaped.
_CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def write(recording: Recording, folder: Path, *, overwrite: bool = False) -> None:
    """Write ``scene.pvd`` and one ``.vtp`` per frame and body into ``folder``, which appears when all are there.

    Positions in double [m]; point data ``velocity`` [m/s] where the recording has velocities, ``uv`` where every vertex
    has one value. A static body is one file, named at every time.
    """
    pyvista = optional("pyvista", extra="view", purpose="writing VTK files")
    count = len(recording)
    with whole_folder(folder, overwrite=overwrite) as part:
        entries: list[str] = []
        stems = unique_stems(b.name for b in recording.bodies)
        for number, (body, stem) in enumerate(zip(recording.bodies, stems, strict=True)):
            faces = np.concatenate([np.full((len(body.triangles), 1), 3), body.triangles], axis=1)
            uv = _vertex_uv(body)
            for frame in range(count):
                name = f"{stem if body.static else frame_name(stem, frame, count)}.vtp"
                if frame == 0 or not body.static:
                    surface = pyvista.PolyData(recording.positions(body, frame), faces.reshape(-1))
                    if uv is not None:
                        surface.point_data["uv"] = uv
                    velocities = recording.velocities(body, frame)
                    if velocities is not None:
                        surface.point_data["velocity"] = velocities
                    (part / name).write_bytes(_bytes(surface))
                time = repr(float(recording.times[frame]))
                label = quoteattr(_CONTROL.sub("\N{REPLACEMENT CHARACTER}", body.name))
                entries.append(f'<DataSet timestep="{time}" part="{number}" name={label} file="{name}"/>')
        lines = [
            '<?xml version="1.0"?>',
            '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">',
            "<Collection>", *entries, "</Collection>", "</VTKFile>", "",
        ]  # fmt: skip
        (part / "scene.pvd").write_text("\n".join(lines), encoding="utf-8")


def _bytes(surface: Any) -> bytes:
    """The file of a surface. VTK's own writing of files brings the process down where the disk is full."""
    writer = optional("vtkmodules.vtkIOXML", extra="view", purpose="writing VTK files").vtkXMLPolyDataWriter()
    writer.SetInputData(surface)
    writer.SetDataModeToBinary()
    writer.SetWriteToOutputString(True)
    writer.Write()
    return str(writer.GetOutputString()).encode()


def _vertex_uv(body: Body) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]] | None:
    """UV per vertex (n, 2) where its corners agree."""
    if body.uv is None:
        return None
    uv = np.zeros((body.vertex_count, 2))
    uv[body.triangles] = body.uv
    return uv if np.array_equal(uv[body.triangles], body.uv) else None
