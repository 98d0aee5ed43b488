// Purpose: the tensors of a TensorFlow Lite file while its operations are read: shapes, which of
// them are known by now, and the weights, decoded.
// Source: TensorFlow Lite schema, version 3.
#pragma once

#include <cstdint>
#include <vector>

#include "flatbuffer.h"
#include "graph.h"

namespace mpc::internal {

// All functions throw Error: kBadFile, kUnsupported. A `place` is the table that a fault is in.
class TfliteTensors {
 public:
  TfliteTensors(const FlatBytes* file, FlatVector tensors, FlatVector buffers);

  // Checked.
  int Index(const FlatTable& place, std::int32_t index) const;
  const std::vector<int>& Shape(int index) const { return tensors_[Slot(index)].shape; }
  std::int64_t Count(int index) const;
  void ExpectShape(const FlatTable& place, int index, const std::vector<int>& expected) const;
  // 1 x height x width x channels.
  void ExpectPicture(const FlatTable& place, int index) const;

  bool IsComputed(int index) const { return states_[Slot(index)] == State::kComputed; }
  bool IsUnknown(int index) const { return states_[Slot(index)] == State::kUnknown; }
  void SetComputed(int index) { states_[Slot(index)] = State::kComputed; }
  // From now on `index` stands for the constant `source`, as stored.
  void SetDecoded(const FlatTable& place, int index, int source);

  // The tensor with the floats that `index` stands for; loads them when they are first wanted.
  int Weights(const FlatTable& place, int index);
  std::vector<std::int32_t> Ints(const FlatTable& place, int index, std::int64_t count) const;

  std::vector<GraphTensor> Take() { return std::move(tensors_); }

 private:
  enum class State { kUnknown, kComputed, kConstant };

  static size_t Slot(int index) { return static_cast<size_t>(index); }
  FlatVector Data(const FlatTable& tensor) const;
  void Load(int index);
  void LoadDense(const FlatTable& tensor, std::int64_t count, std::vector<float>* values) const;
  void LoadSparse(const FlatTable& tensor, const std::vector<int>& shape, std::int64_t count,
                  std::vector<float>* values) const;

  const FlatBytes* file_;
  FlatVector tables_, buffers_;
  std::vector<GraphTensor> tensors_;
  std::vector<State> states_;
  std::vector<int> sources_;  // of a decoded constant: the tensor with its data
  std::int64_t values_left_;  // constants that may still be loaded
};

}  // namespace mpc::internal
