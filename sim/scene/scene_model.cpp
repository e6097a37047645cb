#include "sim/scene/scene_model.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <mutex>

#include "sim/core/error.h"
#include "sim/element/basis.h"
#include "sim/scene/parameter.h"
#include "sim/surface/heat_map.h"
#include "sim/surface/imls.h"
#include "sim/surface/project_to_surface.h"
#include "sim/surface/shapes.h"
#include "sim/terms/contact_law.h"
#include "sim/terms/geometry.h"
#include "sim/terms/ligament_law.h"
#include "sim/terms/skin_law.h"

namespace rhytid {

namespace {

ThetaSlot constant_slot(int offset) {
  return {ThetaSlot::Kind::constant, offset, {}};
}

/// Instantaneous shear modulus and bulk modulus from Young's modulus and Poisson's ratio (paper.tex, eq. of μ
/// and K).
double shear_modulus(const LayerScene& l) {
  return l.youngs_modulus / (2 * (1 + l.poissons_ratio));
}
double bulk_modulus(const LayerScene& l) {
  return l.youngs_modulus / (3 * (1 - 2 * l.poissons_ratio));
}

int default_degree(int wanted, int fallback) {
  return std::min(12, wanted > 0 ? wanted : fallback);
}

GridPattern grid_pattern(const std::string& name) {
  if (name == "diagonal_plus") return GridPattern::diagonal_plus;
  if (name == "diagonal_minus") return GridPattern::diagonal_minus;
  return GridPattern::union_jack;
}

}  // namespace

/// Diffused weights at every diffusion time asked for (a fit of the diffusion time asks for a few dozen).
struct SceneModel::HeatCache {
  std::mutex mutex;
  std::map<double, HeatMapWeights> by_time;
};

SceneModel::SceneModel(Scene scene) : scene_(std::move(scene)), heat_cache_(std::make_shared<HeatCache>()) {
  build_mesh();
  if (scene_.ligaments) {
    const TriangleBasis basis(model_.mesh.order);
    const int n = basis.num_nodes();
    for (int face = 0; face < model_.mesh.num_faces; ++face)
      for (const auto& t : basis.subtriangles()) {
        std::array<int, 3> columns;
        for (int k = 0; k < 3; ++k)
          columns[k] = model_.mesh.face_columns[static_cast<std::size_t>(face) * n + t[k]];
        column_triangles_.push_back(columns);
      }
  }
  build_ligaments();
  build_native();
  build_skin();
  build_contacts();
  build_constraints();
  model_.native = native(scene_);
  model_.finish();
}

RunOptions SceneModel::run_options() const {
  RunOptions o;
  o.frame_rate = scene_.time.frame_rate;
  o.frames = scene_.time.frames;
  o.substeps = scene_.time.substeps;
  o.max_bisections = scene_.time.max_bisections;
  MinimiserOptions& m = o.minimiser;
  m.method = scene_.solver.minimiser == "lbfgs"              ? Minimiser::lbfgs
             : scene_.solver.minimiser == "newton_projected" ? Minimiser::newton_projected
                                                             : Minimiser::newton;
  m.relative_tolerance = scene_.solver.relative_tolerance;
  m.absolute_tolerance = scene_.solver.absolute_tolerance;
  m.max_iterations = scene_.solver.max_iterations;
  m.lbfgs_memory = scene_.solver.lbfgs_memory;
  m.lbfgs_refresh = scene_.solver.lbfgs_refresh;
  return o;
}

void SceneModel::build_mesh() {
  const SkinScene& skin = scene_.skin;
  TriangleSurface surface;
  if (!skin.surface.file.empty()) {
    surface = read_obj(skin.surface.file, skin.surface.mm_per_unit);
    if (skin.surface.crop_centre)
      surface = crop_geodesic_disc(surface, *skin.surface.crop_centre, skin.surface.crop_radius);
  } else {
    surface = grid_surface(skin.surface.grid_size[0], skin.surface.grid_size[1], skin.surface.grid_cells[0],
                           skin.surface.grid_cells[1], grid_pattern(skin.surface.grid_pattern));
  }
  ExtrusionOptions options;
  options.order = skin.order;
  for (const LayerScene& l : skin.layers) options.layers.push_back({l.thickness, l.elements, l.order});
  options.composite = skin.scheme == ThicknessScheme::composite;
  options.composite_order = skin.composite_order;
  options.surface_is_outer = skin.surface.is_outer;
  options.normal_smoothing = skin.surface.normal_smoothing;
  options.bend_radius = skin.surface.bend_radius;
  model_.mesh = extrude(surface, options);
}

void SceneModel::build_native() {
  int offset = 0;
  const auto add = [&](std::string name, int size, std::vector<int> stiffness_like) {
    for (int& i : stiffness_like) i += offset;
    model_.native_blocks.push_back({std::move(name), offset, size, std::move(stiffness_like)});
    offset += size;
  };
  for (const LayerScene& l : scene_.skin.layers)
    add("layer/" + l.name, 5, {SkinTheta::mu_inf, SkinTheta::bulk, SkinTheta::mu_m});
  if (scene_.ligaments) {
    add("ligaments", 2, {0});
    add("ligaments/b", model_.mesh.num_columns, {});
  }
  if (scene_.base) add("base", 5, {0});
  for (const ColliderScene& c : scene_.colliders)
    add("collider/" + c.name, 3 + 3 * static_cast<int>(c.path.size()), {0});
  model_.native.resize(offset);
}

void SceneModel::build_skin() {
  const SkinScene& skin = scene_.skin;
  const TriangleRule& rule = triangle_rule(default_degree(skin.triangle_degree, 2 * skin.order + 2));
  const auto relaxes = [&](int layer) {
    return skin.layers[layer].relaxing_fraction > 0 && scene_.time.damper != DamperScheme::none;
  };
  // A layer without a Maxwell branch keeps no history and skips its logarithm; a term exists only if a layer
  // needs it.
  for (bool viscous : {true, false}) {
    Term term = viscous ? Term("skin", skin_kernels(), SkinLaw{scene_.time.damper})
                        : Term("skin (elastic)", elastic_skin_kernels(), ElasticSkinLaw{});
    for (int k = 0; k < static_cast<int>(model_.mesh.element_layers.size()); ++k)
      for (const MaterialSlab& slab : model_.mesh.element_layers[k].slabs) {
        if (relaxes(slab.material) != viscous) continue;
        const int points =
            skin.thickness_points > 0 ? skin.thickness_points : model_.mesh.element_layers[k].order + 1;
        TermGroup g = prism_group(model_.mesh, k, slab, rule, points);
        const int base = model_.native_block("layer/" + skin.layers[slab.material].name).offset;
        for (int s = 0; s < term.kernels().ntheta; ++s) g.theta.push_back(constant_slot(base + s));
        term.add_group(std::move(g));
      }
    if (!term.groups().empty()) model_.terms.push_back(std::move(term));
  }
  bool any = false;
  for (int l = 0; l < static_cast<int>(skin.layers.size()); ++l) any = any || relaxes(l);
  features_.push_back({"viscosity", any, any ? "Maxwell history at every skin point" : "no layer relaxes"});
}

void SceneModel::build_ligaments() {
  if (!scene_.ligaments) {
    features_.push_back({"ligaments", false, "no /ligaments in the scene"});
    return;
  }
  const SkinMesh& mesh = model_.mesh;
  MatrixX3 inner(mesh.num_columns, 3);
  for (int c = 0; c < mesh.num_columns; ++c) inner.row(c) = mesh.rest.row(mesh.node(c, 0));
  for (const SourceScene& s : scene_.ligaments->sources) {
    Vec3 position = s.position;
    if (s.vertex) {
      const auto& from = mesh.surface.source_vertex;
      int local = *s.vertex;
      if (!from.empty()) {
        const auto it = std::find(from.begin(), from.end(), *s.vertex);
        local = it == from.end() ? -1 : static_cast<int>(it - from.begin());
      }
      if (local < 0 || local >= static_cast<int>(mesh.vertex_columns.size()))
        throw InputError(scene_.file + ": /ligaments/sources/" + s.name + "/vertex",
                         std::to_string(*s.vertex), "a vertex of the cropped surface");
      position = inner.row(mesh.vertex_columns[local]).transpose();
    }
    source_positions_.push_back(project_to_surface(inner, column_triangles_, position).point);
  }
  features_.push_back({"ligaments", true, std::to_string(scene_.ligaments->sources.size()) + " sources"});
}

const HeatMapWeights& SceneModel::heat(double time) const {
  std::lock_guard lock(heat_cache_->mutex);
  auto& cache = heat_cache_->by_time;
  if (const auto it = cache.find(time); it != cache.end()) return it->second;
  const SkinMesh& mesh = model_.mesh;
  MatrixX3 inner(mesh.num_columns, 3);
  for (int c = 0; c < mesh.num_columns; ++c) inner.row(c) = mesh.rest.row(mesh.node(c, 0));
  std::vector<HeatSource> sources;
  for (std::size_t s = 0; s < source_positions_.size(); ++s)
    sources.push_back({source_positions_[s], scene_.ligaments->sources[s].radius});
  return cache.emplace(time, diffuse_sources(inner, column_triangles_, sources, time)).first->second;
}

VectorXd SceneModel::ligament_map(const Scene& scene) const {
  if (!scene.ligaments) return {};
  VectorXd strengths(scene.ligaments->sources.size());
  for (Eigen::Index s = 0; s < strengths.size(); ++s) strengths[s] = scene.ligaments->sources[s].strength;
  return heat(scene.ligaments->diffusion_time).weights * strengths;
}

void SceneModel::build_contacts() {
  const SkinMesh& mesh = model_.mesh;
  const TriangleRule& rule =
      triangle_rule(default_degree(scene_.skin.contact_degree, std::max(10, 2 * scene_.skin.order + 2)));
  if (scene_.ligaments) {
    Term term("ligaments", ligament_kernels(), LigamentLaw{});
    TermGroup g = surface_group(mesh, SkinSide::inner, rule);
    g.rest.clear();
    const int base = model_.native_block("ligaments").offset;
    g.theta = {constant_slot(base),
               constant_slot(base + 1),
               {ThetaSlot::Kind::field, model_.native_block("ligaments/b").offset, {}}};
    term.add_group(std::move(g));
    model_.terms.push_back(std::move(term));
  }
  if (scene_.base) {
    const BaseScene& b = *scene_.base;
    switch (b.shape) {
      case ShapeKind::plane:
        model_.shapes.push_back(std::make_shared<Plane>(b.normal));
        break;
      case ShapeKind::sphere:
        model_.shapes.push_back(std::make_shared<Sphere>(b.radius));
        break;
      case ShapeKind::imls: {
        MatrixX3 inner(mesh.num_columns, 3);
        for (int c = 0; c < mesh.num_columns; ++c) inner.row(c) = mesh.rest.row(mesh.node(c, 0));
        ImlsOptions options;
        options.support = b.imls_support;
        model_.shapes.push_back(std::make_shared<ImlsSurface>(inner, mesh.column_normals, options));
      }
    }
    const ImplicitShape* shape = model_.shapes.back().get();
    const Vec3 centre = b.shape == ShapeKind::imls ? Vec3(Vec3::Zero()) : b.centre;
    Term term("base contact", contact_kernels(), ContactLaw{shape, b.onset});
    TermGroup g = surface_group(mesh, SkinSide::inner, rule);
    // Rest gap subtracted: the rest state is an exact equilibrium whatever the shape makes of the rest nodes.
    for (std::size_t q = 0; q < g.weight.size(); ++q) {
      const Vec3 x(g.rest[4 * q], g.rest[4 * q + 1], g.rest[4 * q + 2]);
      const GapJet jet = shape->evaluate(x - centre);
      if (!jet.supported)
        throw InputError(scene_.file + ": /base/imls_support", std::to_string(b.imls_support) + " mm",
                         "a support that reaches every point of the inner surface");
      g.rest[4 * q + 3] = jet.gap;
    }
    const int base = model_.native_block("base").offset;
    for (int s = 0; s < 5; ++s) g.theta.push_back(constant_slot(base + s));
    term.add_group(std::move(g));
    model_.terms.push_back(std::move(term));
  }
  features_.push_back(
      {"base contact", scene_.base.has_value(), scene_.base ? "inner surface" : "no /base in the scene"});
  bool friction = false;
  for (const ColliderScene& c : scene_.colliders) {
    if (c.shape == ShapeKind::plane) {
      model_.shapes.push_back(std::make_shared<Plane>(c.normal));
    } else {
      model_.shapes.push_back(std::make_shared<Sphere>(c.radius));
    }
    const ImplicitShape* shape = model_.shapes.back().get();
    const int base = model_.native_block("collider/" + c.name).offset;
    std::vector<double> times;
    for (const PathKnot& k : c.path) times.push_back(k.time);
    const auto path = [&](ThetaSlot::Kind kind, int axis) { return ThetaSlot{kind, base + 3 + axis, times}; };
    {
      Term term("contact " + c.name, contact_kernels(), ContactLaw{shape, c.onset});
      TermGroup g = surface_group(mesh, SkinSide::outer, rule);
      g.theta = {constant_slot(base), constant_slot(base + 1)};
      for (int axis = 0; axis < 3; ++axis) g.theta.push_back(path(ThetaSlot::Kind::path_now, axis));
      term.add_group(std::move(g));
      model_.terms.push_back(std::move(term));
    }
    if (c.friction && c.friction->coefficient > 0) {
      friction = true;
      Term term(
          "friction " + c.name, friction_kernels(),
          FrictionLaw{shape, c.onset, c.friction->slip_speed,
                      c.friction->mollifier == "quadratic" ? Mollifier::quadratic : Mollifier::quintic});
      TermGroup g = surface_group(mesh, SkinSide::outer, rule);
      g.theta = {constant_slot(base), constant_slot(base + 1), constant_slot(base + 2)};
      for (ThetaSlot::Kind kind : {ThetaSlot::Kind::path_now, ThetaSlot::Kind::path_old})
        for (int axis = 0; axis < 3; ++axis) g.theta.push_back(path(kind, axis));
      term.add_group(std::move(g));
      model_.terms.push_back(std::move(term));
    }
  }
  const bool contact = !scene_.colliders.empty();
  features_.push_back({"contact", contact,
                       contact ? std::to_string(scene_.colliders.size()) + " colliders" : "no colliders"});
  features_.push_back(
      {"friction", friction,
       friction ? "lagged pressure and normal at every contact point" : "no collider has friction"});
}

void SceneModel::build_constraints() {
  const SkinMesh& mesh = model_.mesh;
  Constraints& c = model_.constraints;
  std::vector<int> rim_index(mesh.num_columns, -1);
  if (scene_.skin.rim != RimCondition::free)
    for (std::size_t r = 0; r < mesh.rim_columns.size(); ++r)
      rim_index[mesh.rim_columns[r]] = static_cast<int>(r);
  c.block.assign(mesh.num_nodes(), -1);
  for (int column = 0; column < mesh.num_columns; ++column) {
    const int rim = rim_index[column];
    if (rim >= 0 && scene_.skin.rim == RimCondition::clamped) continue;
    int frame = -1;
    if (rim >= 0) {
      // Sliding: the wall of the rim only moves within itself. First axis = outward conormal, fixed.
      const Vec3 m = mesh.rim_directions.row(rim).transpose().normalized();
      Vec3 n = mesh.column_normals.row(column).transpose();
      n = (n - n.dot(m) * m).normalized();
      Mat3 axes;
      axes << m, n.cross(m), n;
      frame = static_cast<int>(c.frames.size());
      c.frames.push_back(axes);
    }
    for (int level = 0; level < mesh.num_levels; ++level) {
      const int block = static_cast<int>(c.block_nodes.size());
      c.block[mesh.node(column, level)] = block;
      c.block_nodes.push_back(mesh.node(column, level));
      c.frame_of_block.push_back(frame);
      if (frame >= 0) c.fixed_unknowns.push_back(3 * block);
    }
  }
}

VectorXd SceneModel::native(const Scene& scene) const {
  VectorXd v = VectorXd::Zero(model_.native.size());
  for (const LayerScene& l : scene.skin.layers) {
    const int at = model_.native_block("layer/" + l.name).offset;
    const bool relaxes = l.relaxing_fraction > 0 && scene.time.damper != DamperScheme::none;
    const double mu = shear_modulus(l);
    v[at + SkinTheta::mu_inf] = relaxes ? (1 - l.relaxing_fraction) * mu : mu;
    v[at + SkinTheta::stiffening] = l.stiffening;
    v[at + SkinTheta::bulk] = bulk_modulus(l);
    v[at + SkinTheta::mu_m] = relaxes ? l.relaxing_fraction * mu : 0;
    v[at + SkinTheta::tau] = l.relaxation_time;
  }
  if (scene.ligaments) {
    const int at = model_.native_block("ligaments").offset;
    double thickness = 0;
    for (const LayerScene& l : scene.skin.layers) thickness += l.thickness;
    v[at] = scene.ligaments->stiffness;
    v[at + 1] = scene.ligaments->smoothing > 0 ? scene.ligaments->smoothing : 1e-2 * thickness;
    v.segment(model_.native_block("ligaments/b").offset, model_.mesh.num_columns) = ligament_map(scene);
  }
  if (scene.base) {
    const int at = model_.native_block("base").offset;
    v[at] = scene.base->stiffness;
    if (scene.base->shape != ShapeKind::imls) v.segment<3>(at + 2) = scene.base->centre;
  }
  for (std::size_t k = 0; k < scene.colliders.size(); ++k) {
    const ColliderScene& c = scene.colliders[k];
    const int at = model_.native_block("collider/" + c.name).offset;
    v[at] = c.stiffness;
    v[at + 1] = c.shape == ShapeKind::sphere ? c.radius - scene_.colliders[k].radius : 0;
    v[at + 2] = c.friction ? c.friction->coefficient : 0;
    for (std::size_t i = 0; i < c.path.size(); ++i) v.segment<3>(at + 3 + 3 * i) = c.path[i].position;
  }
  return v;
}

VectorXd SceneModel::native_derivative(const Scene& scene, const std::string& address) const {
  const ParameterSpec spec =
      describe_parameter(scene, address);  // canonical, by names; refuses unknown addresses
  VectorXd d = VectorXd::Zero(model_.native.size());
  for (const LayerScene& l : scene.skin.layers) {
    const std::string prefix = "/skin/layers/" + l.name + "/";
    if (spec.address.rfind(prefix, 0) != 0) continue;
    const std::string key = spec.address.substr(prefix.size());
    const int at = model_.native_block("layer/" + l.name).offset;
    const bool relaxes = l.relaxing_fraction > 0 && scene.time.damper != DamperScheme::none;
    const double f = relaxes ? l.relaxing_fraction : 0, mu = shear_modulus(l);
    double dmu = 0, dbulk = 0;
    if (key == "youngs_modulus") {
      dmu = mu / l.youngs_modulus;
      dbulk = bulk_modulus(l) / l.youngs_modulus;
    } else if (key == "poissons_ratio") {
      dmu = -mu / (1 + l.poissons_ratio);
      dbulk = 2 * bulk_modulus(l) / (1 - 2 * l.poissons_ratio);
    } else if (key == "stiffening") {
      d[at + SkinTheta::stiffening] = 1;
    } else if (key == "relaxation_time") {
      d[at + SkinTheta::tau] = 1;
    } else if (key == "relaxing_fraction") {
      if (relaxes) {
        d[at + SkinTheta::mu_inf] = -mu;
        d[at + SkinTheta::mu_m] = mu;
      }
      return d;
    }
    d[at + SkinTheta::mu_inf] += (1 - f) * dmu;
    d[at + SkinTheta::mu_m] += f * dmu;
    d[at + SkinTheta::bulk] += dbulk;
    return d;
  }
  if (scene.ligaments && spec.address.rfind("/ligaments/", 0) == 0) {
    const NativeBlock& b = model_.native_block("ligaments/b");
    if (spec.address == "/ligaments/stiffness") {
      d[model_.native_block("ligaments").offset] = 1;
      return d;
    }
    const HeatMapWeights& h = heat(scene.ligaments->diffusion_time);
    if (spec.address == "/ligaments/diffusion_time") {
      for (std::size_t s = 0; s < scene.ligaments->sources.size(); ++s)
        d.segment(b.offset, b.size) += h.d_weights_d_time.col(s) * scene.ligaments->sources[s].strength;
      return d;
    }
    for (std::size_t s = 0; s < scene.ligaments->sources.size(); ++s)
      if (spec.address == "/ligaments/sources/" + scene.ligaments->sources[s].name + "/strength") {
        d.segment(b.offset, b.size) = h.weights.col(s);
        return d;
      }
  }
  if (scene.base && spec.address == "/base/stiffness") {
    d[model_.native_block("base").offset] = 1;
    return d;
  }
  for (const ColliderScene& c : scene.colliders) {
    const std::string prefix = "/colliders/" + c.name + "/";
    if (spec.address.rfind(prefix, 0) != 0) continue;
    const std::string key = spec.address.substr(prefix.size());
    const int at = model_.native_block("collider/" + c.name).offset;
    const int slot = key == "stiffness" ? 0 : key == "radius" ? 1 : key == "friction/coefficient" ? 2 : -1;
    if (slot >= 0) {
      d[at + slot] = 1;
      return d;
    }
  }
  throw InputError(scene.file + ": " + address, "a parameter without a derivative",
                   "one of the fit-able parameters");
}

}  // namespace rhytid
