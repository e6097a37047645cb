#include "fitting/observations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "sim/core/error.h"
#include "tests/support/temporary_folder.h"

namespace rhytid::fitting {
namespace {

using ::testing::HasSubstr;

constexpr char kHeader[] = "frame,time_s,track_id,camera,x_px,y_px,sxx_px2,sxy_px2,syy_px2,corr,status\n";

class TracksFile : public ::testing::Test {
 protected:
  std::string write(const std::string& text) const {
    std::ofstream(path_, std::ios::binary) << text;
    return path_;
  }
  /// what() without the folder, or "accepted".
  std::string refusal(const std::string& rows) const {
    try {
      read_tracks(write(kHeader + rows));
    } catch (const InputError& e) {
      const std::string text = e.what();
      EXPECT_THAT(text, HasSubstr(path_));
      return text.substr(text.find(path_) + path_.size());
    }
    return "accepted";
  }
  const test::TemporaryFolder folder_;
  const std::string path_ = folder_ / "tracks.csv";
};

TEST_F(TracksFile, ReadsBackTheSameBits) {
  TrackSet set;
  for (int id = 0; id < 3; ++id) {
    Track track{id, "left", {}};
    for (int frame = 0; frame < 4; ++frame) {
      Observation o{frame, frame / 3.0, TrackStatus::ok, {100.0 / 3 + id, 1e-17 + frame / 7.0},
                    {},    0.1 + 0.2};
      o.covariance << 1e-3 / 3, -1e-5 / 7, -1e-5 / 7, 2e-3 / 9;
      if (id == 1 && frame >= 2)
        o = {frame, frame / 3.0, frame == 2 ? TrackStatus::occluded : TrackStatus::lost};
      track.observations.push_back(o);
    }
    set.tracks.push_back(track);
  }
  write_tracks(set, path_);
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::path(path_).parent_path()))
    EXPECT_EQ(entry.path().filename().string().find("tmp-" + std::to_string(getpid())), std::string::npos);
  const TrackSet back = read_tracks(path_);
  ASSERT_EQ(back.tracks.size(), 3u);
  for (int id = 0; id < 3; ++id) {
    const Track* track = back.find("left", id);
    ASSERT_NE(track, nullptr);
    ASSERT_EQ(track->observations.size(), 4u);
    for (int frame = 0; frame < 4; ++frame) {
      const Observation &a = set.tracks[id].observations[frame], &b = *track->at(frame);
      EXPECT_EQ(a.status, b.status);
      EXPECT_EQ(a.time_s, b.time_s);
      if (a.status != TrackStatus::ok) continue;
      EXPECT_EQ(a.pixel, b.pixel);
      EXPECT_EQ(a.covariance, b.covariance);
      EXPECT_EQ(a.correlation, b.correlation);
    }
  }
  EXPECT_EQ(back.find("right", 0), nullptr);
  EXPECT_EQ(back.tracks[0].at(9), nullptr);
}

TEST_F(TracksFile, OrderOfRowsAndLineEndsDoNotMatter) {
  const std::string a = "0,0,0,c,1,2,1,0,1,1,ok", b = "1,0.5,0,c,,,,,,,lost", c = "0,0,1,c,3,4,1,0,1,1,ok";
  const TrackSet one = read_tracks(write(kHeader + a + "\n" + b + "\n" + c + "\n"));
  std::string header = kHeader;
  header.insert(header.size() - 1, "\r");
  const TrackSet two = read_tracks(write(header + c + "\r\n" + b + "\r\n" + a));
  ASSERT_EQ(one.tracks.size(), 2u);
  ASSERT_EQ(two.tracks.size(), 2u);
  EXPECT_EQ(two.tracks[0].id, 0);
  EXPECT_EQ(two.tracks[0].observations[1].status, TrackStatus::lost);
  EXPECT_EQ(two.tracks[1].observations[0].pixel, one.tracks[1].observations[0].pixel);
}

TEST_F(TracksFile, NamesLineColumnAndExpectation) {
  EXPECT_EQ(refusal("0,0,0,c,1,2,1,0,1,1,ok\n"), "accepted");
  EXPECT_THAT(refusal("0,0,0,c,nan,2,1,0,1,1,ok\n"),
              HasSubstr(":2:9: got x_px 'nan', expected a finite number"));
  EXPECT_THAT(refusal("0,0,0,c,1,2,1,0,1,1,ok\n1,inf,0,c,1,2,1,0,1,1,ok\n"),
              HasSubstr(":3:3: got time_s 'inf'"));
  EXPECT_THAT(refusal("0,0,0,c,1,2x,1,0,1,1,ok\n"), HasSubstr(":2:11: got y_px '2x'"));
  EXPECT_THAT(refusal("0,0,0,c,,2,1,0,1,1,ok\n"), HasSubstr("x_px ''"));
  EXPECT_THAT(refusal("-1,0,0,c,1,2,1,0,1,1,ok\n"), HasSubstr("a whole number"));
  EXPECT_THAT(refusal("0.5,0,0,c,1,2,1,0,1,1,ok\n"), HasSubstr("a whole number"));
  EXPECT_THAT(refusal("0,0,99999999999,c,1,2,1,0,1,1,ok\n"), HasSubstr("track_id '99999999999'"));
  EXPECT_THAT(refusal("0,0,0,,1,2,1,0,1,1,ok\n"), HasSubstr("a camera name"));
  EXPECT_THAT(refusal("0,0,0,c,1,2,0,0,1,1,ok\n"), HasSubstr("sxx_px2 '0', expected a positive variance"));
  EXPECT_THAT(refusal("0,0,0,c,1,2,1,0,-1,1,ok\n"), HasSubstr("syy_px2 '-1'"));
  EXPECT_THAT(refusal("0,0,0,c,1,2,1,1.01,1,1,ok\n"), HasSubstr("sxy_px2 '1.01'"));
  EXPECT_THAT(refusal("0,0,0,c,1,2,1,0,1,1.5,ok\n"), HasSubstr("corr '1.5'"));
  EXPECT_THAT(refusal("0,0,0,c,1,2,1,0,1,1,fine\n"),
              HasSubstr("status 'fine', expected ok, renewed, occluded, lost or outside"));
  EXPECT_THAT(refusal("0,0,0,c,1,,,,,,lost\n"), HasSubstr("an empty field"));
  EXPECT_THAT(refusal("0,0,0,c,1,2,1,0,1,ok\n"), HasSubstr("10 fields, expected 11 fields"));
  EXPECT_THAT(refusal("0,0,0,c,1,2,1,0,1,1,ok\n0,0,0,c,1,2,1,0,1,1,ok\n"), HasSubstr("already on line 2"));
  EXPECT_THROW(read_tracks(write("frame,x\n")), InputError);
  EXPECT_THROW(read_tracks(write("")), InputError);
  EXPECT_THROW(read_tracks("no_such_tracks.csv"), InputError);
}

TEST_F(TracksFile, RefusesToWriteWhatItWouldNotRead) {
  TrackSet set;
  set.tracks.push_back({0, "c", {{0, 0, TrackStatus::ok, {0, std::numeric_limits<double>::quiet_NaN()}}}});
  EXPECT_THROW(write_tracks(set, path_), ContractError);
  EXPECT_FALSE(std::filesystem::exists(path_));
  EXPECT_THROW(write_tracks({}, "/no_such_folder/tracks.csv"), InputError);
}

}  // namespace
}  // namespace rhytid::fitting
