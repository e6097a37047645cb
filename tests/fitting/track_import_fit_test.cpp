// What comes of tracks that went through the tables of another program: the same answer.
#include <gtest/gtest.h>

#include <cstdio>

#include "fitting/fit.h"
#include "fitting/track_export.h"
#include "tests/fitting/synthetic_tracks.h"
#include "tests/support/temporary_folder.h"

namespace rhytid::fitting {
namespace {

TEST(ImportedTracks, AFitFindsTheSameNumbers) {
  const Scene scene = test::drag_scene(3);
  const Camera camera = test::make_camera();
  FitCase fit;
  fit.discretisation_check = false;
  fit.consider.emplace();
  fit.min_sigma = 0.005;
  fit.parameters = {test::fitted("/skin/layers/film/youngs_modulus", 0.7)};
  FitInput input{scene, camera, test::make_tracks(scene, camera, 2, 0.02, 1), fit, {}};
  for (Track& track : input.tracks.tracks)  // as a tracker would say; DICe's tables would do without
    for (Observation& o : track.observations) o.correlation = 0.95;
  const FitResult own = run_fit(input);
  ASSERT_TRUE(own.converged);

  const rhytid::test::TemporaryFolder folder;
  for (const TrackFormat format : {TrackFormat::dice, TrackFormat::opencorr}) {
    TrackImportOptions options;
    options.frame_rate = 24;
    options.camera = camera.name;
    if (format == TrackFormat::opencorr) options.sigma = 0.02 * std::sqrt(2.0);  // of a displacement
    TrackImportReport report;
    input.tracks = import_tracks(export_tracks(input.tracks, format, folder.path()).files, options, &report);
    const FitResult imported = run_fit(input);
    ASSERT_TRUE(imported.converged);
    const FittedParameter &a = own.parameters.at(0), &b = imported.parameters.at(0);
    std::printf("%s: %.10g, %.10g; %.6g .. %.6g, %.6g .. %.6g\n", to_string(format), a.value, b.value,
                a.low95, b.low95, a.high95, b.high95);
    EXPECT_NEAR(b.value, a.value, 1e-7 * a.value);
    EXPECT_NEAR(b.low95, a.low95, 1e-6 * a.low95);
    EXPECT_NEAR(b.high95, a.high95, 1e-6 * a.high95);
    EXPECT_NEAR(imported.final_cost, own.final_cost, 1e-7 * own.final_cost);
  }
}

}  // namespace
}  // namespace rhytid::fitting
