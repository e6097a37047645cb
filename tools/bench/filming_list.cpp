#include <algorithm>
#include <cmath>
#include <numbers>

#include "tools/bench/filming.h"

namespace rhytid::tools {
namespace {

/// The head at `shift` px amplitude: 0.31 of it per frame at most, and as much again at the rim by turn and zoom.
HeadRoll roll(double shift) {
  return {.shift_px = shift, .turn = 0.0045 * shift, .zoom = 0.0025 * shift};
}

double smooth_step(double x) {
  const double t = std::clamp(x, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

/// Light from one side, exp(strength) times as much as at the other, that turns by 90°.
auto side_light(double strength) {
  return [strength](double x, double y, double time) {
    const double angle = 0.5 * std::numbers::pi * time;
    return std::exp(strength * ((x - 0.5) * std::cos(angle) + (y - 0.375) * std::sin(angle)));
  };
}

/// A shadow that leaves 45 % of the light moves over the picture; its edge is `width` wide, over the picture's.
auto shadow(double width) {
  return [width](double x, double y, double time) {
    const double edge = -0.1 + 1.2 * time;
    return 1 - 0.55 * smooth_step((edge - x - 0.3 * (y - 0.375)) / width + 0.5);
  };
}

/// Gloss about a place that moves a quarter of the picture while the skin does not.
auto gloss(double strength) {
  return [strength](double x, double y, double time) {
    const double dx = x - 0.35 - 0.25 * time, dy = y - 0.35;
    return strength * std::exp(-(dx * dx + dy * dy) / (2 * 0.08 * 0.08));
  };
}

std::vector<Filming> all_filmings() {
  std::vector<Filming> list;
  const auto add = [&list](Filming f) { list.push_back(std::move(f)); };
  add({.name = "plain", .description = "noise of 1.5 grey"});
  add({.name = "noise_0.5", .description = "noise of 0.5 grey", .noise = 0.5});
  add({.name = "noise_4", .description = "noise of 4 grey", .noise = 4});
  add({.name = "h264", .description = "H.264 as OpenCV writes it", .h264 = true});
  add({.name = "fading", .description = "light falls to 0.5 evenly", .gain = [](double, double, double t) {
         return 1 - 0.5 * t;
       }});
  add({.name = "flicker",
       .description = "light 0.75 to 1.25, another in every frame",
       .flicker = {1, 1.21, 0.84, 1.08, 0.77, 1.17, 0.93, 1.24, 0.8, 1.03, 0.88, 1.13}});
  add({.name = "side_light",
       .description = "light 1.8 : 1 across the picture, turning by 90°",
       .gain = side_light(0.6)});
  add({.name = "strong_side_light",
       .description = "7 : 1 across the picture, turning by 90°",
       .gain = side_light(2)});
  add({.name = "soft_shadow",
       .description = "a shadow to 0.45 passes, edge 15 % of the width",
       .gain = shadow(0.15)});
  add({.name = "hard_shadow", .description = "the same, edge 1 % of the width", .gain = shadow(0.01)});
  add({.name = "gloss",
       .description = "gloss of radius 8 % of the width, 0.15 of white, moves over the skin",
       .added = gloss(0.15)});
  add({.name = "strong_gloss", .description = "the same, 0.8 of white: saturated", .added = gloss(0.8)});
  add({.name = "defocus", .description = "blur grows from 0 to 1.5 px", .defocus_px = 1.5});
  add({.name = "head_2",
       .description = "the head rolls, 2 px a frame at most in its middle",
       .head = roll(6)});
  add({.name = "head_5", .description = "5 px a frame", .head = roll(16)});
  add({.name = "head_9", .description = "9 px a frame", .head = roll(28)});
  for (const double e : {0.25, 0.5, 1.0}) {
    char name[32];
    std::snprintf(name, sizeof(name), "head_5_open_%.2g", e);
    add({.name = name,
         .description = "the same as head_5, shutter open for that share of the frame interval",
         .exposure = e,
         .head = roll(16)});
  }
  for (const double e : {0.0, 0.25, 0.5, 1.0}) {
    char name[32];
    std::snprintf(name, sizeof(name), e == 0 ? "swipe" : "swipe_open_%.2g", e);
    add({.name = name,
         .description = e == 0 ? "all is pushed 40 px forth and back from rest, 8 px a frame at most"
                               : "the same, shutter open for that share of the frame interval",
         .exposure = e,
         .head = {.swipe_px = 40}});
  }
  add({.name = "open_1", .description = "the head is still, shutter open all the time", .exposure = 1});
  add({.name = "disc_masked",
       .description = "a disc passes, its mask is given",
       .has_disc = true,
       .is_disc_masked = true});
  add({.name = "disc", .description = "a disc passes, no mask", .has_disc = true});
  add({.name = "disc_given_up",
       .description = "a disc passes, no mask, lost points are not looked for",
       .has_disc = true,
       .redetect = false});
  add({.name = "webcam",
       .description = "5 px a frame, shutter open half the time, side light, flicker, noise of 3 grey, H.264",
       .exposure = 0.5,
       .noise = 3,
       .head = roll(16),
       .gain = side_light(0.6),
       .flicker = {1, 1.05, 0.97, 1.02, 0.95, 1.04, 0.98},
       .h264 = true});
  return list;
}

}  // namespace

const std::vector<Filming>& filmings() {
  static const std::vector<Filming> list = all_filmings();
  return list;
}

}  // namespace rhytid::tools
