#include "detect_options.h"

#include <charconv>

namespace monoperfcap {
namespace {

// 0 for "auto"; -1 for what is neither that nor a number from 1 on.
int Stride(const std::string& text) {
  if (text == "auto") return 0;
  int every = 0;
  const auto [end, ec] = std::from_chars(text.data(), text.data() + text.size(), every);
  return ec == std::errc() && end == text.data() + text.size() && every >= 1 ? every : -1;
}

}  // namespace

void DetectArguments::AddTo(CLI::App* app) {
  app->add_option("--detect-every", every,
                  "Run the networks on every N-th frame; auto: as rarely as motion allows")
      ->check([](const std::string& text) {
        return Stride(text) < 0 ? "expected auto or a number from 1 on" : std::string();
      })
      ->capture_default_str();
  CLI::Option* const rank =
      app->add_option("--person", person, "Follow the K-th largest person in view")
          ->check(CLI::Range(1, 1000))
          ->capture_default_str();
  app->add_option("--at", at, "Follow the person at pixel X,Y when people first appear")
      ->delimiter(',')
      ->expected(2)
      ->excludes(rank);
  app->add_flag("--mirror", mirror, "Show the networks each picture mirrored too: better, slower");
  app->add_option("--models", models, "Folder of the networks (scripts/get_models.sh)");
}

mpc::ClipDetectorOptions DetectArguments::Options() const {
  mpc::ClipDetectorOptions options;
  options.every = Stride(every);
  options.person = person;
  if (at.size() == 2) options.at = Eigen::Vector2d(at[0], at[1]);
  options.landmarker.average_mirrored = mirror;
  return options;
}

}  // namespace monoperfcap
