// The Khronos validator finds no error and no warning in a written file that the source had not.
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <sstream>

#include "io/random_performance.h"
#include "io/run_program.h"
#include "io/temp_dir.h"
#include "io/test_gltf.h"
#include "mpc/eval/dressed_actor.h"
#include "mpc/io/rig_gltf.h"
#include "mpc/skeleton/proportions.h"
#include "mpc/skeleton/rig_map.h"
#include "support/data_dir.h"
#include "support/test_rig.h"

namespace mpc {
namespace {

namespace fs = std::filesystem;

class ValidatorTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (testing::RunProgram("node -e \"require('gltf-validator')\"").status != 0) {
      GTEST_SKIP() << "needs node with the package gltf-validator: run scripts/setup.sh and set "
                      "NODE_PATH to build/tools/node_modules";
    }
  }

  // Number of errors and warnings per code.
  static std::map<std::string, int> Issues(const fs::path& file) {
    const testing::ProgramResult result =
        testing::RunProgram("node '" MPC_VALIDATOR_SCRIPT "' '" + file.string() + "'");
    EXPECT_EQ(result.status, 0) << result.output;
    EXPECT_NE(result.output.find("done"), std::string::npos);
    std::map<std::string, int> issues;
    std::istringstream lines(result.output);
    for (std::string name, code, count;
         lines >> name && name != "done" && lines >> code >> count;) {
      issues[code] = std::stoi(count);
    }
    return issues;
  }

  void ExpectNoNewIssues(const fs::path& source, const RigAsset& rig, GltfPerformance performance) {
    const std::map<std::string, int> before = Issues(source);
    performance.camera = Camera::FromFov(1080, 1920, 1.0);
    std::vector<Eigen::Matrix3Xf> surface = testing::WavingSurface(rig, performance);
    // Sparse, without any offset, and dense targets.
    surface[1] = testing::WavingSurface(rig, performance, 0)[1];
    surface[2].leftCols(surface[2].cols() - 9) = surface[1].leftCols(surface[2].cols() - 9);
    Pc2Reader reader = testing::WriteSurface(dir_ / "surface.pc2", surface);
    const std::array<std::pair<Pc2Reader*, int>, 3> kinds = {
        {{nullptr, 1}, {&reader, 1}, {&reader, 4}}};
    for (const auto& [kind, frames_per_target] : kinds) {
      performance.surface = kind;
      performance.frames_per_target = frames_per_target;
      WriteGltfPerformance(dir_ / "out.glb", source, rig, performance);
      for (const auto& [code, count] : Issues(dir_ / "out.glb")) {
        const auto it = before.find(code);
        EXPECT_LE(count, it == before.end() ? 0 : it->second) << code;
      }
    }
  }

  // As it is, and with other proportions.
  void CheckHumanoid(const fs::path& source) {
    RigAsset rig = ReadRigGltf(source);
    Character character = BuildCharacter(rig, MapRigByNames(rig));
    ExpectNoNewIssues(source, rig, testing::RandomPerformance(rig, character, 10, 60));
    Proportions proportions;
    proportions.overall = 0.95;
    proportions.part[static_cast<size_t>(BodyPart::kForearm)] = 1.1;
    ApplyProportions(proportions, &character, &rig);
    ExpectNoNewIssues(source, rig, testing::RandomPerformance(rig, character, 10, 60));
  }

  testing::TempDir dir_;
};

TEST_F(ValidatorTest, FindsWhatIsWrong) {
  testing::TestGltf file(testing::MakeTestRig(), {});
  file.json["nodes"][0]["rotation"] = {0, 0, 0, 2};
  EXPECT_FALSE(Issues(dir_.Write("bad.glb", file.Bytes())).empty());
}

TEST_F(ValidatorTest, SyntheticRigs) {
  for (const testing::TestGltfOptions& options : testing::TestGltfVariants()) {
    testing::TestGltf file(testing::MakeTestRig({.arm_down_rad = 0.8}), options);
    CheckHumanoid(dir_.Write(options.data_uri ? "a.gltf" : "a.glb", file.Bytes()));
  }
}

TEST_F(ValidatorTest, TheDressedActorWithItsTexture) {
  // The closed body alone, and with an open sheet; the other outfits' files are no different.
  for (const Outfit outfit : {Outfit::kTight, Outfit::kCoat}) {
    WriteRigGltf(dir_ / "actor.glb", MakeDressedActor({.outfit = outfit}).rig);
    for (const auto& [code, count] : Issues(dir_ / "actor.glb")) ADD_FAILURE() << code << count;
    CheckHumanoid(dir_ / "actor.glb");
  }
}

TEST_F(ValidatorTest, RealActors) {
  MPC_REQUIRE_DATA();
  const fs::path actors = *testing::DataDir() / "actors";
  for (const char* name :
       {"male_tpose.glb", "male_apose.glb", "male_apose_lod5k.glb", "female_apose.glb"}) {
    SCOPED_TRACE(name);
    CheckHumanoid(actors / name);
  }
  const RigAsset rig = ReadRigGltf(actors / "CesiumMan.glb");
  ExpectNoNewIssues(actors / "CesiumMan.glb", rig, testing::RandomBonePerformance(rig, 10, 60));
}

}  // namespace
}  // namespace mpc
