#include "clip_reader.h"

#include <fmt/format.h>

#include "mpc/core/error.h"

namespace mpc::internal {

VideoReader OpenVideo(const PosedClip& clip) {
  VideoReader video(clip.video, clip.image_fps);
  if (video.width() != clip.camera.width || video.height() != clip.camera.height) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("{} is {} x {}, the camera {} x {}", clip.video.string(), video.width(),
                            video.height(), clip.camera.width, clip.camera.height));
  }
  return video;
}

ClipReader::ClipReader(const PosedClip& clip)
    : clip_(clip), video_(OpenVideo(clip)), num_frames_(clip.poses.cols()) {
  if (!clip.masks.empty()) masks_.emplace(clip.masks, video_.width(), video_.height());
  if (!clip.true_masks.empty()) truth_.emplace(clip.true_masks, video_.width(), video_.height());
}

void ClipReader::Read(ClipFrame* frame) {
  // New pictures: the ones before may still be in use.
  *frame = {};
  if (!video_.Read(&frame->whole)) ThrowEnd(clip_.video);
  if (masks_ && !masks_->Read(&frame->given)) ThrowEnd(clip_.masks);
  if (truth_ && !truth_->Read(&frame->truth)) ThrowEnd(clip_.true_masks);
  ++num_read_;
}

void ClipReader::ExpectEnd() {
  cv::Mat extra;
  if (video_.Read(&extra)) ThrowTooLong(clip_.video);
  if (masks_ && masks_->Read(&extra)) ThrowTooLong(clip_.masks);
  if (truth_ && truth_->Read(&extra)) ThrowTooLong(clip_.true_masks);
}

void ClipReader::ThrowEnd(const std::filesystem::path& path) const {
  throw Error(ErrorCode::kMismatch, fmt::format("{} has {} frames, but the actor has {} poses",
                                                path.string(), num_read_, num_frames_));
}

void ClipReader::ThrowTooLong(const std::filesystem::path& path) const {
  throw Error(ErrorCode::kMismatch, fmt::format("{} has more frames than the actor's {} poses",
                                                path.string(), num_frames_));
}

}  // namespace mpc::internal
