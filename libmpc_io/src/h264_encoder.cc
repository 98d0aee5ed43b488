#include "h264_encoder.h"

#include <array>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

extern "C" {
#include <libavcodec/avcodec.h>
#include <libavformat/avformat.h>
#include <libavutil/imgutils.h>
#include <libavutil/opt.h>
}

namespace mpc {
namespace {

constexpr int kMaxDenominator = 1001000;  // 30000 / 1001 and the like come out exactly
constexpr int kSilent = 100;              // added to the level of messages: none is printed

struct Free {
  void operator()(AVCodecContext* p) const { avcodec_free_context(&p); }
  void operator()(AVFrame* p) const { av_frame_free(&p); }
  void operator()(AVPacket* p) const { av_packet_free(&p); }
  void operator()(AVFormatContext* p) const {
    avio_closep(&p->pb);
    avformat_free_context(p);
  }
};

// Not negative, or FFmpeg's words are thrown.
int Check(int result) {
  if (result >= 0) return result;
  char text[AV_ERROR_MAX_STRING_SIZE] = {};
  av_strerror(result, text, sizeof text);
  throw std::runtime_error(text);
}

template <typename T>
T* CheckMade(T* made) {
  if (made == nullptr) throw std::runtime_error("FFmpeg cannot write H.264 in .mp4");
  return made;
}

// U and V in video range of a BGR colour (BT.601, as OpenCV's own conversion).
const cv::Matx<float, 2, 4> kChromaOfBgr(0.439F, -0.291F, -0.148F, 128,  //
                                         -0.071F, -0.368F, 0.439F, 128);

// Planes that follow one another, as OpenCV has them.
void MakePlanes(AVFrame* frame) {
  const cv::Size size(frame->width, frame->height);
  av_buffer_unref(&frame->buf[0]);
  frame->buf[0] = CheckMade(av_buffer_alloc(static_cast<size_t>(size.area()) * 3 / 2));
  Check(av_image_fill_arrays(frame->data, frame->linesize, frame->buf[0]->data, AV_PIX_FMT_YUV420P,
                             size.width, size.height, 1));
}

AVFormatContext* MakeFormat(const std::string& path) {
  AVFormatContext* format = nullptr;
  Check(avformat_alloc_output_context2(&format, nullptr, "mp4", path.c_str()));
  return format;
}

}  // namespace

struct H264Encoder::Impl {
  std::unique_ptr<AVFormatContext, Free> format;
  std::unique_ptr<AVCodecContext, Free> codec;
  std::unique_ptr<AVFrame, Free> frame;
  std::unique_ptr<AVPacket, Free> packet;
  AVStream* stream = nullptr;  // the format's
  cv::Mat halved, chroma;

  void Encode(AVFrame* next) {
    Check(avcodec_send_frame(codec.get(), next));
    for (;;) {
      const int result = avcodec_receive_packet(codec.get(), packet.get());
      if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
      Check(result);
      packet->duration = 1;
      av_packet_rescale_ts(packet.get(), codec->time_base, stream->time_base);
      packet->stream_index = stream->index;
      Check(av_interleaved_write_frame(format.get(), packet.get()));
    }
  }
};

H264Encoder::H264Encoder(const std::string& path, int width, int height, double fps, bool fast)
    : impl_(new Impl) {
  impl_->format.reset(MakeFormat(path));
  AVFormatContext* format = impl_->format.get();
  const AVCodec* x264 = CheckMade(avcodec_find_encoder_by_name("libx264"));
  impl_->codec.reset(CheckMade(avcodec_alloc_context3(x264)));
  AVCodecContext* codec = impl_->codec.get();
  codec->log_level_offset = kSilent;
  codec->width = width;
  codec->height = height;
  codec->pix_fmt = AV_PIX_FMT_YUV420P;
  codec->framerate = av_d2q(fps, kMaxDenominator);
  codec->time_base = av_inv_q(codec->framerate);
  codec->max_b_frames = 0;
  codec->flags |= format->oformat->flags & AVFMT_GLOBALHEADER ? AV_CODEC_FLAG_GLOBAL_HEADER : 0;
  Check(av_opt_set(codec->priv_data, "preset", fast ? "ultrafast" : "superfast", 0));
  Check(av_opt_set(codec->priv_data, fast ? "qp" : "crf", "23", 0));
  Check(avcodec_open2(codec, x264, nullptr));

  impl_->stream = CheckMade(avformat_new_stream(format, nullptr));
  impl_->stream->time_base = codec->time_base;
  impl_->stream->avg_frame_rate = codec->framerate;
  Check(avcodec_parameters_from_context(impl_->stream->codecpar, codec));
  Check(avio_open(&format->pb, path.c_str(), AVIO_FLAG_WRITE));
  Check(avformat_write_header(format, nullptr));

  impl_->packet.reset(CheckMade(av_packet_alloc()));
  impl_->frame.reset(CheckMade(av_frame_alloc()));
  AVFrame* frame = impl_->frame.get();
  frame->format = codec->pix_fmt;
  frame->width = width;
  frame->height = height;
  frame->pts = -1;
}

H264Encoder::~H264Encoder() = default;

void H264Encoder::Write(const cv::Mat& picture) {
  AVFrame* frame = impl_->frame.get();
  if (av_frame_is_writable(frame) == 0) MakePlanes(frame);
  cv::Mat i420(frame->height * 3 / 2, frame->width, CV_8U, frame->data[0]);
  if (picture.channels() == 1) {
    cv::Mat luma = i420.rowRange(0, frame->height);
    picture.convertTo(luma, CV_8U, 219.0 / 255, 16);
    i420.rowRange(frame->height, i420.rows).setTo(128);
  } else {
    cv::cvtColor(picture, i420, cv::COLOR_BGR2YUV_I420);
    // OpenCV takes the chroma of each block's first pixel, which shows it half a pixel aside. The
    // mean of the block is what other encoders store.
    cv::resize(picture, impl_->halved, {frame->width / 2, frame->height / 2}, 0, 0, cv::INTER_AREA);
    cv::transform(impl_->halved, impl_->chroma, kChromaOfBgr);
    std::array<cv::Mat, 2> planes;
    for (size_t i = 0; i < 2; ++i) {
      planes[i] = cv::Mat(impl_->halved.size(), CV_8U, frame->data[i + 1]);
    }
    cv::split(impl_->chroma, planes.data());
  }
  ++frame->pts;
  impl_->Encode(frame);
}

void H264Encoder::Finish() {
  impl_->Encode(nullptr);
  AVFormatContext* format = impl_->format.get();
  Check(av_write_trailer(format));  // fails where any write before did
  Check(avio_closep(&format->pb));
}

}  // namespace mpc
