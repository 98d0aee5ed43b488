#include "mpc/detect/clip_detector.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <string>

#include "mpc/core/error.h"

namespace mpc {
namespace {

// Looks per period of the fastest motion to keep; 2 would be enough for a band-limited signal.
constexpr double kLooksPerPeriod = 3;
// How far joints may be off the straight line between two looks, RMS in sides of the region, for the
// motion to be even: 2 cm for a grown-up, which midway between looks are half a centimetre.
constexpr double kMaxBend = 0.01;
constexpr int kMaskSide = 128;
constexpr double kMaxAtDistance = 0.5;  // from the person's centre, in sides of the region

PersonMask SmallMask(const PersonPose& pose, int frame) {
  PersonMask mask = {.frame = frame, .region = pose.region};
  cv::Mat small;
  cv::resize(pose.mask, small, {kMaskSide, kMaskSide}, 0, 0, cv::INTER_AREA);
  small.convertTo(mask.probability, CV_8U, 255);
  return mask;
}

// The cubic through a and b, which are `step` frames apart, that leaves them with the slopes
// slope_a and slope_b; at the share t of the way.
template <typename Matrix>
Matrix Cubic(const Matrix& a, const Matrix& b, const Matrix& slope_a, const Matrix& slope_b,
             double step, double t) {
  const double t2 = t * t, t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * a + (3 * t2 - 2 * t3) * b + step * (t3 - 2 * t2 + t) * slope_a +
         step * (t3 - t2) * slope_b;
}

}  // namespace

void ClipDetectorOptions::Validate() const {
  std::string faults;
  const auto expect = [&](bool ok, const std::string& fault) {
    if (!ok) faults += (faults.empty() ? "" : "; ") + fault;
  };
  expect(person >= 1, fmt::format("person is {}, expected 1 or more", person));
  expect(!at || at->allFinite(), "at is not finite");
  expect(every >= 0, fmt::format("every is {}, expected 0 or more", every));
  expect(cutoff_hz > 0 && std::isfinite(cutoff_hz),
         fmt::format("cutoff_hz is {}, expected above 0", cutoff_hz));
  if (!faults.empty()) throw Error(ErrorCode::kInvalidArgument, "ClipDetectorOptions: " + faults);
}

int DetectionStride(double fps, double cutoff_hz) {
  const double frames = std::min(1e6, fps / (kLooksPerPeriod * cutoff_hz));
  return std::max(1, static_cast<int>(std::lround(frames)));
}

int EvenDetectionStride(double fps, double cutoff_hz) {
  const int stride = DetectionStride(fps, cutoff_hz);
  return 2 * stride * cutoff_hz <= fps ? 2 * stride : stride;
}

ClipDetector::ClipDetector(const PoseModels& models, int width, int height, double fps,
                           ClipDetectorOptions options)
    : tracker_(PersonDetector(Network::Read(models.detector)),
               PoseLandmarker(Network::Read(models.landmarker), options.landmarker), fps,
               options.tracker),
      options_(std::move(options)) {
  options_.Validate();
  const bool is_given = options_.every > 0;
  result_.every = is_given ? options_.every : EvenDetectionStride(fps, options_.cutoff_hz);
  between_ = is_given ? options_.every : DetectionStride(fps, options_.cutoff_hz);
  result_.detections2d.width = width;
  result_.detections2d.height = height;
}

const ClipDetector::Sample* ClipDetector::Person::Find(int frame) const {
  const auto found = samples.find(frame);
  return found != samples.end() ? &found->second : nullptr;
}

void ClipDetector::AddSample(const PersonPose& pose, int frame, Person* person) {
  Sample& sample = person->samples[frame];
  sample.frame = frame;
  sample.region = pose.refined;
  sample.mask = SmallMask(pose, frame);
  JointsFromBlazePose(pose.pixels, &sample.joints2d.pixels);
  JointsFromBlazePose(pose.world, &sample.joints3d.positions);
  sample.joints2d.confidence = JointConfidencesFromBlazePose(pose.Confidences());
  sample.joints3d.confidence = sample.joints2d.confidence;
}

// How far the joints are off the straight line from the look before to the one after.
double ClipDetector::Bend(const Sample& before, const Sample& at, const Sample& after) {
  const double t = static_cast<double>(at.frame - before.frame) / (after.frame - before.frame);
  const Eigen::Matrix2Xd off =
      at.joints2d.pixels - (1 - t) * before.joints2d.pixels - t * after.joints2d.pixels;
  const Eigen::VectorXd weights = at.joints2d.confidence.cwiseMin(before.joints2d.confidence)
                                      .cwiseMin(after.joints2d.confidence);
  const double mean_square = off.colwise().squaredNorm().dot(weights) / weights.sum();
  return std::sqrt(mean_square) / at.region.size_px;
}

// Between this look and the next; false where no look before and after them tells.
bool ClipDetector::MovesEvenly(const Person& person, size_t look) const {
  bool is_known = false;
  for (size_t i = std::max<size_t>(1, look); i <= look + 1 && i + 1 < looks_.size(); ++i) {
    const Sample* const before = person.Find(looks_[i - 1]);
    const Sample* const at = person.Find(looks_[i]);
    const Sample* const after = person.Find(looks_[i + 1]);
    if (before == nullptr || at == nullptr || after == nullptr) continue;
    if (!(Bend(*before, *at, *after) < kMaxBend)) return false;
    is_known = true;
  }
  return is_known;
}

// At those people who are in this look and the next and do not move evenly in between.
void ClipDetector::LookBetween(size_t look) {
  const int begin = looks_[look], end = looks_[look + 1];
  const auto held = held_.find(begin + between_);
  if (held == held_.end()) return;
  const auto& [frame, picture] = *held;
  for (auto& [id, person] : persons_) {
    const Sample* const a = person.Find(begin);
    const Sample* const b = person.Find(end);
    if (frame >= end || a == nullptr || b == nullptr || MovesEvenly(person, look)) continue;
    ++person.num_between;
    const double t = static_cast<double>(frame - begin) / (end - begin);
    const std::optional<PersonPose> pose =
        tracker_.FindExpected(picture, RegionBetween(a->region, b->region, t));
    if (pose) AddSample(*pose, frame, &person);
  }
  held_.erase(held);
}

void ClipDetector::Look(const cv::Mat& bgr, int frame) {
  for (const TrackedPerson& found : tracker_.Next(bgr, frame)) {
    Person& person = persons_[found.id];
    AddSample(found.pose, frame, &person);
    person.size += std::pow(found.pose.refined.size_px, 2);
  }
  looks_.push_back(frame);
  if (looks_.size() >= 3) LookBetween(looks_.size() - 3);
}

void ClipDetector::Add(const cv::Mat& bgr) {
  const Detections2d& clip = result_.detections2d;
  if (bgr.type() != CV_8UC3 || bgr.cols != clip.width || bgr.rows != clip.height) {
    throw Error(ErrorCode::kInvalidArgument, fmt::format("frame {} is no BGR picture of {}x{}",
                                                         num_frames_, clip.width, clip.height));
  }
  const int frame = num_frames_++;
  if (frame % result_.every == 0) {
    last_.release();
    Look(bgr, frame);
  } else {
    last_ = bgr.clone();
    if (frame % between_ == 0) held_[frame] = last_;
  }
}

ClipDetector::Person& ClipDetector::Choose() {
  std::vector<Person*> persons;
  for (auto& [id, person] : persons_) persons.push_back(&person);
  if (persons.empty()) throw Error(ErrorCode::kMismatch, "no person was found in any frame");
  if (options_.at) {
    int first = std::numeric_limits<int>::max();
    for (const Person* person : persons) first = std::min(first, person->samples.begin()->first);
    Person* nearest = nullptr;
    double best = kMaxAtDistance;
    for (Person* person : persons) {
      const Sample& sample = person->samples.begin()->second;
      const double distance = (sample.region.center - *options_.at).norm() / sample.region.size_px;
      if (sample.frame > first || distance >= best) continue;
      best = distance;
      nearest = person;
    }
    if (nearest != nullptr) return *nearest;
    throw Error(ErrorCode::kMismatch, fmt::format("nobody is at {:g}, {:g} in frame {}",
                                                  options_.at->x(), options_.at->y(), first));
  }
  if (static_cast<size_t>(options_.person) > persons.size()) {
    throw Error(ErrorCode::kMismatch, fmt::format("person {} was asked for, {} were found",
                                                  options_.person, persons.size()));
  }
  std::stable_sort(persons.begin(), persons.end(),
                   [](const Person* a, const Person* b) { return a->size > b->size; });
  return *persons[static_cast<size_t>(options_.person - 1)];
}

ClipDetections ClipDetector::Finish() {
  if (!last_.empty()) Look(last_, num_frames_ - 1);
  if (looks_.size() >= 2) LookBetween(looks_.size() - 2);
  Person& person = Choose();
  std::vector<Sample> samples;
  for (auto& [frame, sample] : person.samples) samples.push_back(std::move(sample));
  result_.num_persons = static_cast<int>(persons_.size());
  result_.num_looks = static_cast<int>(looks_.size()) + person.num_between;
  result_.num_seen = static_cast<int>(samples.size());
  const auto num_frames = static_cast<size_t>(num_frames_);
  const auto num_joints = static_cast<Eigen::Index>(BlazePoseJoints().size());
  Detections2d& clip2d = result_.detections2d;
  Detections3d& clip3d = result_.detections3d;
  clip2d.joints = clip3d.joints = BlazePoseJoints();
  clip3d.ray_aligned = true;
  const Eigen::VectorXd unseen = Eigen::VectorXd::Zero(num_joints);
  clip2d.frames.assign(num_frames, {Eigen::Matrix2Xd::Zero(2, num_joints), unseen});
  clip3d.frames.assign(num_frames, {Eigen::Matrix3Xd::Zero(3, num_joints), unseen});

  const auto step = [&](size_t i) { return samples[i + 1].frame - samples[i].frame; };
  // The person was not seen at a regular look in between.
  const auto is_gap = [&](size_t i) {
    return samples[i].frame / result_.every < (samples[i + 1].frame - 1) / result_.every;
  };
  // Change per frame at sample i, from those before and after it.
  const auto slope = [&](size_t i, const auto& value) {
    const size_t a = i > 0 && !is_gap(i - 1) ? i - 1 : i;
    const size_t b = i + 1 < samples.size() && !is_gap(i) ? i + 1 : i;
    const int frames = std::max(1, samples[b].frame - samples[a].frame);
    return ((value(samples[b]) - value(samples[a])) / frames).eval();
  };
  const auto pixels = [](const Sample& sample) -> const auto& { return sample.joints2d.pixels; };
  const auto world = [](const Sample& sample) -> const auto& { return sample.joints3d.positions; };
  for (size_t i = 0; i < samples.size(); ++i) {
    const Sample& sample = samples[i];
    const auto frame = static_cast<size_t>(sample.frame);
    clip2d.frames[frame] = sample.joints2d;
    clip3d.frames[frame] = sample.joints3d;
    result_.masks.push_back(sample.mask);
    if (i + 1 == samples.size() || is_gap(i)) continue;
    const Sample& next = samples[i + 1];
    for (int k = 1; k < step(i); ++k) {
      const double t = static_cast<double>(k) / step(i);
      Detections2d::Frame& frame2d = clip2d.frames[frame + static_cast<size_t>(k)];
      Detections3d::Frame& frame3d = clip3d.frames[frame + static_cast<size_t>(k)];
      frame2d.pixels = Cubic<Eigen::Matrix2Xd>(pixels(sample), pixels(next), slope(i, pixels),
                                               slope(i + 1, pixels), step(i), t);
      frame3d.positions = Cubic<Eigen::Matrix3Xd>(world(sample), world(next), slope(i, world),
                                                  slope(i + 1, world), step(i), t);
      frame2d.confidence = frame3d.confidence =
          sample.joints2d.confidence.cwiseMin(next.joints2d.confidence);
    }
  }
  return std::move(result_);
}

}  // namespace mpc
