// rhytid material: history files, refusals, and the files it writes.
#include <gmock/gmock.h>

#include <Eigen/LU>
#include <filesystem>
#include <sstream>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tests/support/small_scenes.h"
#include "tools/material/history.h"
#include "tools/verb.h"

namespace rhytid::tools {

std::unique_ptr<Verb> make_verb_material();

namespace {

using testing::HasSubstr;

std::string error_of(const std::string& text) {
  try {
    (void)parse_material_history(text, "h.csv");
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(MaterialHistory, ReadsStretchesAndDeformationGradients) {
  const MaterialProgram a =
      parse_material_history("# measured\ntime_s, stretch1\n0, 1\n\n0.5, 1.21\r\n", "h.csv");
  ASSERT_EQ(a.times.size(), 2u);
  EXPECT_EQ(a.traction_free, (std::array<bool, 3>{false, true, true}));
  EXPECT_EQ(a.deformation[1](0, 0), 1.21);
  EXPECT_NEAR(a.deformation[1].determinant(), 1, 1e-14);
  const MaterialProgram b =
      parse_material_history("F11,F12,F13,F21,F22,F23,F31,F32,F33,time\n1,.5,0,0,1,0,0,0,1,2\n", "h.csv");
  EXPECT_EQ(b.deformation[0](0, 1), 0.5);
  EXPECT_EQ(b.traction_free, (std::array<bool, 3>{}));
}

TEST(MaterialHistory, RefusesWithLineAndValue) {
  EXPECT_THAT(error_of(""), HasSubstr("no rows"));
  EXPECT_THAT(error_of("time_s\n0\n"), HasSubstr("h.csv:1"));
  EXPECT_THAT(error_of("time_s,stretch4\n"), HasSubstr("'stretch4'"));
  EXPECT_THAT(error_of("time_s,F11\n0,1\n"), HasSubstr("all nine"));
  EXPECT_THAT(error_of("time_s,stretch1,stretch1\n"), HasSubstr("twice"));
  EXPECT_THAT(error_of("stretch1\n1\n"), HasSubstr("time_s"));
  EXPECT_THAT(error_of("time_s,stretch1\n0,1\n0.1\n"), HasSubstr("h.csv:3"));
  EXPECT_THAT(error_of("time_s,stretch1\n0,one\n"), HasSubstr("'one'"));
  EXPECT_THAT(error_of("time_s,stretch1\n0,nan\n"), HasSubstr("finite"));
  EXPECT_THAT(error_of("time_s,stretch1\n0,-1\n"), HasSubstr("stretch > 0"));
  EXPECT_THAT(error_of("time_s,stretch1\n1,1\n0,1\n"), HasSubstr("fall"));
  EXPECT_THAT(error_of("time_s,F11,F12,F13,F21,F22,F23,F31,F32,F33\n0,-1,0,0,0,1,0,0,0,1\n"),
              HasSubstr("det F"));
}

struct Outcome {
  int code;
  std::string out, err;
};
Outcome run(std::vector<std::string> arguments) {
  Program program;
  program.name = "rhytid";
  program.verbs.push_back(make_verb_material());
  arguments.insert(arguments.begin(), {"rhytid", "material"});
  std::vector<const char*> argv;
  for (const std::string& a : arguments) argv.push_back(a.c_str());
  std::ostringstream out, err;
  const int code = run_program(program, static_cast<int>(argv.size()), argv.data(), out, err);
  return {code, out.str(), err.str()};
}

TEST(MaterialVerb, RunsAndWritesTheClosedForm) {
  const std::string folder = testing::TempDir() + "material_verb";
  const Outcome o = run({"--uniaxial", "1.3", "--hold", "10 s", "--derivatives", "-o", folder});
  EXPECT_EQ(o.code, 0) << o.err;
  EXPECT_THAT(o.out, HasSubstr("P11 = 4122.57 Pa"));
  EXPECT_THAT(o.out, HasSubstr("P11 = 899.479 Pa"));
  const std::string csv = read_file(folder + "/material.csv");
  EXPECT_THAT(csv, HasSubstr("dP11_d_youngs_modulus,dP11_d_poissons_ratio_MPa"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + 2 + 240);
  EXPECT_THAT(read_file(folder + "/material.svg"), HasSubstr("<svg"));
  std::filesystem::remove_all(folder);
}

TEST(MaterialVerb, TakesTheLayerFromASceneAndFlagsOverIt) {
  const std::string folder = testing::TempDir() + "material_scene", scene = folder + ".json";
  write_file(scene, test::drag_scene(1, 1));
  const Outcome film = run({"--scene", scene, "--layer", "film", "--shear", "1", "-o", folder});
  EXPECT_THAT(film.out, HasSubstr("P12 = 322896 Pa")) << film.err;  // 50 × 6457.91 Pa
  const Outcome changed =
      run({"--scene", scene, "--layer", "film", "--shear", "1", "--youngs-modulus", "20 kPa", "-o", folder});
  EXPECT_THAT(changed.out, HasSubstr("P12 = 6457.91 Pa")) << changed.err;
  const Outcome wrong = run({"--scene", scene, "--layer", "fat", "--shear", "1", "-o", folder});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("one of soft, film"));
  std::filesystem::remove_all(folder);
  std::filesystem::remove(scene);
}

TEST(MaterialVerb, RefusesBadFlags) {
  for (const std::vector<std::string>& bad :
       std::vector<std::vector<std::string>>{{},
                                             {"--uniaxial", "1.2", "--shear", "1"},
                                             {"--uniaxial", "0"},
                                             {"--uniaxial", "-1"},
                                             {"--shear", "1", "--rate", "0 Hz"},
                                             {"--shear", "1", "--hold", "3 mm"},
                                             {"--shear", "1", "--poissons-ratio", "0.5"},
                                             {"--shear", "1", "--damper", "x"},
                                             {"--shear", "1", "--layer", "film"},
                                             {"--shear", "1", "--hold", "1 s", "--step", "0 s"}}) {
    const Outcome o = run(bad);
    EXPECT_EQ(o.code, 2);
    EXPECT_EQ(std::count(o.err.begin(), o.err.end(), '\n'), 1) << o.err;
  }
}

}  // namespace
}  // namespace rhytid::tools
