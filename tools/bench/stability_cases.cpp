#include "tools/bench/stability_cases.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <random>

namespace rhytid::tools {
namespace {

std::string text_of(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

constexpr double kFrameTime = 1. / 24;  // s
constexpr double kTotal = 1.65;         // mm, of both layers

class CaseList {
 public:
  using enum StabilityDemand;
  std::vector<StabilityCase> cases;

  void add(const std::string& sweep, const std::string& value, std::vector<std::string> settings,
           bool quick = false, StabilityDemand demand = converges) {
    cases.push_back({sweep, value, std::move(settings), quick, demand});
  }

  /// One case per value; `settings` end in '=' or contain none, then they stand as they are.
  void sweep(const std::string& name, const std::vector<double>& values,
             const std::vector<std::string>& settings, const std::vector<double>& quick = {},
             double beyond = INFINITY) {
    for (const double value : values) {
      std::vector<std::string> set;
      for (const std::string& s : settings) set.push_back(s.back() == '=' ? s + text_of(value) : s);
      bool is_quick = false;
      for (const double q : quick) is_quick = is_quick || q == value;
      add(name, text_of(value), set, is_quick, value > beyond ? clear_outcome : converges);
    }
  }
};

void add_materials(CaseList& list) {
  list.sweep("Poisson's ratio", {0.3, 0.4, 0.45, 0.49, 0.499, 0.4999},
             {"/skin/layers/soft/poissons_ratio=", "/skin/layers/film/poissons_ratio="}, {0.4999});
  for (const double ratio : {1., 10., 100., 1e3, 1e4})
    list.add("layer stiffness ratio", text_of(ratio),
             {"/skin/layers/film/youngs_modulus=" + text_of(0.02 * ratio)}, ratio == 1e4);
  for (int power = -6; power <= 6; power += 2) {
    const std::string tau = text_of(kFrameTime / std::pow(10., power));
    for (const std::string damper : {"exponential", "literal", "strang", "backward_euler", "none"}) {
      if (damper != "exponential" && std::abs(power) < 6) continue;
      list.add("dt / tau (" + damper + ")", text_of(std::pow(10., power)),
               {"/skin/layers/soft/relaxation_time=" + tau, "/skin/layers/film/relaxation_time=" + tau,
                "/time/damper=" + damper},
               damper == "exponential" && std::abs(power) == 6);
    }
  }
  list.add("stiffening C", "0", {"/skin/layers/soft/stiffening=0", "/skin/layers/film/stiffening=0"}, true);
  list.sweep("stiffening C", {1e-9, 1e-3, 0.25, 1, 5, 20},
             {"/skin/layers/soft/stiffening=", "/skin/layers/film/stiffening="}, {20});
  list.sweep("relaxing fraction", {0, 1e-9, 0.5, 0.999, 0.999999},
             {"/skin/layers/soft/relaxing_fraction=", "/skin/layers/film/relaxing_fraction="});
  for (const double share : {1e-3, 1e-2, 0.05, 0.1, 0.3, 0.5})
    list.add("film / total thickness", text_of(share),
             {"/skin/layers/film/thickness=" + text_of(share * kTotal),
              "/skin/layers/soft/thickness=" + text_of((1 - share) * kTotal)},
             share == 1e-3);
}

void add_ligaments(CaseList& list) {
  list.add("ligament b, 1/mm", "0",
           {"/ligaments/sources/left/strength=0", "/ligaments/sources/right/strength=0"}, true);
  list.sweep("ligament b, 1/mm", {1e-6, 1e-3, 1, 10, 100, 1e3, 1e4},
             {"/ligaments/sources/left/strength=", "/ligaments/sources/right/strength="}, {1e4});
  list.sweep("ligament eps, mm", {1e-8, 1e-6, 1e-4, 1e-2, 1}, {"/ligaments/smoothing="}, {1e-8, 1e-6});
  for (const double b : {1e-6, 1., 1e4})
    list.add("ligament b (fung_quadratic), 1/mm", text_of(b),
             {"/ligaments/law=fung_quadratic", "/ligaments/sources/left/strength=" + text_of(b),
              "/ligaments/sources/right/strength=" + text_of(b)},
             b == 1e4);
  list.sweep("ligament stiffness, MPa", {1e-9, 1e-3, 1, 1e3}, {"/ligaments/stiffness="});
  list.sweep("diffusion time, mm^2", {1e-9, 1, 1e9}, {"/ligaments/diffusion_time="});
}

void add_contact(CaseList& list) {
  list.sweep("kappa, kPa/mm", {1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9}, {}, {});
  // κ in kPa/mm as the sweep is stated; scenes are set in MPa/mm.
  for (StabilityCase& one : list.cases)
    if (one.sweep == "kappa, kPa/mm") {
      const std::string kappa = text_of(std::stod(one.value) / 1000);
      one.settings = {"/base/stiffness=" + kappa, "/colliders/finger/stiffness=" + kappa};
      one.is_quick = one.value == "100000" || one.value == "1e+09";
    }
  list.sweep("onset eps_g, mm", {0, 1e-8, 1e-6, 1e-4, 1e-2, 1}, {"/base/onset=", "/colliders/finger/onset="},
             {1e-8});
  list.sweep("slip speed eps_v, mm/s", {1e-6, 1e-4, 1e-2, 1, 1e2}, {"/colliders/finger/friction/slip_speed="},
             {1e-6});
  list.sweep("slip speed (quadratic), mm/s", {1e-6, 1, 1e2},
             {"/colliders/finger/friction/mollifier=quadratic", "/colliders/finger/friction/slip_speed="},
             {1e-6});
  list.sweep("friction coefficient", {0, 0.1, 1, 10}, {"/colliders/finger/friction/coefficient="});
  for (const double speed : {1., 10., 100., 1e3, 1e4, 1e6})
    list.add("finger speed, mm/s", text_of(speed),
             {"/colliders/finger/"
              "path=[{\"time\":0,\"position\":[-2,0,5.02]},{\"time\":0.0833333333333,\"position\":"
              "[-2,0,4.6]},{\"time\":1.0833333333333,\"position\":[" +
              text_of(-2 + speed) + ",0,4.6]}]"},
             speed == 1e4, speed > 100 ? CaseList::clear_outcome : CaseList::converges);
  for (const double depth : {0.1, 0.4, 0.8, 1.2, 1.6, 3., 10., 100.})
    list.add("finger depth, mm", text_of(depth),
             {"/colliders/finger/"
              "path=[{\"time\":0,\"position\":[-2,0,5.02]},{\"time\":0.0833333333333,\"position\":"
              "[-2,0," +
              text_of(5 - depth) + "]}]"},
             depth == 100, depth > 1 ? CaseList::clear_outcome : CaseList::converges);
}

void add_shapes(CaseList& list) {
  for (const double aspect : {10., 100., 1e3, 1e4}) {
    list.add("aspect, thickness", text_of(aspect), {"/skin/layers/film/thickness=" + text_of(4 / aspect)},
             aspect == 1e4);
    // Four cells of 5 mm along the strip, ten across it.
    list.add("aspect, in plane", text_of(aspect),
             {"/skin/surface/grid/size=[20," + text_of(50 / aspect) + "]", "/skin/surface/grid/cells=[4,10]"},
             aspect == 1e4);
  }
  list.sweep("in-plane order p", {1, 2, 3, 4}, {"/skin/order="});
  list.add("composite", "q = 3", {"/skin/scheme=composite"});
}

/// The finger in another shape, with the path of the base scene, turned by up to `degrees` about `axis` on the way.
std::vector<std::string> other_finger(const std::string& shape, const std::vector<std::string>& more,
                                      double degrees = 0, const char* axis = "[0,0,1]") {
  std::vector<std::string> settings = {"/colliders/finger/shape=" + shape};
  settings.insert(settings.end(), more.begin(), more.end());
  double direction[3];
  std::sscanf(axis, "[%lf,%lf,%lf]", direction, direction + 1, direction + 2);
  const auto knot = [&](double time, double x, double z, double part) {
    std::string turn;
    for (int a = 0; a < 3; ++a)
      turn += (a ? "," : "") + text_of(direction[a] * part * degrees * std::acos(-1.) / 180);
    return "{\"time\":" + text_of(time) + ",\"position\":[" + text_of(x) + ",0," + text_of(z) +
           "],\"rotation\":[" + turn + "]}";
  };
  settings.push_back("/colliders/finger/path=[" + knot(0, -2, 5.02, 0) + "," +
                     knot(2 * kFrameTime, -2, 4.6, 0.5) + "," + knot(4 * kFrameTime, -1.2, 4.6, 1) + "]");
  return settings;
}

void add_fingers(CaseList& list) {
  for (const double length : {0., 6., 1e3})
    list.add("capsule, length mm", text_of(length),
             other_finger("capsule",
                          {"/colliders/finger/axis=[0,1,0]", "/colliders/finger/length=" + text_of(length)}),
             length == 1e3);
  for (const char* semi_axes : {"[8,3,5]", "[1e3,1e3,5]", "[0.05,0.05,5]"})
    list.add("ellipsoid, semi-axes mm", semi_axes,
             other_finger("ellipsoid", {std::string("/colliders/finger/semi_axes=") + semi_axes}), false,
             semi_axes[1] == '0' ? CaseList::clear_outcome : CaseList::converges);
  for (const double depth : {0.1, 0.4, 1.2})
    list.add("plane pressed down, mm", text_of(depth),
             {"/colliders/finger/shape=plane", "/colliders/finger/normal=[0,0,-1]",
              "/colliders/finger/path=[{\"time\":0,\"position\":[0,0,0.02]},{\"time\":0.1666666666667,"
              "\"position\":[0.5,0," +
                  text_of(-depth) + "]}]"},
             depth == 0.1, depth > 1 ? CaseList::clear_outcome : CaseList::converges);
  for (const double degrees : {1e-9, 90., 330.}) {
    list.add("turn of a sphere about x, deg", text_of(degrees),
             other_finger("sphere", {}, degrees, "[1,0,0]"), degrees == 330);
    list.add(
        "turn of a capsule about z, deg", text_of(degrees),
        other_finger("capsule", {"/colliders/finger/axis=[0,1,0]", "/colliders/finger/length=6"}, degrees));
  }
  list.add("turn of a sphere about x, deg", "180 between knots", other_finger("sphere", {}, 360, "[1,0,0]"),
           true, CaseList::refused);
  list.add("path", "spline", {"/colliders/finger/interpolation=spline"});
  list.add("path", "clamped_spline", {"/colliders/finger/interpolation=clamped_spline"});
}

/// Tension at rest, held parts, and what else a scene may ask of its steps and rules.
void add_features(CaseList& list) {
  // Equal stretches in the plane and nothing else: every eigenvalue of the strain is at least double.
  for (const double stretch : {1., 1.00000001, 1.3, 2., 2.5})
    list.add(
        "equibiaxial pre-stretch alone", text_of(stretch),
        {"/skin/pre_stretch/stretch=" + text_of(stretch), "/colliders=[]", "/base=null", "/ligaments=null"},
        stretch == 1.3, stretch > 1.5 ? CaseList::clear_outcome : CaseList::converges);
  for (const double stretch : {0.4, 0.7, 0.95, 1.05, 1.3, 2.5})
    list.add("pre-stretch", text_of(stretch), {"/skin/pre_stretch/stretch=" + text_of(stretch)},
             stretch == 1.3, stretch < 0.9 || stretch > 1.5 ? CaseList::clear_outcome : CaseList::converges);
  list.add("pre-stretch", "1.3 along x, 0.9 across",
           {R"(/skin/pre_stretch={"stretch": 1.3, "across": 0.9, "direction": [1, 0, 0]})"});
  for (const double shift : {0., 0.1, 1., 3., 10.})
    list.add("held side moved, mm", text_of(shift),
             {R"(/skin/held=[{"name": "side", "box": {"low": [-8, -6, 0], "high": [-8, 6, 0]},
                "path": [{"time": 0, "displacement": [0, 0, 0]}, {"time": 0.1666666666667, "displacement": [)" +
              text_of(-shift) + "," + text_of(0.5 * shift) + ",0]}]}]"},
             shift == 1, shift > 1 ? CaseList::clear_outcome : CaseList::converges);
  list.sweep("passes over the lag", {2, 12, 100}, {"/time/lag_passes="}, {2});
  list.sweep("substeps", {2, 16}, {"/time/substeps="}, {2});
  for (const char* nu : {"0.49", "0.4999"})
    list.add("volume reduced, nu", nu,
             {"/skin/quadrature/volume=reduced", std::string("/skin/layers/soft/poissons_ratio=") + nu,
              std::string("/skin/layers/film/poissons_ratio=") + nu},
             nu == std::string("0.4999"));
  for (int p = 1; p <= 4; ++p)
    list.add("sheet rule, p", text_of(p),
             {"/skin/quadrature/rule=sheet", "/skin/order=" + text_of(p),
              std::string("/skin/layers/soft/order=") + (p == 1 ? "1" : "2"),
              std::string("/skin/layers/film/order=") + (p == 1 ? "1" : "2")},
             p == 2, p == 1 ? CaseList::clear_outcome : CaseList::converges);
  list.add("sheet rule, p", "2 under order 4 through the thickness",
           {"/skin/quadrature/rule=sheet", "/skin/layers/soft/order=4"}, true, CaseList::refused);
  list.add("IMLS kernel", "literal", {"/base/shape=imls", "/base/imls_kernel=literal"}, true);
}

void add_degenerate(CaseList& list) {
  const std::string here = "\"position\":[0,0,";
  const auto held_at = [&](double height) {
    return "/colliders/finger/path=[{\"time\":0," + here + text_of(height) + "]}]";
  };
  list.add("degenerate", "exact rest, nothing touches", {held_at(50)}, true);
  list.add("degenerate", "no colliders", {"/colliders=[]"}, true);
  list.add("degenerate", "no colliders, no base, no ligaments",
           {"/colliders=[]", "/base=null", "/ligaments=null"}, true);
  list.add("degenerate", "no sources", {"/ligaments/sources=[]"}, true, CaseList::refused);
  list.add("degenerate", "sources far away", {"/ligaments/sources/left/position=[1e4,0,0]"}, false,
           CaseList::clear_outcome);
  list.add("degenerate", "two sources at one place", {"/ligaments/sources/left/position=[5,-1,0]"});
  list.add("degenerate", "no frames", {"/time/frames=0"}, true);
  // The outer surface is the plane z = 0; with six cells along x and four across a vertex lies at the origin.
  list.add("degenerate", "finger centre on a node",
           {held_at(0), "/skin/surface/grid/cells=[6,4]", "/colliders/finger/radius=1"}, true,
           CaseList::clear_outcome);
  list.add("degenerate", "finger just touching", {held_at(5)}, true);
  list.add("degenerate", "finger in the skin from the start", {held_at(4.5)});
  list.add("degenerate", "finger of 0.05 mm", {"/colliders/finger/radius=0.05", held_at(-0.2)}, false,
           CaseList::clear_outcome);
  list.add("degenerate", "point outside IMLS support", {"/base/shape=imls", "/base/imls_support=0.01"}, true,
           CaseList::refused);
  list.add("degenerate", "IMLS base", {"/base/shape=imls"}, true);
  list.add("degenerate", "IMLS base, finger pushes through",
           {"/base/shape=imls", "/colliders/finger/path/1/position=[-2,0,1]"}, false,
           CaseList::clear_outcome);
  list.add("degenerate", "nothing holds the skin", {"/skin/rim=free", "/base=null", "/ligaments=null"}, false,
           CaseList::clear_outcome);
  list.add("degenerate", "free rim on ligaments alone", {"/skin/rim=free", "/base=null"}, false);
  list.add("degenerate", "sliding rim", {"/skin/rim=sliding"});
  list.add("degenerate", "one square of skin", {"/skin/surface/grid/cells=[1,1]"});
  list.add("degenerate", "tolerance below rounding",
           {"/solver/relative_tolerance=0", "/solver/absolute_tolerance=1e-30"}, true,
           CaseList::clear_outcome);
  list.add("degenerate", "one iteration allowed", {"/solver/max_iterations=1"}, true,
           CaseList::clear_outcome);
  list.add("clock of the paths", "-1 s: before all knots", {"/time/offset=-1"}, true);
  for (const char* offset : {"-1e-3", "1e-9", "0.05", "1"})
    list.add("clock of the paths", std::string(offset) + " s", {std::string("/time/offset=") + offset});
  list.add("clock of the paths", "1e6 s: after all knots", {"/time/offset=1e6"});
  list.add("factor precision", "full", {"/solver/factor_precision=full"});
  list.add("factor precision", "mixed", {"/solver/factor_precision=mixed"}, true);
  const std::string mixed = "/solver/factor_precision=mixed";
  list.add("factor precision", "mixed, Poisson's ratio 0.4999",
           {mixed, "/skin/layers/soft/poissons_ratio=0.4999", "/skin/layers/film/poissons_ratio=0.4999"});
  list.add("factor precision", "mixed, moduli 1e4:1", {mixed, "/skin/layers/film/youngs_modulus=200"});
  list.add("factor precision", "mixed, penalty 1e9 kPa/mm",
           {mixed, "/base/stiffness=1e6", "/colliders/finger/stiffness=1e6"}, true);
  list.add("factor precision", "mixed, film 0.001 of the total",
           {mixed, "/skin/layers/film/thickness=0.00165"});
  list.add("factor precision", "mixed, ligaments rounded over 1e-8 mm", {mixed, "/ligaments/smoothing=1e-8"});
  list.add("minimiser", "newton_projected", {"/solver/minimiser=newton_projected"});
  list.add("minimiser", "lbfgs", {"/solver/minimiser=lbfgs"});
  list.add("minimiser", "lbfgs_literal", {"/solver/minimiser=lbfgs_literal"});
}

/// Several extremes at once, drawn with a fixed seed: what one-at-a-time sweeps cannot see.
void add_corners(CaseList& list) {
  std::mt19937 random(20240311);
  const auto pick = [&random](const char* low, const char* middle, const char* high) {
    return std::string(std::array{low, middle, high}[random() % 3]);
  };
  for (int k = 1; k <= 16; ++k) {
    const std::string nu = pick("0.3", "0.49", "0.4999"), film = pick("0.02", "1", "200"),
                      tau = pick("4e-8", "0.04", "4e4"), c = pick("1e-3", "1", "20"),
                      b = pick("1e-3", "1", "1e4"), kappa = pick("0.1", "10", "1e4"),
                      eps = pick("1e-4", "1e-2", "1"), onset = pick("1e-6", "1e-3", "0.1"),
                      slip = pick("1e-3", "1", "1e2"), thickness = pick("0.00165", "0.15", "0.8");
    std::vector<std::string> settings = {"/skin/layers/soft/poissons_ratio=" + nu,
                                         "/skin/layers/film/poissons_ratio=" + nu,
                                         "/skin/layers/film/youngs_modulus=" + film,
                                         "/skin/layers/soft/relaxation_time=" + tau,
                                         "/skin/layers/soft/stiffening=" + c,
                                         "/skin/layers/film/stiffening=" + c,
                                         "/ligaments/sources/left/strength=" + b,
                                         "/ligaments/smoothing=" + eps,
                                         "/base/stiffness=" + kappa,
                                         "/colliders/finger/stiffness=" + kappa,
                                         "/base/onset=" + onset,
                                         "/colliders/finger/onset=" + onset,
                                         "/colliders/finger/friction/slip_speed=" + slip,
                                         "/skin/layers/film/thickness=" + thickness};
    list.add("corner", std::to_string(k), settings, k % 4 == 1 || k == 6 || k == 12);
    settings.emplace_back("/solver/factor_precision=mixed");
    list.add("corner, mixed precision", std::to_string(k), std::move(settings), k == 6);
  }
}

}  // namespace

std::string stability_scene() {
  return R"({
  "name": "stability",
  "description": "every feature on a small patch; what bench stability takes to extremes",
  "skin": {
    "surface": {"grid": {"size": ["16 mm", "12 mm"], "cells": [4, 3]}},
    "order": 2,
    "layers": [
      {"name": "soft", "thickness": "1.5 mm", "order": 2, "youngs_modulus": "20 kPa"},
      {"name": "film", "thickness": "0.15 mm", "order": 1, "youngs_modulus": "1 MPa"}
    ]
  },
  "ligaments": {
    "stiffness": "0.5 kPa", "diffusion_time": "8 mm^2",
    "sources": [
      {"name": "left", "position": [-5, 1, 0], "strength": 0.5, "radius": "6 mm"},
      {"name": "right", "position": [5, -1, 0], "strength": 3, "radius": "6 mm"}
    ]
  },
  "base": {"shape": "plane"},
  "colliders": [
    {"name": "finger", "shape": "sphere", "radius": "5 mm", "friction": {"coefficient": 0.8},
     "path": [{"time": 0, "position": [-2, 0, 5.02]}, {"time": 0.0833333333333, "position": [-2, 0, 4.6]},
              {"time": 1.0833333333333, "position": [8, 0, 4.6]}]}
  ],
  "time": {"frame_rate": "24 Hz", "frames": 4}
}
)";
}

const std::vector<StabilityCase>& stability_cases() {
  static const std::vector<StabilityCase> all = [] {
    CaseList list;
    add_materials(list);
    add_ligaments(list);
    add_contact(list);
    add_shapes(list);
    add_fingers(list);
    add_features(list);
    add_degenerate(list);
    add_corners(list);
    return std::move(list.cases);
  }();
  return all;
}

}  // namespace rhytid::tools
