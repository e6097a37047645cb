"""Reads files written by the simulator with VTK and compares them with numbers the simulator computed.

usage: vtk_readback.py probe.vtu expected.csv     (exit 0 agree, 1 disagree, 77 VTK is not installed)
       vtk_readback.py surface.vtp expected.csv
expected.csv rows: cell,r,s,t,x,y,z,d1,d2,d3 for a .vtu: in cell number `cell`, at VTK's parametric coordinates
(r, s, t), the point is (x, y, z) and displacement_mm is (d1, d2, d3); point,x,y,z,value for a .vtp.
"""
import csv
import math
import sys

try:
    import vtkmodules.all as vtk
except ImportError as error:
    print(f"skipped: no VTK for this Python ({error})")
    sys.exit(77)

TOLERANCE = 1e-12


def read(reader, path):
    errors = []
    reader.AddObserver("ErrorEvent", lambda *_: errors.append("error"))
    reader.SetFileName(path)
    reader.Update()
    if errors or reader.GetErrorCode():
        sys.exit(f"VTK reports an error in {path}")
    return reader.GetOutput()


def check_volume(path, rows):
    grid = read(vtk.vtkXMLUnstructuredGridReader(), path)
    displacement = grid.GetPointData().GetArray("displacement_mm")
    worst = 0.0
    for row in rows:
        cell = grid.GetCell(int(row[0]))
        if cell.GetCellType() != vtk.VTK_LAGRANGE_WEDGE:
            sys.exit(f"cell {row[0]} has type {cell.GetCellType()}")
        numbers = [float(v) for v in row[1:]]
        point, sub, weights = [0.0] * 3, vtk.mutable(0), [0.0] * cell.GetNumberOfPoints()
        cell.EvaluateLocation(sub, numbers[0:3], point, weights)
        value = [sum(w * displacement.GetComponent(cell.GetPointId(i), k) for i, w in enumerate(weights))
                 for k in range(3)]
        worst = max([worst] + [abs(a - b) for a, b in zip(point + value, numbers[3:9])])
    check_volumes(grid)
    print(f"cells {grid.GetNumberOfCells()} time {grid.GetFieldData().GetArray('TimeValue').GetValue(0)} "
          f"worst {worst:.3e}")
    return worst


def check_volumes(grid):
    """Each cell's boundary, triangulated, must enclose a positive volume: an orientation test VTK does itself."""
    for c in range(grid.GetNumberOfCells()):
        one = vtk.vtkExtractCells()
        ids = vtk.vtkIdList()
        ids.InsertNextId(c)
        one.SetInputData(grid)
        one.SetCellList(ids)
        surface = vtk.vtkDataSetSurfaceFilter()
        surface.SetNonlinearSubdivisionLevel(3)
        surface.SetInputConnection(one.GetOutputPort())
        triangles = vtk.vtkTriangleFilter()
        triangles.SetInputConnection(surface.GetOutputPort())
        triangles.Update()
        mesh = triangles.GetOutput()
        volume = 0.0
        for t in range(mesh.GetNumberOfCells()):
            ids3 = mesh.GetCell(t).GetPointIds()
            a, b, d = (mesh.GetPoint(ids3.GetId(k)) for k in range(3))
            volume += (a[0] * (b[1] * d[2] - b[2] * d[1]) + a[1] * (b[2] * d[0] - b[0] * d[2])
                       + a[2] * (b[0] * d[1] - b[1] * d[0])) / 6
        if not volume > 0.05:  # the test's cells have about 0.2 mm³
            sys.exit(f"cell {c} has volume {volume}")


def check_surface(path, rows):
    mesh = read(vtk.vtkXMLPolyDataReader(), path)
    values = mesh.GetPointData().GetArray("height_mm")
    worst = 0.0
    for row in rows:
        i, numbers = int(row[0]), [float(v) for v in row[1:]]
        found = list(mesh.GetPoint(i)) + [values.GetValue(i)]
        worst = max([worst] + [abs(a - b) for a, b in zip(found, numbers)])
    print(f"points {mesh.GetNumberOfPoints()} triangles {mesh.GetNumberOfPolys()} worst {worst:.3e}")
    return worst


with open(sys.argv[2], newline="") as table:
    expected = list(csv.reader(table))[1:]
check = check_volume if sys.argv[1].endswith(".vtu") else check_surface
difference = check(sys.argv[1], expected)
sys.exit(0 if math.isfinite(difference) and difference <= TOLERANCE else 1)
