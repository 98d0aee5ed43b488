// Files that are no network, or a broken one: always Error, never a crash, a hang or much memory.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <random>
#include <string>

#include "io/temp_dir.h"
#include "mpc/detect/models.h"
#include "mpc/detect/network.h"
#include "mpc/detect/person_detector.h"
#include "mpc/detect/pose_landmarker.h"
#include "small_model.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

using testing::Bytes;
using testing::SmallModel;
using testing::TableNode;
using testing::TfliteWriter;

Network FromBytes(const Bytes& bytes) { return Network::FromTflite(bytes, "model"); }

cv::Mat Blob(int height, int width) {
  const int sizes[] = {1, 3, height, width};
  return {4, sizes, CV_32F, cv::Scalar(0.25)};
}

TEST(BrokenModels, TheWholeSmallModelRuns) {
  Network network = FromBytes(SmallModel());
  EXPECT_EQ(network.input_width(), 8);
  const std::vector<cv::Mat> outputs = network.Run(Blob(8, 8));
  EXPECT_EQ(outputs.at(0).total(), 128u);
  EXPECT_EQ(outputs.at(1).total(), 64u);
}

TEST(BrokenModels, CutAtAnyByte) {
  const Bytes whole = SmallModel();
  for (size_t size = 0; size < whole.size(); ++size) {
    SCOPED_TRACE(size);
    const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    EXPECT_MPC_ERROR(FromBytes(cut), kBadFile, "model: byte");
  }
}

// A changed byte either makes Error or a network that can be run.
TEST(BrokenModels, AnyBytesChanged) {
  const Bytes whole = SmallModel();
  std::mt19937 rng(3);
  int num_refused = 0;
  constexpr int kNumFiles = 4000;
  for (int i = 0; i < kNumFiles; ++i) {
    Bytes changed = whole;
    for (unsigned n = 0; n <= rng() % 3; ++n) {
      const size_t at = 8 + rng() % (changed.size() - 8);
      const Bytes values = {0, 1, 0x7f, 0x80, 0xff, static_cast<std::uint8_t>(rng())};
      changed[at] = values[rng() % values.size()];
    }
    try {
      Network network = FromBytes(changed);
      if (network.input_height() * network.input_width() <= 4096) {
        network.Run(Blob(network.input_height(), network.input_width()));
      }
    } catch (const Error& e) {
      EXPECT_TRUE(e.code() == ErrorCode::kBadFile || e.code() == ErrorCode::kUnsupported)
          << e.what();
      ++num_refused;
    }
  }
  EXPECT_GT(num_refused, kNumFiles / 10);
  EXPECT_LT(num_refused, kNumFiles);
}

TEST(BrokenModels, OtherKindsOfFiles) {
  const testing::TempDir dir;
  EXPECT_MPC_ERROR(Network::Read(dir / "none.tflite"), kFileNotFound, "none.tflite");
  EXPECT_MPC_ERROR(Network::Read(dir.path()), kFileNotFound, dir.path().string());
  for (const std::string content : {"", "GIF89a, a picture", "{\"format\": \"mpc-report\"}"}) {
    std::ofstream(dir / "model.tflite") << content;
    EXPECT_MPC_ERROR(Network::Read(dir / "model.tflite"), kBadFile, "model.tflite");
  }
}

TEST(BrokenModels, WhatTheNetworksOfPosesDoNotNeed) {
  const auto with_op = [](int op, const std::vector<std::int32_t>& shape, TableNode options = {}) {
    TfliteWriter model({1, 4, 4, 3});
    const int out = model.Op(static_cast<testing::TfliteOp>(op), {0}, shape, std::move(options));
    return model.File({out});
  };
  EXPECT_MPC_ERROR(FromBytes(with_op(99, {1, 4, 4, 3})), kUnsupported, "operation 99");
  EXPECT_MPC_ERROR(FromBytes(with_op(testing::kOpReshape, {1, 2, 8, 3})), kUnsupported, "4 axes");
  EXPECT_MPC_ERROR(FromBytes(with_op(testing::kOpReshape, {1, 47})), kBadFile, "new shape");
  EXPECT_MPC_ERROR(FromBytes(with_op(testing::kOpLogistic, {1, 4, 4, 2})), kBadFile,
                   "[1, 4, 4, 2], expected [1, 4, 4, 3]");
  EXPECT_MPC_ERROR(FromBytes(with_op(testing::kOpDepthToSpace, {1, 4, 4, 3},
                                     TableNode().Scalar<std::int32_t>(0, 2))),
                   kBadFile, "blocks");
  EXPECT_MPC_ERROR(FromBytes(TfliteWriter({1, 4, 4, 3}).File({})), kBadFile, "no outputs");
  EXPECT_MPC_ERROR(FromBytes(TfliteWriter({1, 4, 4}).File({0})), kBadFile, "height x width");
  EXPECT_MPC_ERROR(FromBytes(TfliteWriter({1, 4, 4, 1}).File({0})), kUnsupported, "1 channels");
  EXPECT_MPC_ERROR(FromBytes(TfliteWriter({1, 4, 0, 3}).File({0})), kBadFile, "size 0");
  EXPECT_MPC_ERROR(FromBytes(TfliteWriter({1, 1 << 20, 1 << 20, 3}).File({0})), kBadFile, "size");
}

// Many large constants that share the bytes of one small buffer cannot be.
TEST(BrokenModels, SparseWeightsLargerThanTheFileCanHold) {
  TfliteWriter model({1, 4, 4, 3});
  const int bias = model.Floats({200000}, std::vector<float>(200000));
  const int sparse = model.SparseHalves({200000, 1, 1, 3}, std::vector<float>(600000));
  TableNode options;
  options.Scalar<std::int32_t>(1, 1).Scalar<std::int32_t>(2, 1);
  const int out = model.Op(testing::kOpConv, {0, sparse, bias}, {1, 4, 4, 200000}, options);
  EXPECT_NO_THROW(FromBytes(model.File({out})));  // 3 values per row start: as dense as it gets

  TfliteWriter wide({1, 4, 4, 3});
  const int pads = wide.Ints({4, 2}, {0, 0, 0, 0, 0, 0, 0, 4093});
  const int input = wide.Op(testing::kOpPad, {0, pads}, {1, 4, 4, 4096});
  const int no_weights = wide.SparseHalves({1000, 1, 1, 4096}, std::vector<float>(4096000));
  const int no_bias = wide.Floats({1000}, std::vector<float>(1000));
  const int huge =
      wide.Op(testing::kOpConv, {input, no_weights, no_bias}, {1, 4, 4, 1000}, options);
  EXPECT_MPC_ERROR(FromBytes(wide.File({huge})), kBadFile, "more constants");
}

TEST(BrokenModels, AnotherNetworkInItsPlace) {
  EXPECT_MPC_ERROR(PersonDetector(FromBytes(SmallModel())), kUnsupported, "8x8");
  EXPECT_MPC_ERROR(PoseLandmarker(FromBytes(SmallModel())), kUnsupported, "8x8");
  const auto adds_to_itself = [](int side) {
    TfliteWriter model({1, side, side, 3});
    const int out = model.Op(testing::kOpAdd, {0, 0}, {1, side, side, 3});
    return FromBytes(model.File({out}));
  };
  const cv::Mat picture(64, 64, CV_8UC3, cv::Scalar::all(90));
  PersonDetector detector(adds_to_itself(224));
  EXPECT_MPC_ERROR(detector.Find(picture, {0, 0, 64, 64}), kUnsupported, "no person detector");
  PoseLandmarker landmarker(adds_to_itself(256));
  EXPECT_MPC_ERROR(landmarker.Find(picture, {.center = {32, 32}, .size_px = 50}), kUnsupported,
                   "no network for body landmarks");
}

TEST(BrokenModels, AnotherInput) {
  Network network = FromBytes(SmallModel());
  EXPECT_MPC_ERROR(network.Run(Blob(8, 9)), kInvalidArgument, "1 x 3 x 8 x 8");
  EXPECT_MPC_ERROR(network.Run(cv::Mat()), kInvalidArgument, "1 x 3 x 8 x 8");
}

TEST(Models, AreNamedWithTheCommandThatFetchesThem) {
  const testing::TempDir dir;
  EXPECT_MPC_ERROR(FindPoseModels(dir.path()), kFileNotFound, "run scripts/get_models.sh");
  for (const char* name :
       {"pose_detection.onnx", "pose_landmark_heavy.onnx", "pose_landmark_heavy.tflite"}) {
    std::ofstream(dir / name) << "x";
  }
  const PoseModels models = FindPoseModels(dir.path());
  EXPECT_EQ(models.detector, dir / "pose_detection.onnx");
  EXPECT_EQ(models.landmarker, dir / "pose_landmark_heavy.tflite");
}

}  // namespace
}  // namespace mpc
