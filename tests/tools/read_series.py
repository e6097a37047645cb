"""Reads every file that a PVD series of `simulate` lists, with VTK, and checks what only a reader can know.

usage: read_series.py FOLDER      (exit 0 good, 1 bad, 77 VTK is not installed)
Volume: Lagrange wedges, no reader error, time as in the series, moved points = rest points + displacement_mm.
Surface: triangles, magnitude field = length of the displacement field.
"""
import math
import pathlib
import sys
import xml.etree.ElementTree as xml

try:
    import vtkmodules.all as vtk
except ImportError as error:
    print(f"skipped: no VTK for this Python ({error})")
    sys.exit(77)


def read(reader, path):
    errors = []
    reader.AddObserver("ErrorEvent", lambda *_: errors.append("error"))
    reader.SetFileName(str(path))
    reader.Update()
    assert not errors and not reader.GetErrorCode(), f"VTK reports an error in {path}"
    return reader.GetOutput()


def series(path):
    return [(float(s.get("timestep")), path.parent / s.get("file")) for s in xml.parse(path).iter("DataSet")]


def largest_difference(a, b):
    return max((abs(x - y) for x, y in zip(a, b)), default=0.0)


folder = pathlib.Path(sys.argv[1])
volumes = [(t, read(vtk.vtkXMLUnstructuredGridReader(), f)) for t, f in series(folder / "frames.pvd")]
surfaces = [(t, read(vtk.vtkXMLPolyDataReader(), f)) for t, f in series(folder / "surface.pvd")]
assert len(volumes) == len(surfaces) > 1, "both series list the same frames"
assert all(a[0] < b[0] for a, b in zip(volumes, volumes[1:])), "time increases"
for time, data in volumes + surfaces:
    stored = data.GetFieldData().GetArray("TimeValue").GetValue(0)
    assert stored == time, f"time {stored} in the file, {time} in the series"

rest = volumes[0][1]
for time, grid in volumes:
    assert grid.GetCellType(0) == vtk.VTK_LAGRANGE_WEDGE and grid.GetNumberOfPoints() == rest.GetNumberOfPoints()
    moved = grid.GetPointData().GetArray("displacement_mm")
    for i in range(grid.GetNumberOfPoints()):
        expected = [x + u for x, u in zip(rest.GetPoint(i), moved.GetTuple3(i))]
        assert largest_difference(grid.GetPoint(i), expected) < 1e-12, f"point {i} at time {time}"
for time, surface in surfaces:
    assert surface.GetNumberOfPolys() > 0
    moved = surface.GetPointData().GetArray("displacement_mm")
    length = surface.GetPointData().GetArray("displacement_magnitude_mm")
    for i in range(surface.GetNumberOfPoints()):
        assert abs(math.hypot(*moved.GetTuple3(i)) - length.GetValue(i)) < 1e-12
assert surfaces[-1][1].GetPointData().GetArray("displacement_magnitude_mm").GetRange()[1] > 0.1, "nothing moved"
print(f"{len(volumes)} frames read")
