// Every operation of the networks, from a file, against plain loops over its definition.
#include "mpc/detect/network.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tflite_writer.h"

namespace mpc {
namespace {

using testing::Bytes;
using testing::TableNode;
using testing::TfliteWriter;

// Height x width x channels.
struct Picture {
  int h = 0, w = 0, c = 0;
  std::vector<float> v;

  Picture(int rows, int columns, int channels)
      : h(rows), w(columns), c(channels), v(static_cast<size_t>(rows * columns * channels)) {}
  float& at(int y, int x, int k) { return v[static_cast<size_t>((y * w + x) * c + k)]; }
  float at(int y, int x, int k) const { return v[static_cast<size_t>((y * w + x) * c + k)]; }
  // 0 outside.
  float padded(int y, int x, int k) const {
    return y < 0 || x < 0 || y >= h || x >= w ? 0 : at(y, x, k);
  }
  std::vector<std::int32_t> shape() const { return {1, h, w, c}; }
};

enum { kSame = 0, kValid = 1 };

class NetworkTest : public ::testing::Test {
 protected:
  std::vector<float> Random(size_t count) {
    std::uniform_real_distribution<float> uniform(-1, 1);
    std::vector<float> values(count);
    for (float& value : values) value = uniform(rng_);
    return values;
  }
  Picture RandomPicture(int h, int w, int c) {
    Picture picture(h, w, c);
    picture.v = Random(picture.v.size());
    return picture;
  }
  // Weights that half floats hold exactly.
  std::vector<float> Eighths(size_t count) {
    std::vector<float> values = Random(count);
    for (float& value : values) value = std::round(8 * value) / 8;
    return values;
  }

  static cv::Mat Blob(const Picture& picture) {
    const int sizes[] = {1, picture.c, picture.h, picture.w};
    cv::Mat blob(4, sizes, CV_32F);
    for (int k = 0; k < picture.c; ++k) {
      for (int y = 0; y < picture.h; ++y) {
        for (int x = 0; x < picture.w; ++x) {
          blob.ptr<float>(0, k, y)[x] = picture.at(y, x, k);
        }
      }
    }
    return blob;
  }

  static cv::Mat Run(const TfliteWriter& model, int output, const Picture& in) {
    const Bytes file = model.File({output});
    return Network::FromTflite(file, "test").Run(Blob(in)).at(0);
  }

  static void ExpectPicture(const cv::Mat& out, const Picture& expected, float tolerance = 1e-5f) {
    ASSERT_EQ(out.dims, 4);
    ASSERT_EQ(out.size[1], expected.c);
    ASSERT_EQ(out.size[2], expected.h);
    ASSERT_EQ(out.size[3], expected.w);
    for (int k = 0; k < expected.c; ++k) {
      for (int y = 0; y < expected.h; ++y) {
        for (int x = 0; x < expected.w; ++x) {
          ASSERT_NEAR(out.ptr<float>(0, k, y)[x], expected.at(y, x, k), tolerance)
              << "at " << y << ", " << x << ", channel " << k;
        }
      }
    }
  }

  std::mt19937 rng_{7};
};

struct ConvCase {
  int h, w, out_channels, kernel, stride, padding;
  bool depthwise, relu6;
};

// TensorFlow's padding "SAME": the output has size / stride cells, rounded up; an odd pad goes
// behind.
Picture PlainConvolution(const Picture& in, const ConvCase& test, const std::vector<float>& weights,
                         const std::vector<float>& bias) {
  const auto out_size = [&](int size) {
    return test.padding == kSame ? (size + test.stride - 1) / test.stride
                                 : (size - test.kernel) / test.stride + 1;
  };
  Picture out(out_size(in.h), out_size(in.w), test.depthwise ? in.c : test.out_channels);
  const auto pad = [&](int size, int cells) {
    return test.padding == kSame ? std::max(0, (cells - 1) * test.stride + test.kernel - size) / 2
                                 : 0;
  };
  const int top = pad(in.h, out.h), left = pad(in.w, out.w);
  for (int y = 0; y < out.h; ++y) {
    for (int x = 0; x < out.w; ++x) {
      for (int o = 0; o < out.c; ++o) {
        double sum = bias[static_cast<size_t>(o)];
        for (int i = 0; i < test.kernel; ++i) {
          for (int j = 0; j < test.kernel; ++j) {
            const int row = y * test.stride - top + i, column = x * test.stride - left + j;
            for (int k = 0; k < in.c; ++k) {
              if (test.depthwise && k != o) continue;
              const int weight = test.depthwise
                                     ? (i * test.kernel + j) * in.c + k
                                     : ((o * test.kernel + i) * test.kernel + j) * in.c + k;
              sum += double{in.padded(row, column, k)} * weights[static_cast<size_t>(weight)];
            }
          }
        }
        out.at(y, x, o) = static_cast<float>(test.relu6 ? std::clamp(sum, 0.0, 6.0) : sum);
      }
    }
  }
  return out;
}

class ConvolutionTest : public NetworkTest, public ::testing::WithParamInterface<ConvCase> {};

TEST_P(ConvolutionTest, EqualsItsDefinition) {
  const ConvCase& test = GetParam();
  Picture in = RandomPicture(test.h, test.w, 3);
  for (float& value : in.v) value *= 5;  // so that both ends of RELU6 are met
  const int out_channels = test.depthwise ? 3 : test.out_channels;
  const auto k = static_cast<size_t>(test.kernel);
  const std::vector<float> weights =
      Eighths(k * k * 3 * static_cast<size_t>(test.depthwise ? 1 : out_channels));
  const std::vector<float> bias = Eighths(static_cast<size_t>(out_channels));
  const Picture expected = PlainConvolution(in, test, weights, bias);

  TfliteWriter model(in.shape());
  const int w =
      model.Halves({test.depthwise ? 1 : out_channels, test.kernel, test.kernel, 3}, weights);
  const int b = model.Floats({out_channels}, bias);
  const int decoded = model.Op(testing::kOpDequantize, {w},
                               {test.depthwise ? 1 : out_channels, test.kernel, test.kernel, 3});
  TableNode options;
  options.Scalar<std::int8_t>(0, static_cast<std::int8_t>(test.padding))
      .Scalar<std::int32_t>(1, test.stride)
      .Scalar<std::int32_t>(2, test.stride);
  if (test.depthwise) options.Scalar<std::int32_t>(3, 1);
  if (test.relu6) options.Scalar<std::int8_t>(test.depthwise ? 4 : 3, 3);
  const int out = model.Op(test.depthwise ? testing::kOpDepthwiseConv : testing::kOpConv,
                           {0, decoded, b}, expected.shape(), options);
  ExpectPicture(Run(model, out, in), expected, 1e-4f);
}

INSTANTIATE_TEST_SUITE_P(
    Kinds, ConvolutionTest,
    ::testing::Values(
        ConvCase{5, 7, 4, 1, 1, kSame, false, true}, ConvCase{5, 7, 4, 1, 1, kValid, false, false},
        ConvCase{9, 7, 4, 3, 2, kValid, false, true}, ConvCase{6, 7, 2, 3, 1, kSame, false, false},
        ConvCase{4, 4, 5, 2, 1, kValid, false, false},
        ConvCase{8, 6, 0, 3, 2, kSame, true, true},   // unequal pads
        ConvCase{7, 9, 0, 3, 2, kSame, true, false},  // equal ones
        ConvCase{8, 6, 0, 3, 1, kSame, true, false}, ConvCase{9, 8, 0, 5, 1, kSame, true, true},
        ConvCase{9, 11, 0, 5, 2, kValid, true, false}));

TEST_F(NetworkTest, SparseWeightsAreTheirDenseForm) {
  const Picture in = RandomPicture(4, 5, 3);
  const std::vector<float> weights = {0, 0.5f, 0,     -0.25f, 0, 0, 0,      0,
                                      0, 1,    0.75f, 0,      0, 0, -0.125f};
  const ConvCase test = {4, 5, 5, 1, 1, kSame, false, false};
  const Picture expected = PlainConvolution(in, test, weights, std::vector<float>(5));
  TfliteWriter model(in.shape());
  const int sparse = model.SparseHalves({5, 1, 1, 3}, weights);
  const int dense = model.Op(testing::kOpDensify, {sparse}, {5, 1, 1, 3});
  const int decoded = model.Op(testing::kOpDequantize, {dense}, {5, 1, 1, 3});
  const int bias = model.Floats({5}, std::vector<float>(5));
  TableNode options;
  options.Scalar<std::int32_t>(1, 1).Scalar<std::int32_t>(2, 1);
  const int out = model.Op(testing::kOpConv, {0, decoded, bias}, expected.shape(), options);
  ExpectPicture(Run(model, out, in), expected);
}

TEST_F(NetworkTest, AddWithRelu6) {
  Picture in = RandomPicture(3, 4, 3);
  for (float& value : in.v) value *= 8;
  Picture expected = in;
  for (float& value : expected.v) value = std::clamp(2 * value, 0.0f, 6.0f);
  TfliteWriter model(in.shape());
  const int out =
      model.Op(testing::kOpAdd, {0, 0}, in.shape(), TableNode().Scalar<std::int8_t>(0, 3));
  ExpectPicture(Run(model, out, in), expected);
}

TEST_F(NetworkTest, PadOfRowsColumnsAndChannels) {
  const Picture in = RandomPicture(3, 4, 3);
  Picture expected(3 + 1 + 2, 4 + 3, 3 + 2);
  for (int y = 0; y < in.h; ++y) {
    for (int x = 0; x < in.w; ++x) {
      for (int k = 0; k < in.c; ++k) expected.at(y + 1, x + 3, k) = in.at(y, x, k);
    }
  }
  TfliteWriter model(in.shape());
  const int pads = model.Ints({4, 2}, {0, 0, 1, 2, 3, 0, 0, 2});
  const int out = model.Op(testing::kOpPad, {0, pads}, expected.shape());
  ExpectPicture(Run(model, out, in), expected);
}

TEST_F(NetworkTest, MaxPool) {
  const Picture in = RandomPicture(6, 8, 3);
  Picture expected(3, 4, 3);
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 4; ++x) {
      for (int k = 0; k < 3; ++k) {
        expected.at(y, x, k) =
            std::max({in.at(2 * y, 2 * x, k), in.at(2 * y, 2 * x + 1, k),
                      in.at(2 * y + 1, 2 * x, k), in.at(2 * y + 1, 2 * x + 1, k)});
      }
    }
  }
  TfliteWriter model(in.shape());
  TableNode options;
  options.Scalar<std::int8_t>(0, kValid);
  for (int field = 1; field <= 4; ++field) options.Scalar<std::int32_t>(field, 2);
  const int out = model.Op(testing::kOpMaxPool, {0}, expected.shape(), options);
  ExpectPicture(Run(model, out, in), expected);
}

TEST_F(NetworkTest, ResizeWithHalfPixelCentres) {
  const Picture in = RandomPicture(3, 4, 3);
  Picture expected(6, 8, 3);
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) {
      const double row = std::clamp((y + 0.5) / 2 - 0.5, 0.0, 2.0);
      const double column = std::clamp((x + 0.5) / 2 - 0.5, 0.0, 3.0);
      const int r = static_cast<int>(row), c = static_cast<int>(column);
      const int r1 = std::min(r + 1, 2), c1 = std::min(c + 1, 3);
      const double a = row - r, b = column - c;
      for (int k = 0; k < 3; ++k) {
        expected.at(y, x, k) =
            static_cast<float>((1 - a) * ((1 - b) * in.at(r, c, k) + b * in.at(r, c1, k)) +
                               a * ((1 - b) * in.at(r1, c, k) + b * in.at(r1, c1, k)));
      }
    }
  }
  TfliteWriter model(in.shape());
  const int size = model.Ints({2}, {6, 8});
  const int out = model.Op(testing::kOpResizeBilinear, {0, size}, expected.shape(),
                           TableNode().Scalar<std::uint8_t>(3, 1));
  ExpectPicture(Run(model, out, in), expected);
}

// The network's input has 3 channels, so a padded picture of 4 is the one that is spread.
TEST_F(NetworkTest, DepthToSpaceAfterPad) {
  const Picture in = RandomPicture(2, 3, 3);
  Picture padded(2, 3, 8);
  Picture expected(4, 6, 2);
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) {
      for (int k = 0; k < 3; ++k) padded.at(y, x, k + 2) = in.at(y, x, k);
      for (int i = 0; i < 2; ++i) {
        for (int j = 0; j < 2; ++j) {
          for (int k = 0; k < 2; ++k) {
            expected.at(2 * y + i, 2 * x + j, k) = padded.at(y, x, (2 * i + j) * 2 + k);
          }
        }
      }
    }
  }
  TfliteWriter model(in.shape());
  const int pads = model.Ints({4, 2}, {0, 0, 0, 0, 0, 0, 2, 3});
  const int wide = model.Op(testing::kOpPad, {0, pads}, padded.shape());
  const int out = model.Op(testing::kOpDepthToSpace, {wide}, expected.shape(),
                           TableNode().Scalar<std::int32_t>(0, 2));
  ExpectPicture(Run(model, out, in), expected);
}

TEST_F(NetworkTest, ReshapeKeepsTensorFlowsOrderAndJoins) {
  const Picture in = RandomPicture(2, 2, 3);
  TfliteWriter model(in.shape());
  const int list = model.Op(testing::kOpReshape, {0}, {1, 4, 3});
  const int flags = model.Op(testing::kOpLogistic, {list}, {1, 4, 3});
  const int out = model.Op(testing::kOpConcatenation, {list, flags}, {1, 8, 3},
                           TableNode().Scalar<std::int32_t>(0, 1));
  const cv::Mat result = Run(model, out, in);
  ASSERT_EQ(result.total(), 24u);
  for (size_t i = 0; i < 12; ++i) {
    EXPECT_FLOAT_EQ(result.ptr<float>()[i], in.v[i]);
    EXPECT_NEAR(result.ptr<float>()[12 + i], 1 / (1 + std::exp(-in.v[i])), 1e-6);
  }
}

TEST_F(NetworkTest, OutputsComeInTheOrderOfTheFileAndKeepTheirValues) {
  const Picture in = RandomPicture(2, 2, 3);
  TfliteWriter model(in.shape());
  const int twice = model.Op(testing::kOpAdd, {0, 0}, in.shape());
  const int four_times = model.Op(testing::kOpAdd, {twice, twice}, in.shape());
  Network network = Network::FromTflite(model.File({four_times, twice}), "test");
  const std::vector<cv::Mat> first = network.Run(Blob(in));
  const float before = first[0].ptr<float>()[0];
  network.Run(Blob(RandomPicture(2, 2, 3)));
  EXPECT_FLOAT_EQ(first[0].ptr<float>()[0], before);
  EXPECT_FLOAT_EQ(first[0].ptr<float>()[0], 4 * in.v[0]);
  EXPECT_FLOAT_EQ(first[1].ptr<float>()[0], 2 * in.v[0]);
}

}  // namespace
}  // namespace mpc
