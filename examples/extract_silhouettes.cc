// Silhouettes from C++: the folder of a capture in, one PNG per frame out.
//
//   example_extract_silhouettes TAKE OUTPUT_FOLDER

#include <cstdio>

#include "mpc/io/mask_file.h"
#include "mpc/mpc.h"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  try {
    const mpc::Take take = mpc::ReadTake(argv[1]);
    mpc::MaskFolderWriter writer(argv[2]);
    const auto records =
        mpc::ExtractSilhouettes(take.clip(), {}, [&writer](const mpc::SilhouetteFrame& frame) {
          writer.Write(frame.silhouette.mask);  // also there: the picture, and the model's own mask
        });
    writer.Close();
    double model_iou = 0;
    for (const mpc::SilhouetteRecord& record : records) model_iou += record.model_iou;
    std::printf("%zu masks, IoU with the model %.4f on average\n", records.size(),
                model_iou / static_cast<double>(records.size()));
  } catch (const mpc::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
