#include "mpc/seg/silhouette.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "colour_odds.h"
#include "mpc/core/error.h"
#include "mpc/seg/background_motion.h"
#include "mpc/seg/grid_cut.h"
#include "mpc/seg/mask_bounds.h"
#include "picture.h"
#include "shape_odds.h"
#include "strays.h"
#include "unknown_pixels.h"

namespace mpc {
namespace {

constexpr double kRing = 0.15;          // width of the background outside the band, in actor sizes
constexpr double kColourErosion = 0.7;  // of `erode`: where the actor's colours are learnt
constexpr double kRimErosion = 0.1;     // the same once M is refined: the rim is often in the shade
constexpr double kPiece = 0.04;    // half as thick, in actor sizes: a piece of M that is elsewhere
constexpr int kRefinePx = 2;       // around the outline, after each doubling of the size
constexpr int kMaxColours = 4000;  // per colour model
constexpr double kErrorReach = 0.15;   // M's error is measured over so many actor sizes
constexpr double kSharpModel = 0.005;  // M is good when it is off by less, actor sizes; ours
constexpr double kRoughBandPx = 10;    // in wider bands half the size measures that error; ours
constexpr float kSureOdds = 2;
constexpr size_t kMinColours = 8;
constexpr double kOutlierShare = 0.02;
constexpr double kMinProbability = 0.02;  // a person mask is never surer than this
constexpr double kMinConfidence = 0.03;   // below, colours say nothing
constexpr double kMinModelIou = 0.25;     // a cut that agrees less with the model is no silhouette
constexpr double kMinIsland = 0.01;       // of the model's area
constexpr double kMaxHole = 0.0025;

// 255 where at least half of the pixels under a pixel of the smaller mask are set.
cv::Mat SmallMask(const cv::Mat& mask, const cv::Size& size) {
  cv::Mat full = mask != 0;
  if (full.size() == size) return full;
  cv::Mat small;
  cv::resize(full, small, size, 0, 0, cv::INTER_AREA);
  return small > 127;
}

// Removes pieces of the actor without a certain pixel that are small, and fills small holes.
void RemoveSpecks(const cv::Mat& trimap, double model_area, cv::Mat* labels) {
  std::vector<std::vector<cv::Point>> outlines;
  std::vector<cv::Vec4i> tree;  // per outline the next, previous, first inner and outer one
  cv::findContours(*labels, outlines, tree, cv::RETR_CCOMP, cv::CHAIN_APPROX_NONE);
  for (const bool inside : {true, false}) {
    const TrimapLabel certain = inside ? kTrimapForeground : kTrimapBackground;
    const double small = (inside ? kMinIsland : kMaxHole) * model_area;
    for (size_t i = 0; i < outlines.size(); ++i) {
      const bool is_hole = tree[i][3] >= 0;
      // A hole's outline, on the pixels around it, has at most about twice its area within.
      if (is_hole == inside || cv::contourArea(outlines[i]) > 2 * small) continue;
      const cv::Rect box = cv::boundingRect(outlines[i]);
      cv::Mat piece = (*labels)(box);
      cv::Mat filled(box.size(), CV_8U, cv::Scalar(0));
      cv::fillPoly(filled, outlines[i], 255, cv::LINE_8, 0, -box.tl());
      filled &= piece == (inside ? 1 : 0);
      if (cv::countNonZero(filled) >= small) continue;
      if (cv::countNonZero(filled & (trimap(box) == certain)) > 0) continue;
      piece.setTo(inside ? 0 : 1, filled);
    }
  }
}

// Of what is above 0; cv::minMaxLoc in a tenth of its time.
float Largest(const cv::Mat1f& values) {
  float largest = 0;
  for (int y = 0; y < values.rows; ++y) {
    largest = std::max(largest, Eigen::ArrayXf::Map(values[y], values.cols).maxCoeff());
  }
  return largest;
}

double Iou(const cv::Mat& a, const cv::Mat& b) {
  const int both = cv::countNonZero(a & b);
  const int any = cv::countNonZero(a | b);
  return any > 0 ? static_cast<double>(both) / any : 0;
}

void CheckFrame(const FrameInput& frame) {
  CheckPicture(frame.picture, "picture");
  const cv::Size size = frame.picture.size();
  CheckMask(frame.model_mask, size, "model mask");
  if (!frame.skeleton_mask.empty()) CheckMask(frame.skeleton_mask, size, "skeleton mask");
  const auto check_neighbour = [&](const cv::Mat& picture, const char* name) {
    if (picture.empty()) return;
    CheckPicture(picture, fmt::format("{} picture", name).c_str());
    if (picture.size() != size) {
      throw Error(ErrorCode::kMismatch,
                  fmt::format("segmentation: {} picture is {}x{}, expected {}x{}", name,
                              picture.cols, picture.rows, size.width, size.height));
    }
  };
  check_neighbour(frame.previous, "previous");
  check_neighbour(frame.next, "next");
  if (!frame.earlier.empty()) CheckMask(frame.earlier, size, "earlier silhouette");
  const BackgroundPlate& plate = frame.background;
  if (!plate.empty() && (plate.picture.size() != size || plate.picture.type() != CV_8UC3 ||
                         plate.spread.size() != size || plate.spread.type() != CV_8UC1)) {
    throw Error(
        ErrorCode::kMismatch,
        fmt::format("segmentation: background plate is {}x{} {}, expected {}x{} CV_8UC3 with "
                    "a spread of CV_8UC1",
                    plate.picture.cols, plate.picture.rows, cv::typeToString(plate.picture.type()),
                    size.width, size.height));
  }
  const cv::Mat& person = frame.person_probability;
  if (!person.empty() &&
      (person.size() != size || (person.type() != CV_32FC1 && person.type() != CV_8UC1))) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("segmentation: person probability is {}x{} {}, expected {}x{} CV_8UC1 "
                            "or CV_32FC1",
                            person.cols, person.rows, cv::typeToString(person.type()), size.width,
                            size.height));
  }
  if (!(frame.actor_size_px >= 0 && frame.actor_size_px < 1e6)) {
    throw Error(
        ErrorCode::kInvalidArgument,
        fmt::format("segmentation: actor size is {} px, expected 0 to 1e6", frame.actor_size_px));
  }
}

// One extraction. "Small" is the size at which the band is cut: 1 / 2^num_halvings_ of the crop.
class Extraction {
 public:
  Extraction(const FrameInput& frame, const SegmentationOptions& options)
      : frame_(frame), options_(options) {}

  Silhouette Run() {
    const cv::Rect box = MaskBounds(frame_.model_mask);
    if (box.empty()) {
      result_.mask = cv::Mat(frame_.picture.size(), CV_8U, cv::Scalar(0));
      return result_;
    }
    PlaceCrop(box);
    ShrinkPictures();
    MakeBand();
    FindChange();
    AddEvidence();
    if (!Cut()) return UseModel(SilhouetteState::kNoBackground, box);
    if (result_.confidence < kMinConfidence) return UseModel(SilhouetteState::kAmbiguous, box);
    for (int level = num_halvings_ - 1; level >= 0; --level) Refine(level);

    result_.state = SilhouetteState::kCut;
    const cv::Mat inside = labels_(cv::Rect({}, result_.roi.size())) != 0;
    result_.model_iou = Iou(inside, frame_.model_mask(result_.roi) != 0);
    if (result_.model_iou < kMinModelIou) return UseModel(SilhouetteState::kAmbiguous, box);
    result_.mask = cv::Mat(frame_.picture.size(), CV_8U, cv::Scalar(0));
    inside.copyTo(result_.mask(result_.roi));
    return result_;
  }

 private:
  const cv::Mat& small() const { return pictures_.back(); }
  double small_size() const { return std::ldexp(actor_size_, -num_halvings_); }  // of the actor

  Silhouette UseModel(SilhouetteState state, const cv::Rect& box) {
    result_.state = state;
    result_.mask = frame_.model_mask != 0;
    result_.roi = box;
    result_.model_iou = 1;
    return result_;
  }

  // The actor's surroundings, a whole number of small pixels in width and height.
  void PlaceCrop(const cv::Rect& box) {
    actor_size_ =
        frame_.actor_size_px > 0 ? frame_.actor_size_px : ActorSizePx(frame_.model_mask(box));
    const cv::Size size = frame_.picture.size();
    const double reach = std::ceil((options_.dilate + kRing) * actor_size_) + 2;
    const int margin = static_cast<int>(std::min<double>(reach, std::max(size.width, size.height)));
    crop_ = Grown(box, margin, size);
    if (options_.max_cut_size_px > 0) {
      const double cut_size = std::min(actor_size_, std::sqrt(1.0 * crop_.area()));
      while (std::ldexp(cut_size, -num_halvings_) > options_.max_cut_size_px) {
        ++num_halvings_;
      }
    }
    const int block = 1 << num_halvings_;
    crop_.width = (crop_.width + block - 1) / block * block;
    crop_.height = (crop_.height + block - 1) / block * block;
    crop_.x = std::max(0, std::min(crop_.x, size.width - crop_.width));
    crop_.y = std::max(0, std::min(crop_.y, size.height - crop_.height));
    result_.roi = crop_ & cv::Rect({}, size);
  }

  void ShrinkPictures() {
    pictures_.push_back(ToBgr8(Crop(frame_.picture, crop_)));
    for (int i = 0; i < num_halvings_; ++i) pictures_.push_back(Halved(pictures_.back()));
    if (!frame_.background.empty() && options_.weight_plate > 0) {
      plates_.push_back(
          {Crop(frame_.background.picture, crop_), Crop(frame_.background.spread, crop_)});
      for (int i = 0; i < num_halvings_; ++i) {
        plates_.push_back({Halved(plates_.back().picture), Halved(plates_.back().spread)});
      }
    }
    model_ = SmallMask(Crop(frame_.model_mask, crop_), small().size());
  }

  // Trimap (Eq. 9), regions to learn from, and the log-odds that the shape of M gives.
  void MakeBand() {
    const cv::Size size = small().size();
    cv::Mat skeleton(size, CV_8U, cv::Scalar(0));
    if (!frame_.skeleton_mask.empty()) {
      skeleton = SmallMask(Crop(frame_.skeleton_mask, crop_), size);
      if (options_.clip_skeleton) skeleton &= model_;
    }
    cv::Mat earlier;
    if (options_.keep_earlier && !frame_.earlier.empty()) {
      earlier = SmallMask(Crop(frame_.earlier, crop_), size);
    }
    const cv::Mat actor = earlier.empty() ? model_ : cv::Mat(model_ | earlier);
    Strays strays;
    if (!earlier.empty() && !plates_.empty()) {
      strays =
          FindStrays(small(), plates_.back(), actor, options_.erode * small_size(), small_size());
      if (!strays.beyond.empty()) actor |= strays.beyond;  // not M's own memory
    }
    const auto dilate = static_cast<float>(options_.dilate * small_size());
    near_ = Grown(MaskBounds(actor | skeleton), static_cast<int>(dilate) + 2, size);
    const auto far = static_cast<float>(size.width + size.height);
    const auto distance_to = [&](const cv::Mat& mask) {
      cv::Mat1f distance(size, -far);
      SignedDistance(mask(near_)).copyTo(distance(near_));
      return distance;
    };
    distance_ = distance_to(model_);
    const double deepest = Largest(distance_(near_));
    // Something of a thin actor stays, or there would be no certain foreground.
    const auto erode = static_cast<float>(std::min(options_.erode * small_size(), 0.7 * deepest));
    cv::Mat1f to_actor = distance_;  // to the outline of M and what was cut before
    cv::Mat1f inner = distance_;     // to that of M without pieces that are elsewhere
    if (!earlier.empty()) {
      cv::Mat1f outside;
      cv::distanceTransform(~actor(near_), outside, cv::DIST_L2, cv::DIST_MASK_5);
      to_actor = cv::Mat1f(size, -far);
      cv::Mat(0.5 - outside).copyTo(to_actor(near_));
      cv::Mat pieces = Thick(model_ & ~earlier, kPiece * small_size());
      if (!strays.within.empty()) pieces |= strays.within & model_ & ~skeleton;
      if (cv::countNonZero(pieces) > 0) inner = distance_to(model_ & ~pieces);
    }
    trimap_ = cv::Mat(size, CV_8U, cv::Scalar(kTrimapBackground));
    const auto weight = static_cast<float>(options_.weight_shape);
    shape_ = cv::Mat1f(size, -weight);
    for (int y = near_.y; y < near_.br().y; ++y) {
      const float *d = distance_[y], *in = inner[y];
      const uint8_t* is_skeleton = skeleton.ptr(y);
      uint8_t* trimap = trimap_.ptr(y);
      float* shape = shape_[y];
      for (int x = near_.x; x < near_.br().x; ++x) {
        if (in[x] > erode || is_skeleton[x]) {
          trimap[x] = kTrimapForeground;
        } else if (d[x] > 0) {
          trimap[x] = kTrimapUnknownForeground;
        } else {
          trimap[x] = to_actor(y, x) < -dilate ? kTrimapBackground : kTrimapUnknownBackground;
        }
        shape[x] = weight * (d[x] > 0 ? std::clamp(in[x] / erode, 0.F, 1.F)
                                      : std::clamp(to_actor(y, x) / dilate, -1.F, 0.F));
      }
    }
    if (options_.band_colours) {
      const double depth = (earlier.empty() ? kColourErosion : kRimErosion) * erode;
      actor_region_ = (inner > depth) | (trimap_ == kTrimapForeground);
      background_region_ = trimap_ == kTrimapBackground;
    } else {
      actor_region_ = model_ | (trimap_ == kTrimapForeground);
      background_region_ = ~actor_region_;
    }
  }

  // Change since the previous picture and until the next, whichever is less, with the background's motion
  // taken out: what the actor has just left, or will cover next, is still on one side.
  void FindChange() {
    if (options_.gamma_motion == 0 && options_.weight_still == 0) return;
    std::optional<BackgroundPoints> background;
    const auto compare = [&](const cv::Mat& other, const std::optional<cv::Matx33d>& known,
                             std::optional<cv::Matx33d>* used) {
      if (other.empty()) return;
      const cv::Matx33d motion = known ? *known : MotionTo(other, &background);
      *used = motion;
      result_.camera_motion |= motion != cv::Matx33d::eye();
      const cv::Mat change = SquaredChange(small(), Displaced(other, motion));
      change_ = result_.motion_cue ? cv::Mat(cv::min(change_, change)) : change;
      result_.motion_cue = true;
    };
    compare(frame_.previous, frame_.previous_from_current, &result_.previous_from_current);
    if (result_.motion_cue && !options_.look_ahead) return;
    compare(frame_.next, frame_.next_from_current, &result_.next_from_current);
  }

  // Of the background, from this picture to another; none where it is not seen.
  cv::Matx33d MotionTo(const cv::Mat& other, std::optional<BackgroundPoints>* background) const {
    if (!options_.estimate_background_motion) return cv::Matx33d::eye();
    if (!*background) {
      cv::Mat exclude(frame_.picture.size(), CV_8U, cv::Scalar(0));
      cv::Mat near = trimap_ != kTrimapBackground;
      cv::resize(near, near, crop_.size(), 0, 0, cv::INTER_NEAREST);
      near(cv::Rect({}, result_.roi.size())).copyTo(exclude(result_.roi));
      background->emplace(frame_.picture, exclude);
    }
    return (*background)->MotionTo(other).value_or(cv::Matx33d::eye());
  }

  // Another picture's crop at the small size, as if its background were where this picture's is.
  cv::Mat Displaced(const cv::Mat& other, const cv::Matx33d& motion) const {
    cv::Mat displaced;
    if (motion == cv::Matx33d::eye()) {
      displaced = ToBgr8(Crop(other, crop_));
      for (int i = 0; i < num_halvings_; ++i) displaced = Halved(displaced);
      return displaced;
    }
    // From small pixels of the crop to the picture's, centre to centre, then to the other's.
    const double block = 1 << num_halvings_;
    const double centre = (block - 1) / 2;
    const cv::Matx33d picture_from_small(block, 0, crop_.x + centre, 0, block, crop_.y + centre, 0,
                                         0, 1);
    cv::warpPerspective(ToBgr8(other), displaced, motion * picture_from_small, small().size(),
                        cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
    return displaced;
  }

  void AddEvidence() {
    evidence_ = cv::Mat1f(small().size(), 0.F);
    if (result_.motion_cue && options_.weight_still > 0) {
      const StillnessOdds still(change_, actor_region_, background_region_);
      const auto weight = static_cast<float>(options_.weight_still);
      for (int y = near_.y; y < near_.br().y; ++y) {
        const uint16_t* change = change_.ptr<uint16_t>(y);
        float* evidence = evidence_[y];
        for (int x = near_.x; x < near_.br().x; ++x) evidence[x] += weight * still(change[x]);
      }
    }
    if (!frame_.person_probability.empty() && options_.weight_person > 0) {
      const cv::Mat full = Crop(frame_.person_probability, crop_);
      cv::Mat1f probability;
      full.convertTo(probability, CV_32F, full.depth() == CV_8U ? 1.0 / 255 : 1.0);
      cv::resize(probability, probability, small().size(), 0, 0, cv::INTER_AREA);
      for (int y = 0; y < evidence_.rows; ++y) {
        for (int x = 0; x < evidence_.cols; ++x) {
          // Also for values that are not numbers: those say nothing.
          const double p =
              probability(y, x) >= 0
                  ? std::clamp<double>(probability(y, x), kMinProbability, 1 - kMinProbability)
                  : 0.5;
          evidence_(y, x) += static_cast<float>(options_.weight_person * std::log(p / (1 - p)));
        }
      }
    }
  }

  GridCutProblem Problem(const cv::Mat& bgr) const {
    GridCutProblem problem;
    problem.bgr = bgr;
    problem.gamma = options_.gamma;
    problem.beta = ContrastBeta(bgr, options_.eight_connected);
    if (result_.motion_cue) {
      problem.gamma_motion = options_.gamma_motion;
      problem.beta_motion = 1 / (2 * std::max(3 * cv::mean(change_)[0], 1.0));
    }
    problem.eight_connected = options_.eight_connected;
    problem.log_odds = cv::Mat1f(bgr.size(), 0.F);
    return problem;
  }

  // Rounds of colour models and cut at the small size. False when there is nothing to learn from.
  bool Cut() {
    GridCutProblem problem = Problem(small());
    problem.change = change_;
    problem.trimap = trimap_;
    for (int round = 0; round < options_.num_rounds; ++round) {
      const cv::Mat& actor = round == 0 ? actor_region_ : labels_;
      const cv::Mat background = round == 0 ? background_region_ : cv::Mat(labels_ == 0);
      const PlacedColours actor_colours = CollectColours(small(), actor, kMaxColours);
      const PlacedColours other_colours = CollectColours(small(), background, kMaxColours);
      if (std::min(actor_colours.colours.size(), other_colours.colours.size()) < kMinColours) {
        return false;
      }
      const double reach = options_.colour_reach * small_size();
      actor_model_.emplace(actor_colours, options_.num_components, small().size(), reach);
      background_model_.emplace(other_colours, options_.num_components, small().size(), reach);
      colour_odds_.emplace(*actor_model_, *background_model_,
                           options_.band_colours ? kOutlierShare : 0,
                           /*exact=*/options_.max_cut_size_px == 0);
      ReadColours();
      if (options_.weight_measured > 0 && !frame_.earlier.empty()) {
        // To measure M's error by, the earlier silhouette will do.
        labels_ = SmallMask(Crop(frame_.earlier, crop_), small().size()) & 1;
        continue;
      }
      SetLogOdds(0, {}, &problem);
      const bool only_measures = options_.weight_measured > 0 && round + 1 == options_.num_rounds;
      const bool rough = only_measures && options_.dilate * small_size() > kRoughBandPx;
      labels_ = rough ? RoughLabels(problem) : SolveGridCut(problem).labels;
    }
    if (options_.weight_measured > 0) {
      const cv::Mat1f precision =
          MeasurePrecision(distance_, labels_, PicturesCertainty(), kErrorReach * small_size());
      const cv::Mat1f distance = distance_(near_), near_precision = precision(near_);
      shape_(near_) += options_.weight_measured * OutlineOdds(distance, near_precision);
      problem.strength = cv::Mat1f(labels_.size(), 1.F);
      OutlineStrength(distance, near_precision, options_.outline_discount,
                      kSharpModel * small_size())
          .copyTo(problem.strength(near_));
      SetLogOdds(0, {}, &problem);
      labels_ = SolveGridCut(problem).labels;
    }
    if (options_.clean) RemoveSpecks(trimap_, cv::countNonZero(model_), &labels_);
    MeasureConfidence();
    return true;
  }

  // Of the small size's problem at half of it: enough to measure M's error by.
  cv::Mat RoughLabels(const GridCutProblem& fine) const {
    GridCutProblem problem = Problem(Halved(fine.bgr));
    const cv::Size size = problem.bgr.size();
    cv::resize(fine.trimap, problem.trimap, size, 0, 0, cv::INTER_NEAREST);
    cv::resize(4 * fine.log_odds, problem.log_odds, size, 0, 0, cv::INTER_AREA);
    if (!fine.change.empty()) {
      cv::resize(fine.change, problem.change, size, 0, 0, cv::INTER_AREA);
    }
    cv::Mat labels;
    cv::resize(SolveGridCut(problem).labels, labels, fine.bgr.size(), 0, 0, cv::INTER_NEAREST);
    return labels;
  }

  // 255 where something else than its place tells a pixel's label.
  cv::Mat PicturesCertainty() {
    cv::Mat sure(labels_.size(), CV_8U, cv::Scalar(0));
    for (int y = 0; y < sure.rows; ++y) {
      const float *evidence = evidence_[y], *colours = colours_[y];
      const uint8_t* labels = labels_.ptr(y);
      uint8_t* out = sure.ptr(y);
      ForEachUnknown(trimap_.ptr(y), sure.cols, [&](int x) {
        const float odds = evidence[x] + colours[x];
        if ((labels[x] ? odds : -odds) > kSureOdds) out[x] = 255;
      });
    }
    return sure;
  }

  // What the colours of the small size's unknown pixels say.
  void ReadColours() {
    colours_.create(small().size());
    for (int y = 0; y < colours_.rows; ++y) {
      const auto* bgr = small().ptr<cv::Vec3b>(y);
      float* colours = colours_[y];
      ForEachUnknown(trimap_.ptr(y), colours_.cols, [&](int x) {
        colours[x] = ColoursOdds(bgr[x], 0, {x, y});
      });
    }
  }

  // All log-odds of the unknown pixels of a picture 2^shift times the small one, offset by `at`.
  void SetLogOdds(int shift, const cv::Point& at, GridCutProblem* problem) {
    for (int y = 0; y < problem->bgr.rows; ++y) {
      const auto* bgr = problem->bgr.ptr<cv::Vec3b>(y);
      const int row = (y + at.y) >> shift;
      const float *shape = shape_[row], *evidence = evidence_[row], *colours = colours_[row];
      float* odds = problem->log_odds.ptr<float>(y);
      ForEachUnknown(problem->trimap.ptr(y), problem->bgr.cols, [&](int x) {
        const int i = (x + at.x) >> shift;
        odds[x] = shape[i] + evidence[i] +
                  (shift == 0 ? colours[i] : ColoursOdds(bgr[x], shift, {x + at.x, y + at.y}));
      });
    }
  }

  // Log-odds of a colour at a pixel of the picture 2^shift times the small one.
  float ColoursOdds(const cv::Vec3b& bgr, int shift, const cv::Point& at) {
    float density = -1;
    if (!plates_.empty()) {
      const BackgroundPlate& plate = plates_[static_cast<size_t>(num_halvings_ - shift)];
      const uint8_t spread = plate.spread.ptr(at.y)[at.x];
      if (spread != BackgroundPlate::kUnknown) {
        density = PlateDensity(bgr, plate.picture.ptr<cv::Vec3b>(at.y)[at.x], spread);
      }
    }
    return (*colour_odds_)(bgr, at.x >> shift, at.y >> shift, density,
                           static_cast<float>(options_.weight_plate));
  }

  // How much of the unknown band something else than its place decides, and as the cut did.
  void MeasureConfidence() {
    double agreement = 0;
    int num_unknown = 0;
    for (int y = 0; y < trimap_.rows; ++y) {
      const float *evidence = evidence_[y], *colours = colours_[y];
      const uint8_t* labels = labels_.ptr(y);
      ForEachUnknown(trimap_.ptr(y), trimap_.cols, [&](int x) {
        const float odds = evidence[x] + colours[x];
        agreement += std::clamp(labels[x] ? odds : -odds, 0.F, 3.F) / 3;
        ++num_unknown;
      });
    }
    result_.confidence = num_unknown > 0 ? agreement / num_unknown : 0;
  }

  // Doubles the labels' size and cuts again around the outline.
  void Refine(int level) {
    const cv::Mat& bgr = pictures_[static_cast<size_t>(level)];
    cv::resize(labels_, labels_, bgr.size(), 0, 0, cv::INTER_NEAREST);
    const cv::Rect area = Grown(MaskBounds(labels_), kRefinePx + 1, bgr.size());
    if (area.empty()) return;
    const cv::Mat guess = labels_(area);
    cv::Mat most, least;
    const cv::Mat element =
        cv::getStructuringElement(cv::MORPH_RECT, {2 * kRefinePx + 1, 2 * kRefinePx + 1});
    cv::dilate(guess, most, element);
    cv::erode(guess, least, element);
    GridCutProblem problem = Problem(bgr(area));
    // 1 where all pixels around are inside, 0 where none is, else unknown.
    problem.trimap = least + kTrimapUnknownBackground * (most - least);
    const int shift = num_halvings_ - level;
    if (result_.motion_cue) {
      problem.change.create(area.size(), CV_16U);
      for (int y = 0; y < area.height; ++y) {
        const uint16_t* change = change_.ptr<uint16_t>((y + area.y) >> shift);
        uint16_t* out = problem.change.ptr<uint16_t>(y);
        for (int x = 0; x < area.width; ++x) out[x] = change[(x + area.x) >> shift];
      }
    }
    SetLogOdds(shift, area.tl(), &problem);
    SolveGridCut(problem).labels.copyTo(guess);
  }

  const FrameInput& frame_;
  const SegmentationOptions& options_;
  Silhouette result_;

  double actor_size_ = 0;  // at full size
  int num_halvings_ = 0;
  cv::Rect crop_;                        // may reach over the picture's right and lower border
  std::vector<cv::Mat> pictures_;        // the crop, each half the size of the one before
  std::vector<BackgroundPlate> plates_;  // of pictures_; empty: the background is not known

  // At the small size.
  cv::Mat model_;
  cv::Rect near_;       // beyond, all is certain background
  cv::Mat1f distance_;  // to the outline of M, in near_
  cv::Mat trimap_;
  cv::Mat actor_region_;
  cv::Mat background_region_;
  cv::Mat1f shape_;     // log-odds from the shape of M
  cv::Mat1f evidence_;  // log-odds from stillness and the caller's probability
  cv::Mat change_;      // least SquaredChange; empty: no motion cue
  cv::Mat1f colours_;   // log-odds of the unknown pixels' colours
  cv::Mat labels_;      // 1 inside; grows to full size

  std::optional<LocalColourModel> actor_model_;
  std::optional<LocalColourModel> background_model_;
  std::optional<ColourOdds> colour_odds_;
};

}  // namespace

Silhouette ExtractSilhouette(const FrameInput& frame, const SegmentationOptions& options) {
  options.Validate();
  CheckFrame(frame);
  return Extraction(frame, options).Run();
}

Silhouette SilhouetteFromMask(const cv::Mat& mask, const cv::Size& picture_size) {
  CheckPicture(mask, "external mask");
  cv::Mat grey = mask;
  if (mask.channels() > 1) cv::cvtColor(ToBgr8(mask), grey, cv::COLOR_BGR2GRAY);
  CheckMask(grey, picture_size, "external mask");
  double largest = 0;
  cv::minMaxLoc(grey, nullptr, &largest);
  Silhouette result;
  result.mask = grey > (largest > 127 ? 127 : 0);
  result.roi = MaskBounds(result.mask);
  result.state = SilhouetteState::kExternal;
  result.confidence = 1;
  return result;
}

}  // namespace mpc
