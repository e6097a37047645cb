#include "fitting/track_import.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include "fitting/numbered_files.h"
#include "fitting/track_export.h"
#include "sim/core/error.h"
#include "tests/support/temporary_folder.h"

namespace rhytid::fitting {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class TrackImport : public ::testing::Test {
 protected:
  const test::TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  TrackImportOptions options_;
  TrackImportReport report_;
  TrackImport() { options_.frame_rate = 20; }

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  TrackSet import(const std::vector<std::string>& files) { return import_tracks(files, options_, &report_); }
  std::string refusal(const std::vector<std::string>& files) {
    try {
      import(files);
    } catch (const InputError& e) {
      return e.what();
    }
    return "accepted";
  }
};

const std::string kDice =
    "***\n*** Reference image: a.tif\n*** Deformed image: b.tif\n*** Incremental correlation: false\n***\n"
    "SUBSET_ID,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA,GAMMA,STATUS_FLAG\n";
const std::string kOpenCorr =
    "x,y,u,v,u0,v0,ZNCC,iteration,convergence,feature,exx,eyy,exy,subset_rx,subset_ry,\n";

// SIGMA is of a displacement: C_0 + C_f = SIGMA_f² in every frame, and C_0 is half of the least.
TEST_F(TrackImport, DiceSigmaIsSharedOutBetweenReferenceAndFrame) {
  const std::string f10 = write("DICe_solution_10.txt", kDice + "5,1.0E+01,20,0.5,-0.25,3.0E-02,1.0E-02,4\n");
  const std::string f9 = write("DICe_solution_9.txt", kDice + "5,1.0E+01,20,0.25,-0.125,2.0E-02,0,0\n");
  const TrackSet set = import({f10, f9});
  ASSERT_EQ(set.tracks.size(), 1u);
  const Track& track = set.tracks[0];
  EXPECT_EQ(track.id, 5);
  ASSERT_EQ(track.observations.size(), 3u);
  const Observation *first = track.at(0), *ninth = track.at(9), *tenth = track.at(10);
  ASSERT_TRUE(first != nullptr && ninth != nullptr && tenth != nullptr);
  EXPECT_EQ(first->pixel, Vec2(10, 20));
  EXPECT_EQ(tenth->pixel, Vec2(10.5, 19.75));
  EXPECT_DOUBLE_EQ(tenth->time_s, 0.5);
  EXPECT_NEAR(first->covariance(0, 0), 0.5 * 4e-4, 1e-15);
  EXPECT_NEAR((first->covariance + ninth->covariance)(0, 0), 4e-4, 1e-15);
  EXPECT_NEAR((first->covariance + tenth->covariance)(1, 1), 9e-4, 1e-15);
  EXPECT_NEAR(tenth->correlation, 1 - 0.005, 1e-15);
  EXPECT_EQ(report_.ok, 2);
  EXPECT_EQ(report_.last_frame, 10);
}

TEST_F(TrackImport, DicePointsThatFailedAreLostWithTheirReason) {
  const std::string rows =
      "0,1,1,0,0,0.02,0.01,0\n"
      "1,2,1,0,0,0.02,0.01,8\n"    // CORRELATION_FAILED
      "2,3,1,0,0,-1,0.01,0\n"      // no SIGMA
      "3,4,1,nan,0,0.02,0.01,0\n"  // no number
      "4,5,1,0,0,0.02,1.9,0\n"     // correlation 0.05
      "5,6,1,0,0,0.02,0.01,15\n"   // averaged from neighbours: not measured
      "6,7,1,-nan(ind),0,1.#QNAN,0.01,0\n";
  const std::string good =
      write("s_1.txt", kDice + "0,1,1,0,0,0.02,0.01,0\n1,2,1,0,0,0.02,0.01,3\n2,3,1,0,0,0.02,0,0\n");
  const TrackSet set = import({good, write("s_2.txt", kDice + rows)});
  ASSERT_EQ(set.tracks.size(), 3u);
  EXPECT_EQ(set.find("camera", 0)->at(2)->status, TrackStatus::ok);
  EXPECT_EQ(set.find("camera", 1)->at(1)->status, TrackStatus::ok);
  EXPECT_EQ(set.find("camera", 1)->at(2)->status, TrackStatus::lost);
  EXPECT_EQ(set.find("camera", 2)->at(2)->status, TrackStatus::lost);
  EXPECT_EQ(report_.never_seen, 4);
  EXPECT_EQ(report_.lost.at("STATUS_FLAG 8"), 1);
  EXPECT_EQ(report_.lost.at("STATUS_FLAG 15"), 1);
  EXPECT_EQ(report_.lost.at("SIGMA below 0"), 1);
  EXPECT_EQ(report_.lost.at("a number that is not finite"), 2);
  EXPECT_EQ(report_.lost.at("correlation below 0.6"), 1);
}

TEST_F(TrackImport, DiceRenewedSubsetsRenewTheTrack) {
  std::vector<std::string> files;
  for (int frame = 1; frame <= 4; ++frame)
    files.push_back(write("s_" + std::to_string(frame) + ".txt", kDice + "0,1,1,0.5,0,0.02,0.01," +
                                                                     (frame == 2   ? "26"
                                                                      : frame == 3 ? "8"
                                                                                   : "0") +
                                                                     "\n"));
  const TrackSet set = import(files);
  EXPECT_EQ(set.tracks[0].at(2)->status, TrackStatus::ok);
  EXPECT_FALSE(set.tracks[0].at(2)->renewed);
  EXPECT_EQ(set.tracks[0].at(3)->status, TrackStatus::lost);
  EXPECT_TRUE(set.tracks[0].at(4)->renewed);  // against the subset of frame 2
}

TEST_F(TrackImport, DiceNumbersFilesFromZeroOrOne) {
  const std::string rows = "0,1,1,0.5,0,0.02,0.01,0\n";
  std::string self = kDice;
  self.replace(self.find("b.tif"), 5, "a.tif");
  const std::string f0 = write("s_0.txt", kDice + rows), f1 = write("s_1.txt", kDice + rows);
  EXPECT_NE(import({f0, f1}).tracks[0].at(2), nullptr);  // two deformed pictures: frames 1 and 2
  write("s_0.txt", self + rows);
  TrackSet set = import({f0, f1});  // the reference with itself, and one deformed picture
  EXPECT_EQ(set.tracks[0].at(2), nullptr);
  EXPECT_NE(set.tracks[0].at(1), nullptr);
  options_.first_frame = 7;
  EXPECT_NE(import({f1}).tracks[0].at(7), nullptr);
  write("s_1.txt",
        kDice.substr(0, kDice.find("false")) + "true" + kDice.substr(kDice.find("false") + 5) + rows);
  EXPECT_THAT(refusal({f1}), HasSubstr("Incremental"));
}

// The file of the reference with itself is frame 0, whatever its number, and the others count from it.
TEST_F(TrackImport, DiceFilesCountFromTheReferenceWithItself) {
  const std::string rows = "0,1,1,0.5,0,0.02,0.01,0\n";
  std::string self = kDice;
  self.replace(self.find("b.tif"), 5, "a.tif");
  const std::string f5 = write("DICe_solution_05.txt", self + rows),
                    f6 = write("DICe_solution_06.txt", kDice + rows),
                    f7 = write("DICe_solution_07.txt", kDice + rows);
  const TrackSet set = import({f5, f6, f7});
  ASSERT_EQ(set.tracks[0].observations.size(), 3u);
  EXPECT_NE(set.tracks[0].at(1), nullptr);
  EXPECT_NE(set.tracks[0].at(2), nullptr);
  EXPECT_EQ(import({f6, f7}).tracks[0].observations.back().frame, 7);  // the reference is not among them
  EXPECT_THAT(refusal({write("DICe_solution_04.txt", kDice + rows), f5, f6}), HasSubstr("before that of"));
  EXPECT_THAT(refusal({f5, f6, write("DICe_solution_08.txt", self + rows)}), HasSubstr("a second file"));
  options_.first_frame = 3;
  EXPECT_THAT(refusal({f5, f6, f7}), HasSubstr("--first-frame: got 3, expected nothing: the file of the"));
  EXPECT_THAT(refusal({write("t.csv", "frame,track,x,y,sigma\n0,0,1,1,1\n")}), HasSubstr("--first-frame"));
  EXPECT_THAT(refusal({write("s_0.txt",
                             "FRAME,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA\n"
                             "1,319,278,0,0,0.07\n")}),
              HasSubstr("--first-frame"));
}

// What no correlation can be and no flag says is lost or refused, never taken.
TEST_F(TrackImport, ImpossibleCorrelationsAndFlags) {
  const std::string good = "0,1,1,0.5,0,0.02,0.01,0\n";
  const TrackSet set = import({write("s_1.txt", kDice + good +
                                                    "1,2,1,0,0,0.02,-1,0\n"  // no GAMMA
                                                    "2,3,1,0,0,0.02,0.01,nan\n"
                                                    "3,4,1,0,0,0.02,-inf,0\n"
                                                    "4,5,1,0,0,0.02,0.01,-1\n")});
  EXPECT_EQ(set.tracks.size(), 1u);
  EXPECT_EQ(report_.lost.at("GAMMA below 0"), 1);
  EXPECT_EQ(report_.lost.at("a number that is not finite"), 2);
  EXPECT_EQ(report_.lost.at("STATUS_FLAG -1"), 1);
  for (const char* flag : {"0.9", "1e300", "inf"})
    EXPECT_THAT(refusal({write("s_1.txt", kDice + good + "1,2,1,0,0,0.02,0.01," + flag + "\n")}),
                AllOf(HasSubstr("s_1.txt:8:"), HasSubstr("got STATUS_FLAG"), HasSubstr("a whole number")));
  options_.sigma = 0.02;
  const auto zncc = [](const char* text) {
    return std::string(",20,0,0,0,0,") + text + ",0,0,0,0,0,0,16,16,\n";
  };
  const TrackSet poi = import({write("poi_1.csv", kOpenCorr + "10" + zncc("0.9") + "20" + zncc("inf") + "30" +
                                                      zncc("1.01") + "40" + zncc("1.0000001"))});
  EXPECT_EQ(poi.tracks.size(), 2u);
  EXPECT_EQ(poi.tracks[1].at(1)->correlation, 1);
  EXPECT_EQ(report_.lost.at("correlation above 1"), 1);
  EXPECT_EQ(report_.lost.at("a number that is not finite"), 1);
}

// The other layout of DICe: one file a subset, one row a frame.
TEST_F(TrackImport, DiceFilesOfSubsets) {
  const std::string header =
      "***\nFRAME,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA,GAMMA\n";
  const std::string a =
      write("DICe_solution_0.txt", header + "1,319,278,0,0,0.07,0\n2,319,278,-0.5,0.25,0.07,0\n");
  const std::string b =
      write("DICe_solution_1.txt", header + "1,400,278,0,0,0.07,0\n2,400,278,1,0.25,0.07,0\n");
  const TrackSet set = import({a, b});
  ASSERT_EQ(set.tracks.size(), 2u);
  EXPECT_EQ(set.find("camera", 0)->at(2)->pixel, Vec2(318.5, 278.25));
  EXPECT_EQ(set.find("camera", 1)->at(2)->pixel, Vec2(401, 278.25));
  write("DICe_solution_1.txt", header + "1,400,278,0,0,0.07,0\n2,401,278,1,0.25,0.07,0\n");
  EXPECT_THAT(refusal({a, b}), HasSubstr("DICe_solution_1.txt:4:3: got COORDINATE_X '401', expected"));
}

TEST_F(TrackImport, OpenCorrTables) {
  const std::string f1 =
      write("poi_1_icgn.csv", kOpenCorr +
                                  "10,20,1.5,-0.5,1,-0.4,0.98,3,0.001,5,0.01,0.02,0.03,16,16,\n"
                                  "30,20,0,0,0,0,-1,0,0,0,0,0,0,16,16,\n");
  const std::string f2 = write("poi_2_icgn.csv", kOpenCorr +
                                                     "30,20,2,0,0,0,0.9,0,0,0,0,0,0,16,16,\n"
                                                     "10,20,2.5,-0.5,1,-0.4,0.5,3,0.001,5,0,0,0,16,16,\n");
  EXPECT_THAT(refusal({f1, f2}), AllOf(HasSubstr("--sigma"), HasSubstr("OpenCorr")));
  options_.sigma = 0.02;
  const TrackSet set = import({f2, f1});
  ASSERT_EQ(set.tracks.size(), 2u);
  const Track* first = set.find("camera", 0);  // as they come in the first frame
  EXPECT_EQ(first->at(0)->pixel, Vec2(10, 20));
  EXPECT_EQ(first->at(1)->pixel, Vec2(11.5, 19.5));
  EXPECT_EQ(first->at(2)->status, TrackStatus::lost);  // 0.5 < 0.6
  EXPECT_EQ(set.find("camera", 1)->at(1)->status, TrackStatus::lost);
  EXPECT_EQ(set.find("camera", 1)->at(2)->pixel, Vec2(32, 20));  // by its place, not by its row
  EXPECT_NEAR((first->at(0)->covariance + first->at(1)->covariance)(0, 0), 4e-4, 1e-15);
  EXPECT_NEAR(first->at(0)->covariance(0, 0), 2e-4, 1e-15);
  options_.min_correlation = 0.4;
  EXPECT_EQ(import({f2, f1}).find("camera", 0)->at(2)->status, TrackStatus::ok);
}

TEST_F(TrackImport, PlainTables) {
  const std::string path =
      write("t.csv", "# from a script\nframe;track;x;y;sigma\n0;4;10;20;0.1\n1;4;11;20;0.2\n2;4;;;\n");
  const TrackSet set = import({path});
  const Track* track = set.find("camera", 4);
  ASSERT_NE(track, nullptr);
  EXPECT_NEAR(track->at(0)->covariance(0, 0), 0.01, 1e-15);  // of the position, as the file says
  EXPECT_NEAR(track->at(1)->covariance(1, 1), 0.04, 1e-15);
  EXPECT_EQ(track->at(2)->status, TrackStatus::lost);
  options_.sigma = 0.4;  // of a displacement
  EXPECT_NEAR(import({path}).find("camera", 4)->at(1)->covariance(0, 0), 0.08, 1e-15);
}

TEST_F(TrackImport, WordsOfAPlainTableInAnyCase) {
  const std::string header = "frame\ttrack\tx\ty\tsigma\tcorr\tstatus\n";
  const TrackSet set = import({write("t.csv", header + "0\t4\t10\t20\t0.1\t\tOK\n"
                                                       "1\t4\t11\t20\t0.1\t0.9\tOk\n"
                                                       "2\t4\t11\t20\t0.1\t0.9\tOccluded\n"
                                                       "3\t4\t\t\t\t\tLOST\n"
                                                       "4\t4\t12\t20\t0.1\t0.9\t\n")});
  const Track& track = set.tracks.at(0);
  EXPECT_EQ(track.at(0)->status, TrackStatus::ok);
  EXPECT_EQ(track.at(0)->correlation, 0) << "it says none";
  EXPECT_EQ(track.at(1)->status, TrackStatus::ok);
  EXPECT_EQ(track.at(2)->status, TrackStatus::occluded);
  EXPECT_EQ(track.at(3)->status, TrackStatus::lost);
  EXPECT_EQ(track.at(4)->status, TrackStatus::ok);
  EXPECT_THAT(refusal({write("t.csv", header + "0\t4\t10\t20\t0.1\t1\tgood\n")}),
              HasSubstr("t.csv:2:17: got status 'good', expected ok, lost, occluded"));
}

TEST_F(TrackImport, NamesOfCamerasFitIntoTracksCsv) {
  const std::string path = write("t.csv", "frame,track,x,y,sigma\n0,0,1,1,1\n");
  for (const char* name : {"", "left,1", "left\n", "a\rb"}) {
    options_.camera = name;
    EXPECT_THAT(refusal({path}), HasSubstr("--camera: got '")) << name;
  }
  options_.camera = "left";
  EXPECT_EQ(import({path}).tracks[0].camera, "left");
  EXPECT_THAT(refusal({write("u.csv", "frame;track;x;y;sigma;camera\n0;0;1;1;1;a,b\n")}),
              HasSubstr("u.csv:2:11: got camera 'a,b', expected a camera's name without commas"));
}

// Of tab, semicolon and comma the first that the header has, in this order.
TEST_F(TrackImport, DelimiterIsTheFirstOfTheThree) {
  EXPECT_EQ(
      import({write("t.csv", "frame;track;x;y;sigma;where, roughly\n0;3;1;2;1;chin, left\n")}).tracks[0].id,
      3);
  EXPECT_EQ(import({write("u.csv", "frame\ttrack\tx\ty\tsigma\ta;b\n0\t5\t1\t2\t1\t0\n")}).tracks[0].id, 5);
}

TEST_F(TrackImport, SaysWhereAndWhatIsMissing) {
  const std::string bad = write("s_1.txt", kDice + "0,1,1,0.5,0,0.02,0.01,0\n1,2,1,0.5,zero,0.02,0.01,0\n");
  EXPECT_THAT(refusal({bad}), HasSubstr("s_1.txt:8:11: got DISPLACEMENT_Y 'zero', expected a number"));
  EXPECT_THAT(refusal({write("s_2.txt", kDice + "0,1,1,0.5,0,0.02\n")}),
              HasSubstr("s_2.txt:7:1: got 6 fields, expected 8"));
  EXPECT_THAT(refusal({write("s_3.txt", kDice + "0,1,1,0.5,0,0,0.01,0\n")}),
              HasSubstr("got SIGMA '0', expected a deviation above 0"));
  EXPECT_THAT(refusal({write("s_4.txt", kDice + "0,1,1,0,0,1,0,0\n0,1,1,0,0,1,0,0\n")}),
              HasSubstr("every point once"));
  const std::string no_sigma =
      write("s_5.txt", "COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y\n1,2,0,0\n");
  EXPECT_THAT(refusal({no_sigma}), AllOf(HasSubstr("--sigma"), HasSubstr("no column SIGMA")));
  EXPECT_THAT(refusal({write("t.csv", "frame,track,x,y\n0,0,1,1\n")}), HasSubstr("no column sigma"));
  EXPECT_THAT(refusal({write("u.csv", "a,b\n1,2\n")}), HasSubstr("expected tracks"));
  EXPECT_THAT(refusal({write("v.csv", "")}), HasSubstr("no line with names"));
  EXPECT_THAT(refusal({"missing.csv"}), HasSubstr("missing.csv"));
  options_.frame_rate = 0;
  EXPECT_THAT(refusal({write("s_6.txt", kDice + "0,1,1,0.5,0,0.02,0.01,0\n")}), HasSubstr("--rate"));
  EXPECT_THAT(refusal({write("w.csv", "frame,track,x,y,sigma\n0,0,1,1,1\n")}), HasSubstr("--rate"));
  EXPECT_THAT(refusal({write("x.csv", "frame,track,x,y,sigma,time_s\n0,0,1,1,1,0\n0,0,1,1,1,0\n")}),
              HasSubstr("twice"));
}

TEST_F(TrackImport, FilesAreOrderedByWhatTellsTheirNamesApart) {
  std::vector<std::string> notes;
  auto files = number_files({"a/oht_cfrp_10_r16.csv", "a/oht_cfrp_9_r16.csv"}, notes);
  EXPECT_EQ(files[0].number, 9);
  EXPECT_EQ(files[1].number, 10);
  files = number_files({"f_0110.csv", "f_0012.csv"}, notes);
  EXPECT_EQ(files[0].number, 12);
  EXPECT_EQ(number_files({"x/frame7.csv"}, notes)[0].number, 7);
  EXPECT_TRUE(notes.empty());
  files = number_files({"before.csv", "after.csv"}, notes);
  EXPECT_EQ(files[1].path, "after.csv");
  EXPECT_EQ(files[1].number, 2);
  EXPECT_EQ(notes.size(), 1u);
  EXPECT_THROW(number_files({"a_01.csv", "a_1.csv"}, notes), InputError);
}

// Out and in again, in every format: the same positions, and the same deviations as far as it holds them.
TEST_F(TrackImport, ExportedTracksReadBack) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(10, 500), step(-3, 3);
  TrackSet set;
  for (int id = 0; id < 30; ++id) {
    Track track{id, "camera", {}};
    for (int frame = 0; frame <= 12; ++frame) {
      Observation o;
      o.frame = frame;
      o.time_s = frame / 20.0;
      const bool is_lost = frame > 0 && (id + frame) % 7 == 0;
      o.status = is_lost ? TrackStatus::lost : TrackStatus::ok;
      if (frame == 0) o.pixel = {place(random), place(random)};
      if (frame > 0 && !is_lost) o.pixel = track.observations[0].pixel + Vec2(step(random), step(random));
      o.covariance = 4e-4 * Eigen::Matrix2d::Identity();
      o.correlation = is_lost ? 0 : 0.9;
      track.observations.push_back(o);
    }
    set.tracks.push_back(track);
  }
  for (const TrackFormat format :
       {TrackFormat::dice, TrackFormat::opencorr, TrackFormat::csv, TrackFormat::rhytid}) {
    SCOPED_TRACE(to_string(format));
    const TrackExportReport written = export_tracks(set, format, folder_.string());
    EXPECT_EQ(written.tracks, 30);
    EXPECT_EQ(written.without_reference, 0);
    options_.sigma = format == TrackFormat::opencorr ? std::optional<double>(std::sqrt(8e-4)) : std::nullopt;
    EXPECT_EQ(recognise_tracks(written.files.front()), format);
    const TrackSet back = import(written.files);
    ASSERT_EQ(back.tracks.size(), set.tracks.size());
    for (const Track& track : set.tracks)
      for (const Observation& o : track.observations) {
        const Observation* found = back.find("camera", track.id)->at(o.frame);
        ASSERT_NE(found, nullptr);
        EXPECT_EQ(found->status, o.status);
        EXPECT_DOUBLE_EQ(found->time_s, o.time_s);
        if (o.status != TrackStatus::ok) continue;
        EXPECT_LT((found->pixel - o.pixel).norm(), 1e-12);
        EXPECT_LT((found->covariance - o.covariance).norm(), 1e-15);
        const double expected = o.frame > 0 ? o.correlation : found->correlation;  // displacements have none
        EXPECT_NEAR(found->correlation, expected, 1e-12);
      }
  }
  // Tracks that know no correlation come back as they were, in every format.
  for (Track& track : set.tracks)
    for (Observation& o : track.observations) o.correlation = 0;
  for (const TrackFormat format : {TrackFormat::dice, TrackFormat::opencorr, TrackFormat::csv}) {
    SCOPED_TRACE(to_string(format));
    options_.sigma = format == TrackFormat::opencorr ? std::optional<double>(std::sqrt(8e-4)) : std::nullopt;
    const TrackSet back = import(export_tracks(set, format, folder_.string()).files);
    ASSERT_EQ(back.tracks.size(), set.tracks.size());
    for (const Track& track : set.tracks)
      for (const Observation& o : track.observations) {
        const Observation* found = back.find("camera", track.id)->at(o.frame);
        ASSERT_NE(found, nullptr);
        EXPECT_EQ(found->status, o.status);
        if (o.status == TrackStatus::ok) {
          EXPECT_LT((found->pixel - o.pixel).norm(), 1e-12);
        }
      }
  }
  options_.sigma.reset();
  // Of frames 3 to 15 the reference is the third: it is frame 0 of the tables, and they say so.
  for (Track& track : set.tracks)
    for (Observation& o : track.observations) o.frame += 3;
  const TrackExportReport late = export_tracks(set, TrackFormat::dice, folder_.string());
  EXPECT_EQ(late.reference_frame, 3);
  EXPECT_THAT(late.files.front(), HasSubstr("DICe_solution_0001.txt"));
  std::ifstream text(late.files.front());
  const std::string head((std::istreambuf_iterator<char>(text)), {});
  EXPECT_THAT(head, HasSubstr("Displacements since frame 3 of the tracks, here frame 0"));
  const TrackSet counted = import(late.files);
  EXPECT_EQ(counted.tracks[1].observations.size(), 13u);
  EXPECT_LT((counted.tracks[1].at(2)->pixel - set.tracks[1].at(5)->pixel).norm(), 1e-12);
  set.tracks[3].observations[0].status = TrackStatus::lost;
  EXPECT_EQ(export_tracks(set, TrackFormat::dice, folder_.string()).without_reference, 1);
  set.tracks[5].camera = "other";
  EXPECT_THROW(export_tracks(set, TrackFormat::dice, folder_.string()), InputError);
}

}  // namespace
}  // namespace rhytid::fitting
