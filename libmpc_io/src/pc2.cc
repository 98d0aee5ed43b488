#include "mpc/io/pc2.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>

#include "mpc/core/error.h"
#include "mpc/io/atomic_file.h"

namespace mpc {
namespace {

static_assert(std::endian::native == std::endian::little, "PC2 is written in native byte order");

constexpr std::array<char, 12> kMagic = {'P', 'O', 'I', 'N', 'T', 'C',
                                         'A', 'C', 'H', 'E', '2', '\0'};
constexpr std::uint64_t kHeaderBytes = 32;

struct Pc2Header {
  std::int32_t version = 1;
  std::int32_t num_vertices = 0;
  float first_frame = 0;
  float frames_per_sample = 1;
  std::int32_t num_frames = 0;
};
static_assert(sizeof(Pc2Header) + kMagic.size() == kHeaderBytes);

std::uint64_t FrameBytes(int num_vertices) {
  return 3 * sizeof(float) * static_cast<std::uint64_t>(num_vertices);
}

}  // namespace

struct Pc2Writer::Impl {
  explicit Impl(const std::filesystem::path& target) : path(target), file(target) {}

  void Check() const {
    if (stream) return;
    throw Error(ErrorCode::kWriteFailed, fmt::format("{}: cannot be written after {} frames",
                                                     path.string(), header.num_frames));
  }
  void WriteHeader() {
    stream.seekp(0);
    stream.write(kMagic.data(), kMagic.size());
    stream.write(reinterpret_cast<const char*>(&header), sizeof(header));
    Check();
  }

  std::filesystem::path path;
  AtomicFile file;
  std::ofstream stream;
  Pc2Header header;
};

Pc2Writer::Pc2Writer(const std::filesystem::path& path, int num_vertices)
    : impl_(std::make_unique<Impl>(path)) {
  if (num_vertices < 1) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{}: {} vertices, at least one expected", path.string(), num_vertices));
  }
  impl_->header.num_vertices = num_vertices;
  impl_->stream.open(impl_->file.temporary(), std::ios::binary | std::ios::trunc);
  impl_->Check();
  impl_->WriteHeader();
}

Pc2Writer::~Pc2Writer() = default;
Pc2Writer::Pc2Writer(Pc2Writer&&) noexcept = default;
Pc2Writer& Pc2Writer::operator=(Pc2Writer&&) noexcept = default;

void Pc2Writer::Write(const Eigen::Matrix3Xf& positions) {
  Pc2Header& header = impl_->header;
  if (positions.cols() != header.num_vertices) {
    throw Error(ErrorCode::kMismatch,
                fmt::format("{}: frame {} has {} vertices, expected {}", impl_->path.string(),
                            header.num_frames, positions.cols(), header.num_vertices));
  }
  if (!positions.allFinite()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{}: frame {} has a position that is not finite", impl_->path.string(),
                            header.num_frames));
  }
  impl_->stream.write(reinterpret_cast<const char*>(positions.data()),
                      static_cast<std::streamsize>(FrameBytes(header.num_vertices)));
  impl_->Check();
  ++header.num_frames;
}

void Pc2Writer::Close() {
  impl_->WriteHeader();
  impl_->stream.close();
  impl_->Check();
  impl_->file.Commit();
}

struct Pc2Reader::Impl {
  std::filesystem::path path;
  std::ifstream stream;
  Pc2Header header;
};

Pc2Reader::Pc2Reader(const std::filesystem::path& path) : impl_(std::make_unique<Impl>()) {
  impl_->path = path;
  impl_->stream.open(path, std::ios::binary);
  std::error_code ec;
  const std::uintmax_t bytes = std::filesystem::file_size(path, ec);
  if (!impl_->stream || ec) {
    throw Error(ErrorCode::kFileNotFound, fmt::format("{}: cannot be opened", path.string()));
  }
  const auto fail = [&](const std::string& fault) {
    throw Error(ErrorCode::kBadFile, fmt::format("{}: {}", path.string(), fault));
  };
  std::array<char, kMagic.size()> magic{};
  Pc2Header& header = impl_->header;
  impl_->stream.read(magic.data(), magic.size());
  impl_->stream.read(reinterpret_cast<char*>(&header), sizeof(header));
  if (!impl_->stream || magic != kMagic) fail("is no PC2 point cache");
  if (header.version != 1) fail(fmt::format("has PC2 version {}, expected 1", header.version));
  if (header.num_vertices < 1 || header.num_frames < 0) {
    fail(fmt::format("says {} vertices and {} frames", header.num_vertices, header.num_frames));
  }
  // At most 2^31 * 12 * 2^31: fits.
  const std::uint64_t expected = kHeaderBytes + FrameBytes(header.num_vertices) *
                                                    static_cast<std::uint64_t>(header.num_frames);
  if (bytes != expected) {
    fail(fmt::format("has {} bytes, but {} vertices in {} frames take {}", bytes,
                     header.num_vertices, header.num_frames, expected));
  }
}

Pc2Reader::~Pc2Reader() = default;
Pc2Reader::Pc2Reader(Pc2Reader&&) noexcept = default;
Pc2Reader& Pc2Reader::operator=(Pc2Reader&&) noexcept = default;

int Pc2Reader::num_vertices() const { return impl_->header.num_vertices; }
int Pc2Reader::num_frames() const { return impl_->header.num_frames; }

void Pc2Reader::Read(int frame, Eigen::Matrix3Xf* positions) {
  if (frame < 0 || frame >= num_frames()) {
    throw Error(ErrorCode::kInvalidArgument,
                fmt::format("{}: no frame {} among {}", impl_->path.string(), frame, num_frames()));
  }
  positions->resize(3, num_vertices());
  const std::uint64_t bytes = FrameBytes(num_vertices());
  impl_->stream.clear();
  impl_->stream.seekg(
      static_cast<std::streamoff>(kHeaderBytes + static_cast<std::uint64_t>(frame) * bytes));
  impl_->stream.read(reinterpret_cast<char*>(positions->data()),
                     static_cast<std::streamsize>(bytes));
  if (!impl_->stream) {
    throw Error(ErrorCode::kBadFile,
                fmt::format("{}: frame {} cannot be read", impl_->path.string(), frame));
  }
  if (!positions->allFinite()) {
    throw Error(ErrorCode::kBadFile, fmt::format("{}: frame {} has a position that is not finite",
                                                 impl_->path.string(), frame));
  }
}

}  // namespace mpc
