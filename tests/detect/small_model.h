// Purpose: a small network with every operation, and with weights of every kind.
#pragma once

#include <vector>

#include "tflite_writer.h"

namespace mpc::testing {

inline Bytes SmallModel() {
  TfliteWriter model({1, 8, 8, 3});
  const auto conv = [](int padding, int stride) {
    return TableNode()
        .Scalar(0, static_cast<std::int8_t>(padding))
        .Scalar<std::int32_t>(1, stride)
        .Scalar<std::int32_t>(2, stride);
  };
  const int bias3 = model.Floats({3}, {0.5f, 0, -1});
  const int bias4 = model.Floats({4}, {0, 1, 0, 0});
  const int pads = model.Ints({4, 2}, {0, 0, 1, 1, 1, 1, 0, 0});
  const int padded = model.Op(kOpPad, {0, pads}, {1, 10, 10, 3});
  const int depthwise_half = model.Halves({1, 3, 3, 3}, std::vector<float>(27, 0.125f));
  const int depthwise = model.Op(kOpDequantize, {depthwise_half}, {1, 3, 3, 3});
  const int a = model.Op(kOpDepthwiseConv, {padded, depthwise, bias3}, {1, 4, 4, 3},
                         conv(1, 2).Scalar<std::int32_t>(3, 1).Scalar<std::int8_t>(4, 3));
  const int sparse = model.SparseHalves({4, 1, 1, 3}, {1, 0, 0, 0, 0.5f, 0, 0, 0, 0, 0, 0.25f, 2});
  const int dense = model.Op(kOpDensify, {sparse}, {4, 1, 1, 3});
  const int weights = model.Op(kOpDequantize, {dense}, {4, 1, 1, 3});
  const int b = model.Op(kOpConv, {a, weights, bias4}, {1, 4, 4, 4}, conv(0, 1));
  const int c = model.Op(kOpAdd, {b, b}, {1, 4, 4, 4}, TableNode().Scalar<std::int8_t>(0, 3));
  TableNode pool = conv(1, 2);
  pool.Scalar<std::int32_t>(3, 2).Scalar<std::int32_t>(4, 2);
  const int d = model.Op(kOpMaxPool, {c}, {1, 2, 2, 4}, pool);
  const int size = model.Ints({2}, {4, 4});
  const int e =
      model.Op(kOpResizeBilinear, {d, size}, {1, 4, 4, 4}, TableNode().Scalar<std::uint8_t>(3, 1));
  const int f =
      model.Op(kOpDepthToSpace, {e}, {1, 8, 8, 1}, TableNode().Scalar<std::int32_t>(0, 2));
  const int g = model.Op(kOpReshape, {f}, {1, 64});
  const int h = model.Op(kOpReshape, {c}, {1, 64});
  const int i =
      model.Op(kOpConcatenation, {g, h}, {1, 128}, TableNode().Scalar<std::int32_t>(0, 1));
  const int j = model.Op(kOpLogistic, {i}, {1, 128});
  return model.File({j, e});
}

}  // namespace mpc::testing
