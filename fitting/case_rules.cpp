#include "fitting/case_rules.h"

#include "fitting/case.h"
#include "sim/scene/names.h"
#include "sim/scene/schema.h"

namespace rhytid::fitting {
namespace {

/// Which image of COLMAP a camera is, and the length of its unit; also of clips and their views at `at`.
Rule colmap_image(const std::string& at, const std::string& rival) {
  Rule rule{.pointer = at + "/camera_image",
            .type = RuleType::string,
            .rival = rival,
            .doc = "With COLMAP: the image that the camera took, as in images.txt; default: the only one."};
  if (at.empty()) rule.fallback = "";
  return rule;
}

Rule colmap_unit(const std::string& at, const std::string& rival) {
  return {.pointer = at + "/camera_unit",
          .dimension = dimension::length,
          .min = 0,
          .min_is_open = true,
          .rival = rival,
          .doc = "With COLMAP: how long its unit is, which its files do not know."};
}

std::vector<Rule> file_rules() {
  return {
      {.pointer = "", .type = RuleType::object, .is_required = true, .doc = "A case."},
      {.pointer = "/$schema", .type = RuleType::string, .doc = "For editors; ignored."},
      {.pointer = "/name", .type = RuleType::string, .fallback = "", .doc = "Short name of the case."},
      {.pointer = "/description", .type = RuleType::string, .doc = "What it shows; ignored."},
      {.pointer = "/scene", .type = RuleType::path, .is_required = true, .doc = "Scene that the fit runs."},
      {.pointer = "/settings",
       .type = RuleType::array,
       .fallback = nlohmann::json::array(),
       .doc = "Changes of that scene, \"/pointer=value\"."},
      {.pointer = "/settings/*", .type = RuleType::string, .doc = "A change, \"/pointer=value\"."},
      {.pointer = "/camera",
       .type = RuleType::path,
       .doc = "OpenCV camera (`rhytid calibrate`), or the folder of COLMAP's cameras.txt and images.txt; "
              "default: the automatic one."},
      colmap_image("", ""),
      colmap_unit("", ""),
      {.pointer = "/footage", .type = RuleType::string, .fallback = "", .doc = "Video file."},
      {.pointer = "/tracks",
       .type = RuleType::string,
       .fallback = "",
       .doc = "Observations, tracks.csv; `rhytid convert` makes it of other programs' tables."},
      {.pointer = "/measurements",
       .type = RuleType::path,
       .doc = "What was measured besides, CSV frame,quantity,value,sigma: force_FINGER_x, _y, _z (N, of the "
              "skin on the collider), wrinkle_amplitude, wrinkle_wavelength (mm, on the line of "
              "/fit/wrinkles)."},
      {.pointer = "/truth", .type = RuleType::object, .doc = "What made the footage of a twin experiment."},
      {.pointer = "/truth/scene", .type = RuleType::path, .doc = "Scene; default: that of the fit."},
      {.pointer = "/truth/settings",
       .type = RuleType::array,
       .fallback = nlohmann::json::array(),
       .doc = "Changes of the truth's scene."},
      {.pointer = "/truth/settings/*", .type = RuleType::string, .doc = "A change, \"/pointer=value\"."},
  };
}

std::vector<Rule> clip_rules() {
  const std::string clip = "/clips/*", view = "/clips/*/cameras/*";
  return {
      {.pointer = "/clips",
       .type = RuleType::array,
       .min = 1,
       .max = 1000,
       .doc = "Experiments with the same skin, fitted together. Default: the case is one."},
      {.pointer = clip,
       .type = RuleType::object,
       .doc =
           "One run of its own; what is left out comes from the case. Its files are looked for and written "
           "in a folder of its name among the results."},
      {.pointer = clip + "/name",
       .type = RuleType::name,
       .is_required = true,
       .doc = "Short, for addresses."},
      {.pointer = clip + "/scene", .type = RuleType::path, .doc = "Scene; default: that of the case."},
      {.pointer = clip + "/settings",
       .type = RuleType::array,
       .fallback = nlohmann::json::array(),
       .doc = "Changes of the scene, behind those of the case."},
      {.pointer = clip + "/settings/*", .type = RuleType::string, .doc = "A change, \"/pointer=value\"."},
      {.pointer = clip + "/camera",
       .type = RuleType::path,
       .rival = "cameras",
       .doc = "OpenCV camera or COLMAP's folder; default: that of the case, with its image and unit."},
      colmap_image(clip, "cameras"),
      colmap_unit(clip, "cameras"),
      {.pointer = clip + "/footage", .type = RuleType::string, .rival = "cameras", .doc = "Video file."},
      {.pointer = clip + "/tracks",
       .type = RuleType::string,
       .rival = "cameras",
       .doc = "Observations, CSV."},
      {.pointer = clip + "/weight",
       .fallback = ClipCase().weight,
       .min = kLeastWeight,
       .max = 1,
       .doc = "What its tracks weigh against those of other clips: w counts all their variances 1/w times."},
      {.pointer = clip + "/measurements", .type = RuleType::path, .doc = "As that of a case."},
      {.pointer = clip + "/cameras",
       .type = RuleType::array,
       .min = 1,
       .max = 100,
       .doc = "Where several cameras saw the clip, in step with each other: one entry for each."},
      {.pointer = view, .type = RuleType::object, .doc = "What one camera saw."},
      {.pointer = view + "/name", .type = RuleType::name, .is_required = true, .doc = "Of the camera."},
      {.pointer = view + "/camera",
       .type = RuleType::path,
       .doc = "OpenCV camera or COLMAP's folder; default: that of the case, with its image and unit."},
      colmap_image(view, ""),
      colmap_unit(view, ""),
      {.pointer = view + "/footage", .type = RuleType::string, .doc = "Video file."},
      {.pointer = view + "/tracks", .type = RuleType::string, .doc = "Observations, CSV."},
      {.pointer = clip + "/truth",
       .type = RuleType::object,
       .doc = "What made the footage of a twin experiment; default: the truth of the case, with the clip's "
              "scene and settings."},
      {.pointer = clip + "/truth/scene", .type = RuleType::path, .doc = "Scene; default: that of the clip."},
      {.pointer = clip + "/truth/settings",
       .type = RuleType::array,
       .fallback = nlohmann::json::array(),
       .doc = "Changes of the truth's scene."},
      {.pointer = clip + "/truth/settings/*",
       .type = RuleType::string,
       .doc = "A change, \"/pointer=value\"."},
  };
}

std::vector<Rule> render_rules() {
  const RenderCase c;
  return {
      {.pointer = "/render",
       .type = RuleType::object,
       .fallback = nlohmann::json::object(),
       .doc = "How footage is made."},
      {.pointer = "/render/width",
       .type = RuleType::integer,
       .fallback = c.width,
       .min = 32,
       .max = 8192,
       .doc = "Of the automatic camera, px."},
      {.pointer = "/render/height",
       .type = RuleType::integer,
       .fallback = c.height,
       .min = 32,
       .max = 8192,
       .doc = "Of the automatic camera, px."},
      {.pointer = "/render/supersampling",
       .type = RuleType::integer,
       .fallback = c.supersampling,
       .min = 1,
       .max = 8,
       .doc = "Samples per pixel and axis."},
      {.pointer = "/render/noise",
       .fallback = c.noise,
       .min = 0,
       .max = 64,
       .doc = "Standard deviation, grey levels of 255."},
      {.pointer = "/render/seed",
       .type = RuleType::integer,
       .fallback = c.seed,
       .min = 0,
       .max = 2147483647,
       .doc = "Of the texture of the skin and of the noise."},
      {.pointer = "/render/texture_scale",
       .dimension = dimension::length,
       .fallback = c.texture_scale,
       .min = 0,
       .min_is_open = true,
       .doc = "Typical size of skin marks."},
      {.pointer = "/render/codec",
       .type = RuleType::option,
       .fallback = c.codec,
       .options = {"mjpg", "h264"},
       .doc = "mjpg in .avi, or h264 in .mp4, which is small but smooths the noise away."},
      {.pointer = "/render/finger",
       .type = RuleType::boolean,
       .fallback = c.finger,
       .doc = "Whether the colliders are seen."},
      {.pointer = "/render/finger_dots",
       .type = RuleType::integer,
       .fallback = 0,
       .min = 0,
       .max = 40,
       .doc = "Dark dots on each collider that is seen, for `finger --marker`."},
      {.pointer = "/render/tilt",
       .dimension = dimension::angle,
       .fallback = c.tilt,
       .min = 0,
       .max = 1.4,
       .doc = "Of the automatic camera off the mean normal."},
      {.pointer = "/render/truth_spacing",
       .type = RuleType::integer,
       .fallback = c.truth_spacing,
       .min = 1,
       .max = 1000,
       .doc = "Pixels between the material points of truth_tracks.csv."},
  };
}

std::vector<Rule> track_rules() {
  const TrackCase c;
  return {
      {.pointer = "/track",
       .type = RuleType::object,
       .fallback = nlohmann::json::object(),
       .doc = "How points are followed."},
      {.pointer = "/track/max_tracks",
       .type = RuleType::integer,
       .fallback = c.max_tracks,
       .min = 1,
       .max = 100000,
       .doc = "At most so many points, the best corners first."},
      {.pointer = "/track/min_distance",
       .fallback = c.min_distance,
       .min = 1,
       .max = 1000,
       .doc = "Between tracks, px."},
      {.pointer = "/track/roi",
       .type = RuleType::array,
       .min = 4,
       .max = 4,
       .doc = "Where points may start in the first frame: x, y, width, height in px."},
      {.pointer = "/track/roi/*", .min = 0, .max = 1e5, .doc = "Width and height at least 1."},
      {.pointer = "/track/mask_finger",
       .type = RuleType::boolean,
       .fallback = c.mask_finger,
       .doc = "Whether points that a collider of the scene covers are left out there."},
      {.pointer = "/track/window",
       .type = RuleType::integer,
       .fallback = c.window,
       .min = 7,
       .max = 201,
       .doc =
           "Side of the window about a point that is followed, px; odd. A small one resolves finer motion, a "
           "large one is surer where texture is weak."},
      {.pointer = "/track/redetect",
       .type = RuleType::boolean,
       .fallback = c.redetect,
       .doc = "Whether points that were covered or lost are looked for in later frames."},
      {.pointer = "/track/exposure",
       .min = 0,
       .max = 1,
       .doc = "Share of the frame interval that the shutter is open, whose blur is allowed for: 1/50 s at 25 "
              "frames a second "
              "is 0.5; 0: not allowed for; without it, it is found out from the blur."},
      {.pointer = "/track/model",
       .type = RuleType::option,
       .fallback = c.model,
       .options = {"affine", "translation"},
       .doc = "How the picture around a point may deform; translation has less freedom and fits skin that "
              "only shifts."},
  };
}

constexpr const char* introduction = R"(# The case file

<!-- Generated from the rules table by `rhytid schema case --docs`; edit the table instead. -->

Everything that one identification needs besides the scene: where footage, tracks and camera are, how footage is
rendered and tracked, which parameters are fitted. Comments, units, `extends`, paths and `--set` work as in scene
files (`rhytid schema --docs`). Parameters are addressed by the JSON pointer of their value in the scene, list items
by name or number: `/skin/layers/film/youngs_modulus`; what is left out of `fit/parameters/*` comes from the scene.
)";

}  // namespace

const std::vector<Rule>& case_rules() {
  static const std::vector<Rule> rules = [] {
    std::vector<Rule> all;
    for (std::vector<Rule> (*group)() : {&file_rules, &clip_rules, &render_rules, &track_rules, &fit_rules})
      for (Rule& rule : group()) all.push_back(std::move(rule));
    return all;
  }();
  return rules;
}

const RuleNode& case_rule_tree() {
  static const RuleNode root = build_rule_tree(case_rules());
  return root;
}

nlohmann::json case_schema() {
  return format_schema(case_rule_tree(), "case");
}

std::string case_documentation() {
  return format_documentation(case_rules(), case_rule_tree(), "case", introduction);
}

}  // namespace rhytid::fitting
