// rhytid material: history files, refusals, and the files it writes.
#include <gmock/gmock.h>

#include <Eigen/LU>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "tests/support/small_scenes.h"
#include "tests/tools/program_call.h"
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

TEST(MaterialHistory, JsonListsAreTheSameAsCsv) {
  const MaterialProgram csv = parse_material_history("time_s,stretch1,stretch2\n0,1,1\n0.5,1.2,1\n", "h.csv");
  const MaterialProgram json =
      parse_material_history(R"({"stretch1": [1, 1.2], "time_s": [0, 0.5], "stretch2": [1, 1]})", "h.json");
  EXPECT_EQ(csv.times, json.times);
  EXPECT_EQ(csv.deformation, json.deformation);
  EXPECT_EQ(json.traction_free, (std::array<bool, 3>{false, false, true}));
  const auto error = [](const std::string& text) {
    try {
      (void)parse_material_history(text, "h.json");
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_THAT(error("[1"), HasSubstr("a JSON object of lists"));
  EXPECT_THAT(error(R"({"time_s": [0, 1], "stretch1": [1]})"), HasSubstr("2 numbers"));
  EXPECT_THAT(error(R"({"time_s": [0], "stretch1": ["1"]})"), HasSubstr("stretch1"));
  EXPECT_THAT(error(R"({"time_s": [0], "stretch1": [-1]})"), HasSubstr("row 0"));
  EXPECT_THAT(error(R"({"time_s": [0], "stretch5": [1]})"), HasSubstr("'stretch5'"));
  EXPECT_THAT(error(R"({"time_s": [], "stretch1": []})"), HasSubstr("at least one row"));
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

Outcome run(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "material");
  return call_program(arguments, make_verb_material());
}

TEST(MaterialVerb, RunsAndWritesTheClosedForm) {
  const std::string folder = testing::TempDir() + "material_verb";
  const Outcome o = run({"--uniaxial", "1.3", "--hold", "10 s", "--derivatives", "-o", folder});
  EXPECT_EQ(o.code, 0) << o.err;
  EXPECT_THAT(o.out, HasSubstr("P11 = 4.12257 kPa, stored energy "));
  EXPECT_THAT(o.out, HasSubstr("P11 = 0.899479 kPa"));
  const std::string csv = read_file(folder + "/material.csv");
  EXPECT_THAT(csv, HasSubstr("dP11_d_youngs_modulus,dP11_d_poissons_ratio_MPa"));
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 1 + 2 + 240);
  EXPECT_THAT(read_file(folder + "/material.svg"), HasSubstr("<svg"));
  std::filesystem::remove_all(folder);
}

/// Planar (pure shear) of an almost incompressible elastic layer: P11 = 2 μ e^(2 C l²) 2 l/λ · ½ with l = ln
/// λ, since Ē = diag(l, 0, −l), q = 2 l², and P33 = 0 fixes the pressure.
TEST(MaterialVerb, PlanarStretchIsTheClosedFormAndJsonHoldsTheColumns) {
  const std::string folder = testing::TempDir() + "material_planar";
  const Outcome o = run({"--planar", "1.3", "--youngs-modulus", "3 MPa", "--poissons-ratio", "0.499999",
                         "--relaxing-fraction", "0", "--derivatives", "-o", folder});
  ASSERT_EQ(o.code, 0) << o.err;
  const auto json = nlohmann::json::parse(read_file(folder + "/material.json"));
  ASSERT_TRUE(json.contains("time_s") && json.contains("P11_MPa") && json.contains("dP11_d_youngs_modulus"));
  const double l = std::log(1.3), mu = 3 / (2 * 1.499999), q = 2 * l * l;
  const double p11 = json["P11_MPa"].back(), f22 = json["F22"].back();
  EXPECT_NEAR(p11, 4 * mu * std::exp(q) * l / 1.3, 2e-5 * p11);
  EXPECT_EQ(f22, 1);
  EXPECT_NEAR(json["P33_MPa"].back().get<double>(), 0, 1e-9);
  EXPECT_GT(std::fabs(json["P22_MPa"].back().get<double>()), 0.1);  // held, not free
  // Stress is proportional to E at a given ν.
  EXPECT_NEAR(json["dP11_d_youngs_modulus"].back().get<double>(), p11 / 3, 1e-9 * p11);
  std::filesystem::remove_all(folder);
}

TEST(MaterialVerb, TakesTheLayerFromASceneAndFlagsOverIt) {
  const std::string folder = testing::TempDir() + "material_scene", scene = folder + ".json";
  write_file(scene, test::drag_scene(1, 1));
  const Outcome film = run({"--scene", scene, "--layer", "film", "--shear", "1", "-o", folder});
  EXPECT_THAT(film.out, HasSubstr("P12 = 322.896 kPa")) << film.err;  // 50 × 6457.91 Pa
  const Outcome changed =
      run({"--scene", scene, "--layer", "film", "--shear", "1", "--youngs-modulus", "20 kPa", "-o", folder});
  EXPECT_THAT(changed.out, HasSubstr("P12 = 6.45791 kPa")) << changed.err;
  const Outcome wrong = run({"--scene", scene, "--layer", "fat", "--shear", "1", "-o", folder});
  EXPECT_EQ(wrong.code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("one of soft, film"));
  std::filesystem::remove_all(folder);
  std::filesystem::remove(scene);
}

TEST(MaterialVerb, PlainNumbersAreInInternalUnitsAsInScenes) {
  const std::string folder = testing::TempDir() + "material_plain";
  const Outcome plain = run({"--shear", "0.2", "--youngs-modulus", "0.05", "--relaxation-time", "0.1",
                             "--rate", "2", "-o", folder});
  const Outcome units = run({"--shear", "0.2", "--youngs-modulus", "50 kPa", "--relaxation-time", "100 ms",
                             "--rate", "2 Hz", "-o", folder});
  EXPECT_EQ(plain.code, 0) << plain.err;
  EXPECT_EQ(plain.out, units.out);
  EXPECT_THAT(plain.out, HasSubstr("F12 = 0.2, "));
  EXPECT_THAT(run({"--help"}).out, HasSubstr("(default "));
  std::filesystem::remove_all(folder);
}

TEST(MaterialVerb, RefusesBadFlags) {
  for (const std::vector<std::string>& bad :
       std::vector<std::vector<std::string>>{{},
                                             {"--uniaxial", "1.2", "--shear", "1"},
                                             {"--uniaxial", "0"},
                                             {"--uniaxial", "-1"},
                                             {"--planar", "0"},
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
