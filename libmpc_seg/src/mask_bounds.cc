#include "mpc/seg/mask_bounds.h"

#include <cstdint>

#include "picture.h"
#include "pixel_block.h"

namespace mpc {
namespace {

// The first pixel of [begin, end) that is inside; end if none is.
int FirstInside(const uint8_t* row, int begin, int end) {
  while (begin + kBlock <= end && Block(row + begin) == 0) begin += kBlock;
  while (begin < end && row[begin] == 0) ++begin;
  return begin;
}

// The end of what is inside of [begin, end); begin if nothing is.
int EndInside(const uint8_t* row, int begin, int end) {
  while (begin + kBlock <= end && Block(row + end - kBlock) == 0) end -= kBlock;
  while (begin < end && row[end - 1] == 0) --end;
  return end;
}

}  // namespace

cv::Rect MaskBounds(const cv::Mat& mask) {
  CheckMask(mask, mask.size(), "mask");
  int top = 0, bottom = mask.rows;
  while (top < bottom && FirstInside(mask.ptr(top), 0, mask.cols) == mask.cols) ++top;
  while (top < bottom && FirstInside(mask.ptr(bottom - 1), 0, mask.cols) == mask.cols) --bottom;
  if (top == bottom) return {};
  int left = mask.cols, right = 0;
  for (int y = top; y < bottom; ++y) {
    left = FirstInside(mask.ptr(y), 0, left);
    right = EndInside(mask.ptr(y), right, mask.cols);
  }
  return {left, top, right - left, bottom - top};
}

cv::Rect Grown(const cv::Rect& box, int margin, const cv::Size& picture_size) {
  return cv::Rect(box.tl() - cv::Point(margin, margin),
                  box.size() + cv::Size(2 * margin, 2 * margin)) &
         cv::Rect({}, picture_size);
}

}  // namespace mpc
