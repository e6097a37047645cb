#include "sim/scene/parts/skin_part.h"

#include <algorithm>

#include "sim/scene/scene_surface.h"
#include "sim/terms/geometry.h"
#include "sim/terms/skin_law.h"

namespace rhytid {

namespace {

/// Instantaneous shear modulus and bulk modulus from Young's modulus and Poisson's ratio (paper.tex, eq. of μ
/// and K).
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

}  // namespace

SkinMesh build_skin_mesh(const SkinScene& skin) {
  const TriangleSurface surface = scene_surface(skin.surface);
  ExtrusionOptions options;
  options.order = skin.order;
  for (const LayerScene& l : skin.layers) options.layers.push_back({l.thickness, l.elements, l.order});
  options.composite = skin.scheme == ThicknessScheme::composite;
  options.composite_order = skin.composite_order;
  options.surface_is_outer = skin.surface.is_outer;
  options.normal_smoothing = skin.surface.normal_smoothing;
  options.bend_radius = skin.surface.bend_radius;
  return extrude(surface, options);
}

void SkinPart::add_native_blocks(const Scene& scene, Model& model) const {
  for (const LayerScene& l : scene.skin.layers)
    add_native_block(model, "layer/" + l.name, 5, {SkinTheta::mu_inf, SkinTheta::bulk, SkinTheta::mu_m});
}

void SkinPart::add_terms(const Scene& scene, Model& model, std::vector<FeatureNote>& features) const {
  const SkinScene& skin = scene.skin;
  const int degree = skin.triangle_degree > 0 ? skin.triangle_degree : 2 * skin.order + 2;
  const TriangleRule& rule = triangle_rule(std::min(12, degree));
  // A layer without a Maxwell branch keeps no history and skips its logarithm; a term exists only if a layer
  // needs it.
  for (bool viscous : {true, false}) {
    Term term = viscous ? Term("skin", skin_kernels(), SkinLaw{scene.time.damper})
                        : Term("skin (elastic)", elastic_skin_kernels(), ElasticSkinLaw{});
    for (int k = 0; k < static_cast<int>(model.mesh.element_layers.size()); ++k)
      for (const MaterialSlab& slab : model.mesh.element_layers[k].slabs) {
        const LayerScene& layer = skin.layers[slab.material];
        if ((relaxing_part(scene, layer) > 0) != viscous) continue;
        const int points =
            skin.thickness_points > 0 ? skin.thickness_points : model.mesh.element_layers[k].order + 1;
        TermGroup g = prism_group(model.mesh, k, slab, rule, points);
        const int base = model.native_block("layer/" + layer.name).offset;
        for (int s = 0; s < term.kernels().ntheta; ++s) g.theta.push_back(constant_slot(base + s));
        term.add_group(std::move(g));
      }
    if (!term.groups().empty()) model.terms.push_back(std::move(term));
  }
  const bool any = std::any_of(skin.layers.begin(), skin.layers.end(),
                               [&](const LayerScene& l) { return relaxing_part(scene, l) > 0; });
  features.push_back({"viscosity", any, any ? "Maxwell history at every skin point" : "no layer relaxes"});
}

void SkinPart::set_native(const Scene& scene, const Model& model, VectorXd& native) const {
  for (const LayerScene& l : scene.skin.layers) {
    const int at = model.native_block("layer/" + l.name).offset;
    const double f = relaxing_part(scene, l), mu = shear_modulus(l);
    native[at + SkinTheta::mu_inf] = (1 - f) * mu;
    native[at + SkinTheta::stiffening] = l.stiffening;
    native[at + SkinTheta::bulk] = bulk_modulus(l);
    native[at + SkinTheta::mu_m] = f * mu;
    native[at + SkinTheta::tau] = l.relaxation_time;
  }
}

bool SkinPart::add_derivative(const Scene& scene, const Model& model, const std::string& address,
                              VectorXd& d) const {
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
