#include "sim/scene/parts/skin_part.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "sim/core/error.h"
#include "sim/scene/scene_surface.h"
#include "sim/scene/skin_rule.h"
#include "sim/scene/vertex_values.h"
#include "sim/terms/geometry.h"
#include "sim/terms/pre_stretch_law.h"
#include "sim/terms/skin_law.h"

namespace rhytid {

namespace {

/// Instantaneous shear modulus and bulk modulus from Young's modulus and Poisson's ratio (the
/// publication, eq. of μ and K).
double shear_modulus(const LayerScene& l) {
  return l.youngs_modulus / (2 * (1 + l.poissons_ratio));
}
double bulk_modulus(const LayerScene& l) {
  return l.youngs_modulus / (3 * (1 - 2 * l.poissons_ratio));
}

/// Part of the shear modulus that relaxes in this scene.
double relaxing_part(const Scene& scene, const LayerScene& l) {
  return scene.time.damper == DamperScheme::none ? 0 : l.relaxing_fraction;
}

/// Adds the frame of the pre-stretch at every point: direction in the layer [3] and its normal [3], ∇w
/// normalised.
void add_frames(const Scene& scene, TermGroup& g) {
  const std::optional<Vec3>& direction = scene.skin.pre_stretch->direction;
  const std::size_t points =
      static_cast<std::size_t>(g.num_elements) * static_cast<std::size_t>(g.num_points);
  g.rest.resize(6 * points);
  for (std::size_t q = 0; q < points; ++q) {
    const Vec3 n = Eigen::Map<const Vec3>(g.inverse_jacobian.data() + 9 * q + 6).normalized();
    Vec3 t = n.unitOrthogonal();  // any will do when both stretches are equal
    if (direction) {
      const Vec3 d = direction->normalized();
      t = d - d.dot(n) * n;
      if (t.norm() < 1e-3)
        throw InputError(scene.file + ": /skin/pre_stretch/direction",
                         "a direction at right angles to the skin", "a direction along the skin everywhere");
      t.normalize();
    }
    std::copy(t.data(), t.data() + 3, g.rest.data() + 6 * q);
    std::copy(n.data(), n.data() + 3, g.rest.data() + 6 * q + 3);
  }
}

/// The term without groups: a layer with a Maxwell branch needs history, one without does not.
Term skin_term(const Scene& scene, bool viscous) {
  const double volume = scene.skin.volume == VolumeQuadrature::reduced ? 0 : 1;
  const SkinLaw skin{scene.time.damper, volume};
  const ElasticSkinLaw elastic{volume};
  const bool tense = scene.skin.pre_stretch.has_value();
  if (viscous && tense) return {"skin", pre_stretched_skin_kernels(), PreStretchedLaw<SkinLaw>{skin}};
  if (viscous) return {"skin", skin_kernels(), skin};
  if (tense)
    return {"skin (elastic)", pre_stretched_elastic_skin_kernels(), PreStretchedLaw<ElasticSkinLaw>{elastic}};
  return {"skin (elastic)", elastic_skin_kernels(), elastic};
}

}  // namespace

SkinMesh build_skin_mesh(Scene& scene) {
  SkinScene& skin = scene.skin;
  const TriangleSurface surface = scene_surface(skin.surface);
  ExtrusionOptions options;
  options.order = skin.order;
  for (LayerScene& l : skin.layers) {
    VectorXd by_vertex;
    if (!l.thickness_by_vertex.empty()) {
      by_vertex = on_surface_vertices(surface, l.thickness_by_vertex,
                                      scene.file + ": /skin/layers/" + l.name + "/thickness_map");
      l.thickness = by_vertex.mean();
    }
    options.layers.push_back({l.thickness, l.elements, l.order});
    options.layers.back().by_vertex = std::move(by_vertex);
  }
  options.composite = skin.scheme == ThicknessScheme::composite;
  options.composite_order = skin.composite_order;
  options.surface_is_outer = skin.surface.is_outer;
  options.normal_smoothing = skin.surface.normal_smoothing;
  options.bend_radius = skin.surface.bend_radius;
  SkinMesh mesh = extrude(surface, options);
  if (skin.surface.imperfection_amplitude > 0)
    add_imperfection(mesh, skin.surface.imperfection_amplitude, skin.surface.imperfection_seed);
  return mesh;
}

SkinPart::SkinPart(const Scene& scene) {
  for (const LayerScene& l : scene.skin.layers) built_relaxing_.push_back(relaxing_part(scene, l) > 0);
}

void SkinPart::add_native_blocks(const Scene& scene, Model& model) const {
  for (const LayerScene& l : scene.skin.layers)
    add_native_block(model, "layer/" + l.name, 5, {SkinTheta::mu_inf, SkinTheta::bulk, SkinTheta::mu_m});
  if (scene.skin.pre_stretch) add_native_block(model, "pre_stretch", 2, {});
}

void SkinPart::add_terms(const Scene& scene, Model& model, std::vector<FeatureNote>& features) const {
  const SkinScene& skin = scene.skin;
  FeatureNote viscosity{"viscosity", false, "no layer relaxes"};
  FeatureNote tension{"pre-stretch", skin.pre_stretch.has_value(),
                      skin.pre_stretch ? "frame 0 is the relaxed equilibrium under tension"
                                       : "no /skin/pre_stretch in the scene"};
  // A layer without a Maxwell branch keeps no history and skips its logarithm; a term exists only if a layer
  // needs it.
  for (bool viscous : {true, false}) {
    Term term = skin_term(scene, viscous);
    for (int k = 0; k < static_cast<int>(model.mesh.element_layers.size()); ++k)
      for (const MaterialSlab& slab : model.mesh.element_layers[k].slabs) {
        const LayerScene& layer = skin.layers[slab.material];
        if ((relaxing_part(scene, layer) > 0) != viscous) continue;
        TermGroup g = prism_group(model.mesh, k, slab, skin_rule(skin, model.mesh.element_layers[k].order));
        const int base = model.native_block("layer/" + layer.name).offset;
        const int of_layer = term.kernels().ntheta - (skin.pre_stretch ? 2 : 0);
        for (int s = 0; s < of_layer; ++s) g.theta.push_back(constant_slot(base + s));
        if (skin.pre_stretch) {
          const int stretch = model.native_block("pre_stretch").offset;
          for (int s = 0; s < 2; ++s) g.theta.push_back(constant_slot(stretch + s));
          add_frames(scene, g);
        }
        term.add_group(std::move(g));
      }
    if (term.groups().empty()) continue;
    if (viscous) {
      viscosity.present = true;
      viscosity.detail = "Maxwell history at every skin point";
      viscosity.terms.push_back(static_cast<int>(model.terms.size()));
    }
    if (skin.pre_stretch) tension.terms.push_back(static_cast<int>(model.terms.size()));
    model.terms.push_back(std::move(term));
  }
  if (skin.volume == VolumeQuadrature::reduced) {
    Term term("skin volume", volume_kernels(), VolumeLaw{});
    for (int k = 0; k < static_cast<int>(model.mesh.element_layers.size()); ++k)
      for (const MaterialSlab& slab : model.mesh.element_layers[k].slabs) {
        TermGroup g =
            prism_group(model.mesh, k, slab, skin_rule(skin, model.mesh.element_layers[k].order, 1));
        const int base = model.native_block("layer/" + skin.layers[slab.material].name).offset;
        g.theta.push_back(constant_slot(base + SkinTheta::bulk));
        term.add_group(std::move(g));
      }
    model.terms.push_back(std::move(term));
  }
  features.push_back(std::move(viscosity));
  features.push_back(std::move(tension));
}

void SkinPart::set_native(const Scene& scene, const Model& model, VectorXd& native) const {
  for (std::size_t k = 0; k < scene.skin.layers.size(); ++k) {
    const LayerScene& l = scene.skin.layers[k];
    // Such a term would lose the part of its stiffness that relaxes.
    if (relaxing_part(scene, l) > 0 && !built_relaxing_[k])
      throw InputError(scene.file + ": /skin/layers/" + l.name + "/relaxing_fraction",
                       std::to_string(l.relaxing_fraction), "0, with which this model was built");
    const int at = model.native_block("layer/" + l.name).offset;
    const double f = relaxing_part(scene, l), mu = shear_modulus(l);
    native[at + SkinTheta::mu_inf] = (1 - f) * mu;
    native[at + SkinTheta::stiffening] = l.stiffening;
    native[at + SkinTheta::bulk] = bulk_modulus(l);
    native[at + SkinTheta::mu_m] = f * mu;
    native[at + SkinTheta::tau] = l.relaxation_time;
  }
  if (const auto& tension = scene.skin.pre_stretch) {
    const int at = model.native_block("pre_stretch").offset;
    native[at] = tension->stretch;
    native[at + 1] = tension->across.value_or(tension->stretch);
  }
}

bool SkinPart::add_derivative(const Scene& scene, const Model& model, const std::string& address,
                              VectorXd& d) const {
  if (address == "/skin/pre_stretch/stretch" || address == "/skin/pre_stretch/across") {
    const int at = model.native_block("pre_stretch").offset;
    const bool is_across = address.ends_with("across");
    d[at] = is_across ? 0 : 1;
    d[at + 1] = is_across || !scene.skin.pre_stretch->across ? 1 : 0;
    return true;
  }
  for (const LayerScene& l : scene.skin.layers) {
    const std::string key = key_after(address, "skin/layers", l.name);
    if (key.empty()) continue;
    const int at = model.native_block("layer/" + l.name).offset;
    const double f = relaxing_part(scene, l), mu = shear_modulus(l);
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
      if (f > 0) {
        d[at + SkinTheta::mu_inf] = -mu;
        d[at + SkinTheta::mu_m] = mu;
      }
    } else {
      return false;
    }
    d[at + SkinTheta::mu_inf] += (1 - f) * dmu;
    d[at + SkinTheta::mu_m] += f * dmu;
    d[at + SkinTheta::bulk] += dbulk;
    return true;
  }
  return false;
}

}  // namespace rhytid
