// `monoperfcap bench` as a user meets it: a suite of one tiny clip, what is done again and what not, bad
// input, Ctrl-C.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/temp_dir.h"
#include "mpc/io/atomic_file.h"
#include "run_command.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;
using testing::ExpectOneSentence;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Outcome;
using testing::Process;
using testing::RunCommand;
using testing::TempDir;
using Json = nlohmann::ordered_json;

Json Suite(const Json& clip_changes = Json::object()) {
  Json clip = {{"name", "tiny"},     {"motion", "wave"}, {"outfit", "tight"},
               {"camera", "static"}, {"seed", 5},        {"seconds", 0.24},
               {"fps", 25},          {"width", 96},      {"height", 96}};
  clip.update(clip_changes);
  return {{"format", "mpc-suite"}, {"version", 1}, {"clips", {clip}}};
}

class BenchCommandTest : public ::testing::Test {
 protected:
  std::string Write(const std::string& name, const Json& json) const {
    return folder_.Write(name, json.dump()).string();
  }
  Outcome Bench(const std::string& suite, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"bench", "--no-real", "--quiet",        "--suite",
                                          suite,   "-o",        output().string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return RunCommand(arguments);
  }
  Json Result() const { return Json::parse(ReadFile(output() / "results.json")); }
  fs::path output() const { return folder_ / "bench"; }

  TempDir folder_;
};

TEST_F(BenchCommandTest, MeasuresEveryStageOnceAndComparesWithBefore) {
  const std::string suite = Write("suite.json", Suite());
  const Outcome first = Bench(suite);
  ASSERT_EQ(first.exit_code, 0) << first.err;
  for (const char* row :
       {"| network's 3D, rigged |", "| surface refinement on the network's 3D |",
        "| E2d + E3d per frame |", "| E_pose |", "| refined pose |", "| refined surface |",
        "| tiny (6 frames, 25 fps) |", "Steps at which a clip gets worse"}) {
    EXPECT_THAT(first.out, HasSubstr(row));
  }
  EXPECT_EQ(ReadFile(output() / "results.md"), first.out.substr(first.out.find("Synthetic")));
  const Json stages = Result()["clips"][0]["stages"];
  ASSERT_EQ(stages.size(), 6u);
  for (const auto& [key, row] : stages.items()) {
    for (const char* column : {"mpjpe", "vertex_error", "iou", "seconds"}) {
      EXPECT_TRUE(row[column].is_number()) << key << " " << column;
    }
  }
  // A pose is refined before its surface, which adds to the time.
  EXPECT_EQ(stages["refined_pose"]["mpjpe"], stages["refined_surface"]["mpjpe"]);
  EXPECT_LT(stages["refined_pose"]["seconds"], stages["refined_surface"]["seconds"]);

  // Nothing is done again, so even the times stay; a broken result is.
  const std::string before = ReadFile(output() / "results.json");
  const auto clip_time = fs::last_write_time(output() / "tiny" / "clip" / "truth.json");
  EXPECT_EQ(Bench(suite).exit_code, 0);
  EXPECT_EQ(ReadFile(output() / "results.json"), before);
  Json broken = Json::parse(ReadFile(output() / "tiny" / "result.json"));
  broken["stages"] = 3;
  WriteFileAtomically(output() / "tiny" / "result.json", broken.dump());
  EXPECT_EQ(Bench(suite).exit_code, 0);
  EXPECT_EQ(Result()["clips"][0]["stages"].size(), 6u);
  EXPECT_EQ(fs::last_write_time(output() / "tiny" / "clip" / "truth.json"), clip_time);

  // Better expected than found.
  Json expected = Json::parse(before);
  Json& row = expected["clips"][0]["stages"]["pose"];
  EXPECT_EQ(Bench(suite, {"--expect", Write("same.json", expected)}).exit_code, 0);
  row["iou"] = row["iou"].get<double>() + 0.2;
  expected["clips"][0]["fingerprint"]["mean_area_m2"] = 7;
  const Outcome worse = Bench(suite, {"--expect", Write("better.json", expected)});
  EXPECT_EQ(worse.exit_code, 1);
  EXPECT_THAT(worse.err, HasSubstr("worse: tiny, pose: IoU"));
  EXPECT_THAT(worse.err, HasSubstr("worse: tiny: the clip is another one: mean_area_m2"));

  // Other errors of the detections are another clip.
  EXPECT_EQ(Bench(suite, {"--noise", "exact"}).exit_code, 0);
  EXPECT_LT(Result()["clips"][0]["stages"]["pose"]["mpjpe"], stages["pose"]["mpjpe"]);
}

TEST_F(BenchCommandTest, RefusesAFileForAFolder) {
  folder_.Write("bench", "a file where the folder shall be");
  ExpectOneSentence(Bench(Write("suite.json", Suite())), "is not a folder");
}

TEST_F(BenchCommandTest, RefusesWhatIsNoSuite) {
  ExpectOneSentence(Bench((folder_ / "none.json").string()), "none.json");
  ExpectOneSentence(Bench(folder_.Write("text.json", "clips: none").string()), "text.json");
  ExpectOneSentence(Bench(Write("other.json", {{"format", "mpc-truth"}, {"version", 1}})),
                    "is no mpc-suite");
  ExpectOneSentence(Bench(Write("no_clips.json", {{"format", "mpc-suite"}, {"version", 1}})),
                    "clips");
  ExpectOneSentence(Bench(Write("name.json", Suite({{"name", "../up"}}))), "\"../up\" is no name");
  Json twice = Suite();
  twice["clips"].push_back(twice["clips"][0]);
  ExpectOneSentence(Bench(Write("twice.json", twice)), "two clips are called tiny");
  ExpectOneSentence(Bench(Write("motion.json", Suite({{"motion", "fly"}}))), "clip tiny: --motion");
  ExpectOneSentence(Bench(Write("size.json", Suite({{"width", -3}}))), "clip tiny: --width");
  ExpectOneSentence(Bench(Write("type.json", Suite({{"seconds", "long"}}))), "type.json");
  EXPECT_EQ(Bench("small", {"--noise", "loud"}).exit_code, 2);
  const std::string suite = Write("suite.json", Suite());
  ExpectOneSentence(Bench(suite, {"--expect", (folder_ / "before.json").string()}), "before.json");
  ExpectOneSentence(Bench(suite, {"--expect", suite}), "holds no results");
}

TEST_F(BenchCommandTest, CtrlCKeepsFinishedClips) {
  Json suite = Suite();
  suite["clips"].push_back(suite["clips"][0]);
  suite["clips"][1].update({{"name", "long"}, {"seconds", 30}});
  const Process process({MPC_COMMAND, "bench", "--no-real", "--suite", Write("suite.json", suite),
                         "-o", output().string()});
  while (!fs::exists(output() / "long" / "clip" / "truth.trc") && process.IsRunning()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  process.Signal(SIGINT);
  const Outcome outcome = process.Wait();
  EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("interrupted after 1 clips: they are kept in"));
  EXPECT_THAT(outcome.out, HasSubstr("| tiny (6 frames, 25 fps) |"));
  EXPECT_TRUE(fs::exists(output() / "tiny" / "result.json"));
  EXPECT_FALSE(fs::exists(output() / "long" / "result.json"));
  EXPECT_FALSE(fs::exists(output() / "results.json"));
}

}  // namespace
}  // namespace mpc
