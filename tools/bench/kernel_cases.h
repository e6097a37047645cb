// Terms of a flat patch in a deformed state, for the benchmark of kernels: skin of given orders, ligaments, contact
// with a large sphere that all of the outer surface lies in, friction of it.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "sim/mesh/skin_mesh.h"
#include "sim/surface/imls.h"
#include "sim/surface/shapes.h"
#include "sim/terms/skin_law.h"
#include "sim/terms/term.h"

namespace rhytid::tools {

/// One term, and a step of it: the old state, from which `data` was prepared, differs from u.
struct KernelCase {
  std::string name;
  Term term;
  TermStepData data;
};

/// A patch 24 × 24 mm, 2 mm thick, `cells`² squares of two faces, one layer of prisms.
class KernelCases {
 public:
  /// Orders p in the plane and q through the thickness. Strains reach a quarter; slip and stick both occur.
  KernelCases(int order, int thickness_order, int cells);

  std::string element() const;
  /// Viscoelastic skin with Fung's factor, exponential damper, by the given kernels.
  KernelCase skin(const KernelTable& kernels) const;
  KernelCase ligaments() const;
  KernelCase contact() const;
  KernelCase friction() const;

  const SkinMesh& mesh() const { return mesh_; }
  const VectorXd& displacement() const { return u_; }
  const StepInfo& step() const { return step_; }
  SkinLaw skin_law() const { return {}; }
  double contact_radius() const { return shape_.radius(); }
  static constexpr double onset = 0.02, slip_speed = 2;  ///< mm, mm/s

 private:
  KernelCase make(const std::string& name, const KernelTable& kernels, Term term, TermGroup group,
                  const std::vector<double>& theta) const;

  SkinMesh mesh_;
  int thickness_order_;
  Sphere shape_;
  StepInfo step_;
  VectorXd u_old_, u_;
};

/// Points of a bone with unit normals, a spacing of 1 mm on a wavy surface, and places within 1 mm of it.
struct ImlsCase {
  MatrixX3 points, normals, places;
  std::unique_ptr<const ImlsSurface> surface;
};
ImlsCase imls_case(int cells);

}  // namespace rhytid::tools
