#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <bit>
#include <charconv>
#include <clocale>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>

#include "sim/core/error.h"
#include "sim/output/atomic_file.h"
#include "sim/output/csv.h"
#include "sim/output/text.h"
#include "tests/support/temporary_folder.h"

namespace rhytid {
namespace {

using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(AtomicFile, AppearsOnlyOnCommit) {
  const TemporaryFolder folder;
  const std::string path = folder / "a.txt";
  write_file(path, "old");
  {
    AtomicFile file(path);
    file.write("new ");
    file.write("content");
    EXPECT_EQ(read_file(path), "old");
    file.commit();
  }
  EXPECT_EQ(read_file(path), "new content");
  EXPECT_EQ(folder.num_files(), 1u);
  // Ordinary permissions, not those of a private temporary file.
  const auto permissions = std::filesystem::status(path).permissions();
  EXPECT_NE(permissions & std::filesystem::perms::group_read, std::filesystem::perms::none);
}

TEST(AtomicFile, LeavesNothingWithoutCommit) {
  const TemporaryFolder folder;
  {
    AtomicFile file(folder / "a.txt");
    file.write("half");
    EXPECT_EQ(folder.num_files(), 1u);
    EXPECT_FALSE(std::filesystem::exists(folder / "a.txt"));
  }
  EXPECT_EQ(folder.num_files(), 0u);
}

/// A process id that no process has: that of a child which has ended and is waited for.
pid_t dead_process() {
  const pid_t child = fork();
  if (child == 0) _exit(0);
  waitpid(child, nullptr, 0);
  return child;
}

TEST(AtomicFile, RemovesWhatAKilledWriterLeft) {
  const TemporaryFolder folder;
  const auto leave = [&](const std::string& name) {
    std::ofstream(folder / name) << "left";
    return folder / name;
  };
  const auto exists = [](const std::string& path) { return std::filesystem::exists(path); };
  const std::string dead = std::to_string(dead_process()), own = std::to_string(getpid());
  const std::string stale = leave("a.txt.tmp-" + dead + "-0"), more = leave("a.txt.tmp-" + dead + "-12");
  const std::string film = leave("film.tmp-" + dead + "-3.avi");
  const std::vector<std::string> others = {leave("a.txt.tmp-" + own + "-999"),
                                           leave("b.txt.tmp-" + dead + "-0"),
                                           leave("a.txt.tmp-" + dead),
                                           leave("a.txt.tmp-" + dead + "-0x"),
                                           leave("a.txt.tmp-x-0"),
                                           leave("a.txt.tmp--1-0"),
                                           leave("my a.txt.tmp-" + dead + "-0"),
                                           leave("film.tmp-" + dead + "-3.mp4")};
  std::filesystem::create_symlink(others[0], folder / ("a.txt.tmp-" + dead + "-5"));
  std::filesystem::create_directory(folder / ("a.txt.tmp-" + dead + "-6"));

  write_file(folder / "a.txt", "new");
  EXPECT_FALSE(exists(stale) || exists(more));
  EXPECT_TRUE(exists(film));
  {
    const AtomicPath path(folder / "film.avi");
    EXPECT_FALSE(exists(film));
  }
  for (const std::string& other : others) EXPECT_TRUE(exists(other)) << other;
  EXPECT_TRUE(std::filesystem::is_symlink(folder / ("a.txt.tmp-" + dead + "-5")));
  EXPECT_TRUE(exists(folder / ("a.txt.tmp-" + dead + "-6")));
  EXPECT_EQ(read_file(folder / "a.txt"), "new");
}

TEST(AtomicPath, KeepsTheExtensionAndAppearsOnCommit) {
  const TemporaryFolder folder;
  const std::string target = folder / "film.x/a.b.avi";
  std::filesystem::create_directory(folder / "film.x");
  std::string one, two;
  {
    AtomicPath first(target), second(target);
    one = first.path(), two = second.path();
    EXPECT_NE(one, two);
    EXPECT_EQ(std::filesystem::path(one).extension(), ".avi");
    EXPECT_EQ(std::filesystem::path(one).parent_path(), std::filesystem::path(target).parent_path());
    std::ofstream(one) << "one";
    std::ofstream(two) << "two";
    EXPECT_FALSE(std::filesystem::exists(target));
    first.commit();
    EXPECT_EQ(read_file(target), "one");
  }
  EXPECT_FALSE(std::filesystem::exists(one) || std::filesystem::exists(two));
  EXPECT_EQ(read_file(target), "one") << "what was not committed is dropped";
  AtomicPath nothing(target), empty(target);
  EXPECT_THROW(nothing.commit(), InputError);
  { const std::ofstream touched(empty.path()); }
  EXPECT_THROW(empty.commit(), InputError);
  EXPECT_THROW(AtomicPath(folder / "film.x"), InputError);
  EXPECT_EQ(std::filesystem::path(AtomicPath(folder / "film.x/plain").path())
                .extension()
                .string()
                .rfind(".tmp-", 0),
            0u);
}

TEST(AtomicFile, NamesThePathOnFailure) {
  const TemporaryFolder folder;
  const std::string missing = folder / "no/such/folder/x.csv";
  try {
    write_file(missing, "x");
    FAIL() << "no exception";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(missing));
    EXPECT_THAT(error.what(), HasSubstr("No such file"));
  }
  std::filesystem::create_directory(folder / "d");
  EXPECT_THROW(write_file(folder / "d", "x"), InputError);
  EXPECT_THROW(read_file(folder / "absent"), InputError);
  EXPECT_EQ(folder.num_files(), 1u);
}

/// Exits with 7 when writing more than the limit throws InputError.
[[noreturn]] void write_with_a_size_limit(const std::string& path) {
  std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{1000, 1000};
  setrlimit(RLIMIT_FSIZE, &limit);
  try {
    write_file(path, std::string(100000, 'x'));
  } catch (const InputError&) {
    std::exit(7);
  }
  std::exit(0);
}

TEST(AtomicFile, KeepsTheOldFileWhenTheDiskIsFull) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  // A full disk is imitated by a file size limit in a child process.
  const TemporaryFolder folder;
  const std::string path = folder / "a.txt";
  write_file(path, "old");
  EXPECT_EXIT(write_with_a_size_limit(path), ::testing::ExitedWithCode(7), "");

  EXPECT_EQ(read_file(path), "old");
  EXPECT_EQ(folder.num_files(), 1u);
}

TEST(Text, DoublesRoundTripExactly) {
  std::mt19937_64 random(7);
  for (int i = 0; i < 20000; ++i) {
    const double value = std::bit_cast<double>(random());
    if (std::isnan(value)) continue;
    const std::string text = exact_text(value);
    EXPECT_EQ(std::bit_cast<std::uint64_t>(std::strtod(text.c_str(), nullptr)),
              std::bit_cast<std::uint64_t>(value));
  }
  EXPECT_EQ(exact_text(0.1), "0.1");
  EXPECT_EQ(exact_text(-std::numeric_limits<double>::infinity()), "-inf");
  EXPECT_EQ(exact_text(std::nan("")), "nan");
}

TEST(Text, TicksAreRoundAndInside) {
  EXPECT_THAT(round_ticks(0, 10, 5), ElementsAre(0, 2, 4, 6, 8, 10));
  const auto ticks = round_ticks(-0.013, 0.027, 4);
  EXPECT_NEAR(ticks.front(), -0.01, 1e-15);
  EXPECT_NEAR(ticks.back(), 0.02, 1e-15);
  for (const double span : {1e-7, 3.3, 7e11}) {
    const auto many = round_ticks(0.37 * span, 1.37 * span, 6);
    EXPECT_GE(many.size(), 4u) << span;
    EXPECT_LE(many.size(), 11u) << span;
    for (const double tick : many)
      EXPECT_TRUE(tick >= 0.37 * span * (1 - 1e-9) && tick <= 1.37 * span * (1 + 1e-9));
  }
  EXPECT_THAT(round_ticks(1.5 - 3e-16, 1.5, 5), ElementsAre(testing::DoubleEq(1.5)));
  EXPECT_THROW(round_ticks(1, 1, 5), ContractError);
}

TEST(Text, TickLabels) {
  EXPECT_EQ(tick_text(0.30000000000000004, 0.1), "0.3");
  EXPECT_EQ(tick_text(-1e-17, 0.5), "0");
  EXPECT_EQ(tick_text(1500, 500), "1500");
  EXPECT_EQ(tick_text(2e6, 1e6), "2e6");
  EXPECT_EQ(tick_text(2.5e-5, 5e-6), "2.5e-5");
  EXPECT_EQ(fixed_text(-0.0001, 2), "0.00");
  EXPECT_EQ(short_text(1234.5678), "1235");
}

TEST(Text, Base64MatchesRfc4648) {
  const std::vector<std::pair<std::string, std::string>> vectors = {{"", ""},
                                                                    {"f", "Zg=="},
                                                                    {"fo", "Zm8="},
                                                                    {"foo", "Zm9v"},
                                                                    {"foob", "Zm9vYg=="},
                                                                    {"fooba", "Zm9vYmE="},
                                                                    {"foobar", "Zm9vYmFy"}};
  for (const auto& [plain, coded] : vectors) EXPECT_EQ(base64(plain), coded);
  EXPECT_EQ(base64("\xff\xfe\xfd"), "//79");
}

TEST(Csv, HeaderHasUnitsAndCellsAreQuoted) {
  CsvTable table({{"time", "s"}, {"name", ""}, {"count", ""}});
  table.add_row({0.1, std::string("a,\"b\""), std::int64_t{3}});
  EXPECT_EQ(table.text(), "time_s,name,count\n0.1,\"a,\"\"b\"\"\",3\n");
  EXPECT_THROW(table.add_row({0.1}), ContractError);
  EXPECT_EQ(table.num_rows(), 1u);
}

TEST(Csv, NumbersRoundTripInAForeignLocale) {
  const TemporaryFolder folder;
  // German writes 0,5; the file must not. Where that locale is missing the test still checks the round trip.
  std::setlocale(LC_ALL, "de_DE.UTF-8");
  CsvTable table({{"force", "N"}, {"gap", "mm"}});
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<double> values;
  for (int i = 0; i < 200; ++i) {
    values.insert(values.end(), {normal(random) * std::pow(10, 40 * normal(random)), normal(random)});
    table.add_numbers({values[values.size() - 2], values.back()});
  }
  table.write(folder / "t.csv");
  std::setlocale(LC_ALL, "C");
  const std::string text = read_file(folder / "t.csv");
  const char* at = text.c_str() + text.find('\n') + 1;
  for (const double value : values) {
    double parsed = 0;
    const auto result = std::from_chars(at, text.c_str() + text.size(), parsed);
    ASSERT_EQ(result.ec, std::errc{});
    EXPECT_EQ(parsed, value);
    at = result.ptr + 1;
  }
  EXPECT_EQ(at, text.c_str() + text.size());
}

}  // namespace
}  // namespace rhytid
