#include "sim/scene/parts/ligament_part.h"

#include <algorithm>
#include <list>
#include <mutex>

#include "sim/core/error.h"
#include "sim/element/basis.h"
#include "sim/scene/vertex_values.h"
#include "sim/surface/project_to_surface.h"
#include "sim/terms/geometry.h"
#include "sim/terms/ligament_law.h"

namespace rhytid {

namespace {

std::vector<std::array<int, 3>> refined_triangles(const SkinMesh& mesh) {
  const TriangleBasis basis(mesh.order);
  const int n = basis.num_nodes();
  std::vector<std::array<int, 3>> triangles;
  for (int face = 0; face < mesh.num_faces; ++face)
    for (const auto& t : basis.subtriangles()) {
      std::array<int, 3> columns;
      for (int k = 0; k < 3; ++k) columns[k] = mesh.face_columns[static_cast<std::size_t>(face) * n + t[k]];
      triangles.push_back(columns);
    }
  return triangles;
}

/// Column of a vertex of the input surface, −1 when it was cropped away.
int column_of_vertex(const SkinMesh& mesh, int vertex) {
  const auto& from = mesh.surface.source_vertex;
  const int source = mesh.surface.standing_for(vertex);
  int local = source;
  if (!from.empty()) {
    const auto it = std::find(from.begin(), from.end(), source);
    local = it == from.end() ? -1 : static_cast<int>(it - from.begin());
  }
  const bool exists = local >= 0 && local < static_cast<int>(mesh.vertex_columns.size());
  return exists ? mesh.vertex_columns[local] : -1;
}

/// Mean over the patch, mm; of a thickness map only what is on the patch counts.
double skin_thickness(const Scene& scene, const SkinMesh& mesh) {
  double thickness = 0;
  bool is_mapped = false;
  for (const LayerScene& layer : scene.skin.layers) {
    thickness += layer.thickness;
    is_mapped = is_mapped || !layer.thickness_by_vertex.empty();
  }
  if (!is_mapped) return thickness;
  const int last = mesh.num_levels - 1;
  double sum = 0;
  for (int c = 0; c < mesh.num_columns; ++c)
    sum += (mesh.rest.row(c * mesh.num_levels + last) - mesh.rest.row(c * mesh.num_levels)).norm();
  return sum / mesh.num_columns;
}

}  // namespace

/// Most recently used first.
struct LigamentPart::HeatCache {
  struct Entry {
    double time;
    std::vector<Vec3> positions;
    std::shared_ptr<const HeatMapWeights> weights;
  };
  std::mutex mutex;
  std::list<Entry> entries;
  long solved = 0;
};

LigamentPart::LigamentPart(const Scene& scene, const SkinMesh& mesh)
    : inner_(inner_rest_nodes(mesh)),
      column_triangles_(refined_triangles(mesh)),
      heat_cache_(std::make_shared<HeatCache>()) {
  for (const SourceScene& s : scene.ligaments->sources) {
    Vec3 position = s.position;
    if (s.vertex) {
      const int column = column_of_vertex(mesh, *s.vertex);
      if (column < 0)
        throw InputError(scene.file + ": /ligaments/sources/" + s.name + "/vertex", std::to_string(*s.vertex),
                         "a vertex of the cropped surface");
      position = inner_.row(column).transpose();
    }
    source_positions_.push_back(project_to_surface(inner_, column_triangles_, position).point);
    heat_sources_.push_back({source_positions_.back(), s.radius});
    built_positions_.push_back(s.position);
  }
  if (!scene.ligaments->b_by_vertex.empty())
    given_map_ = interpolate_vertices(mesh, on_surface_vertices(mesh.surface, scene.ligaments->b_by_vertex,
                                                                scene.file + ": /ligaments/map"));
}

void LigamentPart::add_native_blocks(const Scene&, Model& model) const {
  add_native_block(model, "ligaments", 2, {0});
  add_native_block(model, "ligaments/b", model.mesh.num_columns, {});
}

void LigamentPart::add_terms(const Scene& scene, Model& model, std::vector<FeatureNote>& features) const {
  Term term = scene.ligaments->law == LigamentForm::fung_quadratic
                  ? Term("ligaments", fung_ligament_kernels(), FungLigamentLaw{})
                  : Term("ligaments", ligament_kernels(), LigamentLaw{});
  TermGroup g = surface_group(model.mesh, SkinSide::inner, triangle_rule(contact_degree(scene)));
  g.rest.clear();
  const int base = model.native_block("ligaments").offset;
  g.theta = {constant_slot(base),
             constant_slot(base + 1),
             {ThetaSlot::Kind::field, model.native_block("ligaments/b").offset, {}}};
  term.add_group(std::move(g));
  model.terms.push_back(std::move(term));
  features.push_back({"ligaments",
                      true,
                      given_map_.size() > 0 ? std::string("a map by vertex")
                                            : std::to_string(source_positions_.size()) + " sources",
                      {static_cast<int>(model.terms.size()) - 1}});
}

std::vector<HeatSource> LigamentPart::sources_of(const Scene& scene) const {
  std::vector<HeatSource> sources = heat_sources_;
  for (std::size_t s = 0; s < sources.size(); ++s) {
    const SourceScene& now = scene.ligaments->sources[s];
    if (!now.vertex && now.position != built_positions_[s])
      sources[s].position = project_to_surface(inner_, column_triangles_, now.position).point;
  }
  return sources;
}

std::shared_ptr<const HeatMapWeights> LigamentPart::heat(const Scene& scene) const {
  const double time = scene.ligaments->diffusion_time;
  const std::vector<HeatSource> sources = sources_of(scene);
  std::vector<Vec3> positions;
  for (const HeatSource& source : sources) positions.push_back(source.position);
  const std::lock_guard lock(heat_cache_->mutex);
  auto& entries = heat_cache_->entries;
  const auto it = std::find_if(entries.begin(), entries.end(), [&](const auto& entry) {
    return entry.time == time && entry.positions == positions;
  });
  if (it != entries.end()) {
    entries.splice(entries.begin(), entries, it);
  } else {
    entries.push_front(
        {time, std::move(positions),
         std::make_shared<const HeatMapWeights>(diffuse_sources(inner_, column_triangles_, sources, time))});
    ++heat_cache_->solved;
    if (entries.size() > kHeatMapsKept) entries.pop_back();
  }
  return entries.front().weights;
}

std::size_t LigamentPart::heat_maps_kept() const {
  const std::lock_guard lock(heat_cache_->mutex);
  return heat_cache_->entries.size();
}

long LigamentPart::heat_maps_solved() const {
  const std::lock_guard lock(heat_cache_->mutex);
  return heat_cache_->solved;
}

std::size_t LigamentPart::bytes() const {
  auto numbers = static_cast<std::size_t>(inner_.size() + given_map_.size());
  const std::lock_guard lock(heat_cache_->mutex);
  for (const HeatCache::Entry& entry : heat_cache_->entries)
    numbers +=
        static_cast<std::size_t>(entry.weights->weights.size() + entry.weights->d_weights_d_time.size());
  return numbers * sizeof(double) + column_triangles_.size() * sizeof(column_triangles_[0]);
}

VectorXd LigamentPart::map(const Scene& scene) const {
  if (given_map_.size() > 0) return scene.ligaments->map_scale * given_map_;
  VectorXd strengths(scene.ligaments->sources.size());
  for (Eigen::Index s = 0; s < strengths.size(); ++s) strengths[s] = scene.ligaments->sources[s].strength;
  return heat(scene)->weights * strengths;
}

void LigamentPart::set_native(const Scene& scene, const Model& model, VectorXd& native) const {
  const int at = model.native_block("ligaments").offset;
  native[at] = scene.ligaments->stiffness;
  native[at + 1] =
      scene.ligaments->smoothing > 0 ? scene.ligaments->smoothing : 1e-2 * skin_thickness(scene, model.mesh);
  const NativeBlock& b = model.native_block("ligaments/b");
  native.segment(b.offset, b.size) = map(scene);
}

bool LigamentPart::add_derivative(const Scene& scene, const Model& model, const std::string& address,
                                  VectorXd& d) const {
  if (address == "/ligaments/stiffness") {
    d[model.native_block("ligaments").offset] = 1;
    return true;
  }
  const NativeBlock& b = model.native_block("ligaments/b");
  if (address == "/ligaments/map_scale") {
    d.segment(b.offset, b.size) = given_map_;
    return true;
  }
  const std::vector<SourceScene>& sources = scene.ligaments->sources;
  if (address == "/ligaments/diffusion_time") {
    const auto weights = heat(scene);
    for (std::size_t s = 0; s < sources.size(); ++s)
      d.segment(b.offset, b.size) += weights->d_weights_d_time.col(s) * sources[s].strength;
    return true;
  }
  for (std::size_t s = 0; s < sources.size(); ++s) {
    const std::string key = key_after(address, "ligaments/sources", sources[s].name);
    if (key == "strength") {
      d.segment(b.offset, b.size) = heat(scene)->weights.col(s);
      return true;
    }
    if (key.starts_with("position/")) {
      const Vec3& x = sources[s].position;
      const Mat3 projection = projection_derivative(inner_, column_triangles_, x,
                                                    project_to_surface(inner_, column_triangles_, x));
      const MatrixXd motion = source_motion(inner_, column_triangles_, sources_of(scene),
                                            scene.ligaments->diffusion_time, static_cast<int>(s));
      const int axis = std::stoi(key.substr(key.size() - 1));
      d.segment(b.offset, b.size) =
          (sources[s].strength - map(scene).array()).matrix().cwiseProduct(motion * projection.col(axis));
      return true;
    }
  }
  return false;
}

}  // namespace rhytid
