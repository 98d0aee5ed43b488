// Purpose: what a video file says about the lens it was filmed with.
// Source: QuickTime File Format, "Metadata"; Apple's key
// com.apple.quicktime.camera.focal_length.35mm_equivalent, which iPhones write. Android's cameras
// write nothing of the kind. Units: millimetres, pixels.
#pragma once

#include <filesystem>
#include <optional>

namespace mpc {

// The 35 mm equivalent of the focal length in a .mov or .mp4 file, mm: that of the whole file, or of
// its first track that has one. Nothing for any other file, for a broken one (VideoReader finds what
// is wrong with it), and for values outside of 4 to 1000. Reads the file's index only.
std::optional<double> ReadFocalLength35mm(const std::filesystem::path& video);

// The focal length in a video, px, of a camera whose photos have the 35 mm equivalent `focal_35mm`:
// equivalents compare diagonals, photos are 4:3, and a video shows the photo's longer side. A
// camera that crops the picture to steady it has a longer one.
double FocalPxFrom35mm(double focal_35mm, int width, int height);

}  // namespace mpc
