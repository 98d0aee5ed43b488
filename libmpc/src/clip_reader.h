// Purpose: the pictures of a clip, with the masks that belong to them, in chunks that threads share.
#pragma once

#include <algorithm>
#include <deque>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "clip_view.h"
#include "mpc/core/thread_pool.h"
#include "mpc/io/mask_file.h"
#include "mpc/io/video.h"
#include "mpc/silhouettes.h"

namespace mpc::internal {

struct ClipFrame {
  int index = 0;
  cv::Mat whole;     // the video's picture
  cv::Mat picture;   // as the view looks at it; so are the next two
  cv::Mat previous;  // the picture before; empty if there is none
  cv::Mat next;      // the picture after; empty if there is none
  cv::Mat given;     // the user's mask, of the video's size; empty: none
  cv::Mat truth;     // of the video's size; empty: none
  // The background's motions where they are known.
  std::optional<cv::Matx33d> previous_from_current;
  std::optional<cv::Matx33d> next_from_current;
};

// Throws Error: kMismatch for a video of another size than the camera, and what the reader throws.
VideoReader OpenVideo(const PosedClip& clip);

class ClipReader {
 public:
  // Throws Error as OpenVideo, and what the readers of masks throw.
  explicit ClipReader(const PosedClip& clip);

  // Throws Error (kMismatch) when video or masks have fewer frames than the clip.
  void Read(ClipFrame* frame);

  // Throws Error (kMismatch) when they have more.
  void ExpectEnd();

 private:
  [[noreturn]] void ThrowEnd(const std::filesystem::path& path) const;
  [[noreturn]] void ThrowTooLong(const std::filesystem::path& path) const;

  const PosedClip& clip_;
  VideoReader video_;
  std::optional<MaskReader> masks_;
  std::optional<MaskReader> truth_;
  Eigen::Index num_frames_;
  int num_read_ = 0;
};

inline size_t NumClipSlots(int num_threads) {
  return static_cast<size_t>(2 * ResolveNumThreads(num_threads));
}

// Calls process(frame, slot) for all frames, several at a time, and finish(frame, slot) in their
// order from the calling thread; slot < NumClipSlots tells which place of a chunk a frame has, and may
// name what process leaves for finish. finish returns false to end the work early: so does this
// function. Holds two pictures per thread and one more.
template <typename Process, typename Finish>
bool ForEachClipFrame(const PosedClip& clip, const ClipView& view, int num_threads,
                      const Process& process, const Finish& finish) {
  ClipReader reader(clip);
  const int num_frames = static_cast<int>(clip.poses.cols());
  const auto num_slots = static_cast<int>(NumClipSlots(num_threads));
  std::deque<ClipFrame> chunk;  // and the frame after it
  cv::Mat before;               // the last picture of the chunk before
  for (int begin = 0; begin < num_frames;) {
    const int count = std::min(num_slots, num_frames - begin);
    const int num_known = static_cast<int>(chunk.size());
    chunk.resize(static_cast<size_t>(std::min(count + 1, num_frames - begin)));
    for (size_t i = num_known; i < chunk.size(); ++i) reader.Read(&chunk[i]);
    ParallelFor(static_cast<int>(chunk.size()) - num_known, num_threads, [&](int i) {
      ClipFrame& frame = chunk[static_cast<size_t>(num_known + i)];
      frame.picture = view.Look(frame.whole);
    });
    for (size_t i = 0; i < static_cast<size_t>(count); ++i) {
      chunk[i].index = begin + static_cast<int>(i);
      chunk[i].previous = i > 0 ? chunk[i - 1].picture : before;
      if (i + 1 < chunk.size()) chunk[i].next = chunk[i + 1].picture;
    }
    ParallelFor(count, num_threads,
                [&](int i) { process(chunk[static_cast<size_t>(i)], static_cast<size_t>(i)); });
    for (int i = 0; i < count; ++i) {
      if (!finish(chunk[static_cast<size_t>(i)], static_cast<size_t>(i))) return false;
    }
    before = chunk[static_cast<size_t>(count) - 1].picture;
    chunk.erase(chunk.begin(), chunk.begin() + count);
    begin += count;
  }
  reader.ExpectEnd();
  return true;
}

}  // namespace mpc::internal
