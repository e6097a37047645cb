// A finger's path from tracked points of it: deviations that hold, what few points determine, points that go.
#include "fitting/finger_marker.h"

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tests/fitting/finger_camera.h"
#include "tests/support/temporary_folder.h"

namespace rhytid::fitting {
namespace {

using testing::HasSubstr;

constexpr int kFrames = 7;

/// Moves by 4 mm and turns by `turn` rad.
std::vector<BodyPose> path(double turn) {
  std::vector<BodyPose> poses;
  for (int f = 0; f <= kFrames; ++f) {
    const double s = static_cast<double>(f) / kFrames;
    poses.push_back({Vec3(-2 + 4 * s, 0.5 - s, 5 - 0.6 * s),
                     Eigen::AngleAxisd(turn * s, Vec3(1, 2, -1).normalized()).toRotationMatrix()});
  }
  return poses;
}

struct Noise {
  double named = 0.5, of_template = 0.06, own = 0.05;  ///< px per axis
};

struct Footage {
  std::vector<Landmark> marker;
  TrackSet tracks;
};

/// `count` points on the side of a ball of 6 mm that the camera sees; one in the middle, the others about it.
Footage footage(const std::vector<BodyPose>& poses, int count, unsigned seed, const Noise& noise = {}) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  const auto error = [&](double sigma) {
    const double x = normal(random);
    return Vec2(sigma * x, sigma * normal(random));
  };
  const Camera camera = finger_camera();
  const Vec3 toward = (camera.centre() - poses[0].centre).normalized(), side = toward.unitOrthogonal(),
             third = toward.cross(side);
  Footage made;
  for (int i = 0; i < count; ++i) {
    const double angle = 2.4 * i, far = i == 0 ? 0 : 0.5;
    Landmark& l = made.marker.emplace_back();
    l.name = "p" + std::to_string(i);
    l.point = poses[0].rotation.transpose() *
              (6 * (toward + far * (std::cos(angle) * side + std::sin(angle) * third)).normalized());
    l.sigma = noise.named;
    const auto seen = [&](int f) {
      return camera.project(poses[static_cast<std::size_t>(f)].centre +
                            poses[static_cast<std::size_t>(f)].rotation * l.point);
    };
    const Vec2 named = error(noise.named), common = named + error(noise.of_template);
    l.pixel = seen(0) + named;
    Track& track = made.tracks.tracks.emplace_back();
    track.id = i;
    for (int f = 0; f <= kFrames; ++f) {
      Observation& o = track.observations.emplace_back();
      o.frame = f;
      o.status = TrackStatus::ok;
      o.pixel = f == 0 ? l.pixel : Vec2(seen(f) + common + error(noise.own));
      o.covariance = std::pow(f == 0 ? noise.of_template : noise.own, 2) * Eigen::Matrix2d::Identity();
    }
  }
  return made;
}

void lose(Footage& made, std::size_t point, int from) {
  for (Observation& o : made.tracks.tracks[point].observations)
    if (o.frame >= from) o.status = TrackStatus::lost;
}

constexpr MarkerOptions kPlain{.floor = 0.001, .huber = 0};

MarkerMotion followed(const Footage& made, const std::vector<BodyPose>& of_scene,
                      const MarkerOptions& options = kPlain) {
  return follow_marker(made.tracks, made.marker, finger_camera(), of_scene, options, "dots.csv");
}

/// The scene's path is known to a millimetre or so.
std::vector<BodyPose> shifted(std::vector<BodyPose> poses, const Vec3& by) {
  for (BodyPose& pose : poses) pose.centre += by;
  return poses;
}

/// Mean of eᵀ C⁻¹ e / 3 over frames of the centre, and of its differences between neighbours with the own covariances.
struct Normalised {
  double total = 0, own = 0;
};
Normalised normalised(int points, const MarkerOptions& options, double turn, double named) {
  constexpr int draws = 120;
  const std::vector<BodyPose> truth = path(turn);
  Normalised mean;
  for (int draw = 0; draw < draws; ++draw) {
    const Footage made = footage(truth, points, 500 + static_cast<unsigned>(draw), {.named = named});
    const MarkerMotion motion = followed(made, shifted(truth, Vec3(0.5, -0.4, 0.6)), options);
    // What is off more than stated widens, what is off less does not narrow: that is taken out here.
    const double widened = std::max(1.0, std::pow(motion.shift_scale, 2));
    Vec3 before = Vec3::Zero();
    for (std::size_t f = 0; f < truth.size(); ++f) {
      const MarkerFrame& frame = motion.frames[f];
      EXPECT_EQ(frame.lost, "");
      const Vec3 error = frame.pose.centre - truth[f].centre;
      mean.total += widened * error.dot(frame.covariance.inverse() * error) / 3 / draws / (kFrames + 1);
      if (f > 1) {  // the template's noise is not in frame 0
        const Vec3 step = error - before;
        mean.own +=
            step.dot((frame.own + motion.frames[f - 1].own).inverse() * step) / 3 / draws / (kFrames - 1);
      }
      before = error;
    }
  }
  return mean;
}

TEST(FingerMarker, StatesItsErrors) {
  struct Way {
    const char* words;
    int points;
    MarkerOptions options;
    double turn;
  };
  MarkerOptions held = kPlain;
  held.hold_rotation = true;
  for (const Way& way : {Way{"six points, turning", 6, kPlain, 0.3}, Way{"six points, held", 6, held, 0.3},
                         Way{"two points", 2, kPlain, 0}}) {
    // What is named wrong also changes as the finger moves, so that single frames are judged where little is.
    const double total = normalised(way.points, way.options, way.turn, 0.5).total,
                 own = normalised(way.points, way.options, way.turn, 0.02).own;
    std::printf("%s: normalised %.2f, from frame to frame %.2f\n", way.words, total, own);
    EXPECT_NEAR(total, 1, 0.25) << way.words;  // of 360 independent values: 1 ± 0.075
    EXPECT_NEAR(own, 1, 0.15) << way.words;
  }
}

TEST(FingerMarker, WithoutNoiseIsExact) {
  const std::vector<BodyPose> truth = path(0.4);
  const Noise none{1e-6, 1e-6, 1e-6};
  const MarkerMotion six = followed(footage(truth, 6, 1, none), shifted(truth, Vec3(3, -2, 2)));
  EXPECT_TRUE(six.turns);
  const MarkerMotion two = followed(footage(truth, 2, 1, none), shifted(truth, Vec3(3, -2, 2)));
  EXPECT_FALSE(two.turns);
  for (std::size_t f = 0; f < truth.size(); ++f) {
    EXPECT_LT((six.frames[f].pose.centre - truth[f].centre).norm(), 1e-4);
    EXPECT_LT((six.frames[f].pose.rotation - truth[f].rotation).norm(), 1e-4);
    EXPECT_LT((two.frames[f].pose.centre - truth[f].centre).norm(), 1e-4);
  }
}

TEST(FingerMarker, OnePointNeedsTheDepthOfTheScene) {
  const std::vector<BodyPose> truth = path(0);
  const Footage made = footage(truth, 1, 3, {1e-6, 1e-6, 1e-6});
  try {
    (void)followed(made, truth);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("dots.csv: got 1 of 1 marker point"));
    EXPECT_THAT(error.what(), HasSubstr("--depth-of-scene"));
  }
  MarkerOptions options = kPlain;
  options.depth_of_scene = true;
  const Camera camera = finger_camera();
  const Vec3 across = camera.rotation.transpose() * Vec3(2, -1, 0);  // off, but at the right depth
  const MarkerMotion motion = followed(made, shifted(truth, across), options);
  for (std::size_t f = 0; f < truth.size(); ++f)
    EXPECT_LT((motion.frames[f].pose.centre - truth[f].centre).norm(), 1e-4);
}

TEST(FingerMarker, APointThatGoesDoesNotMoveThePath) {
  const std::vector<BodyPose> truth = path(0);
  const Footage whole = footage(truth, 6, 11, {2, 0.02, 0.02});  // pixels named badly
  Footage late = whole, early = whole;
  lose(late, 2, 4);
  early.marker.erase(early.marker.begin() + 2);
  MarkerOptions held = kPlain;
  held.hold_rotation = true;
  const MarkerMotion a = followed(whole, truth, held), b = followed(late, truth, held),
                     without = followed(early, truth, held);
  for (std::size_t f = 4; f < truth.size(); ++f) {
    EXPECT_EQ(b.frames[f].seen, 5);
    EXPECT_LT((a.frames[f].pose.centre - b.frames[f].pose.centre).norm(), 0.05);
  }
  // The other five by themselves put it elsewhere.
  EXPECT_GT((a.frames[4].pose.centre - without.frames[4].pose.centre).norm(), 0.1);
}

TEST(FingerMarker, ASlippedTrackIsDiscounted) {
  const std::vector<BodyPose> truth = path(0);
  Footage made = footage(truth, 6, 5);
  for (Observation& o : made.tracks.tracks[1].observations)
    if (o.frame >= 5) o.pixel += Vec2(6, -4);
  MarkerOptions robust = kPlain;
  robust.huber = 3;
  const double plain = (followed(made, truth).frames[6].pose.centre - truth[6].centre).norm(),
               discounted = (followed(made, truth, robust).frames[6].pose.centre - truth[6].centre).norm();
  EXPECT_LT(discounted, 0.4 * plain) << plain;
}

TEST(FingerMarker, IsLostWhereTooFewAreSeen) {
  const std::vector<BodyPose> truth = path(0);
  Footage made = footage(truth, 5, 5);
  lose(made, 0, 3);
  lose(made, 1, 5);
  const MarkerMotion motion = followed(made, truth);
  ASSERT_TRUE(motion.turns);
  EXPECT_EQ(motion.frames[4].lost, "");
  EXPECT_EQ(motion.frames[5].lost, "3 of 5 marker points are seen, at least 4 are needed");
  for (std::size_t i = 0; i < 5; ++i) lose(made, i, 6);
  MarkerOptions held = kPlain;
  held.hold_rotation = true;
  const MarkerMotion rest = followed(made, truth, held);
  EXPECT_EQ(rest.frames[5].lost, "");
  EXPECT_EQ(rest.frames[6].lost, "0 of 5 marker points are seen, at least 2 are needed");
}

TEST(FingerMarker, SaysWhenPointsDoNotAgreeOrDetermineNothing) {
  const std::vector<BodyPose> truth = path(0);
  Footage made = footage(truth, 6, 5);
  EXPECT_TRUE(followed(made, truth).doubts.empty());
  made.marker[3].point += Vec3(1, 1, 0);
  const MarkerMotion motion = followed(made, truth);
  ASSERT_FALSE(motion.doubts.empty());
  EXPECT_THAT(motion.doubts[0], HasSubstr("the marker's points are off by "));

  const auto message = [&](const Footage& bad) -> std::string {
    try {
      (void)followed(bad, truth);
    } catch (const InputError& error) {
      return error.what();
    }
    return "nothing";
  };
  Footage behind = footage(truth, 2, 5);
  std::swap(behind.marker[0].point, behind.marker[1].point);  // seen as from behind
  EXPECT_THAT(message(behind), HasSubstr("no place in front of the camera explains"));
  Footage same = footage(truth, 2, 5, {1e-6, 1e-6, 1e-6});
  same.marker[1].point = same.marker[0].point;
  EXPECT_THAT(message(same), HasSubstr("dots.csv: got marker points"));
  Footage none = footage(truth, 3, 5);
  for (std::size_t i = 0; i < 3; ++i) lose(none, i, 1);
  EXPECT_THAT(message(none), HasSubstr("got 0 of 3 marker points"));
  // Four on a line do not tell how it turns.
  Footage line = footage(truth, 4, 5, {1e-6, 1e-6, 1e-6});
  for (std::size_t i = 0; i < 4; ++i) line.marker[i].point = Vec3(static_cast<double>(i), 0, 0);
  EXPECT_FALSE([&] { return followed(line, truth).turns; }());
}

TEST(FingerMarker, BadFilesAreOneLine) {
  const test::TemporaryFolder folder;
  const std::string file = folder / "marker.csv";
  const auto message = [&](const std::string& text) -> std::string {
    write_file(file, text);
    try {
      const std::vector<Landmark> marker = read_marker(file, 1);
      require_in_picture(marker, 640, 480, 13);
    } catch (const InputError& error) {
      return std::string(error.what()).substr(file.size());
    }
    return "nothing";
  };
  const std::string head = "name,x_px,y_px,x_mm,y_mm,z_mm\n";
  EXPECT_EQ(message(head + "a,100,100,0,0,6\nb,150,100,2,0,6\n"), "nothing");
  EXPECT_THAT(message("name,x_px,y_px,vertex\na,100,100,3\n"), HasSubstr(":2: got vertex 3, expected x_mm"));
  EXPECT_THAT(message(head + "a,100,100,0,0,6\na,150,100,2,0,6\n"), HasSubstr(":3: got name 'a'"));
  EXPECT_THAT(message(head + "a,100,nan,0,0,6\n"), HasSubstr(":2: got y_px 'nan'"));
  EXPECT_THAT(message(head + "a,100,100,0,inf,6\n"), HasSubstr(":2: got y_mm 'inf'"));
  EXPECT_THAT(message(head + "a,100,100,0,0,6\nb,630,100,2,0,6\n"),
              HasSubstr(":3: got 'b' at 630, 100, expected a pixel from 13, 13 to 626, 466"));
  EXPECT_THAT(message(head + "a,-5,100,0,0,6\n"), HasSubstr(":2: got 'a' at -5, 100"));
  EXPECT_THAT(message(head + "a,100,100,0,0,6\nb,100,100,2,0,6\n"), HasSubstr(":3: got 'b' at 100, 100"));
  EXPECT_THAT(message(head), HasSubstr("got no landmark"));
}

}  // namespace
}  // namespace rhytid::fitting
