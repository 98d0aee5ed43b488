// Real actors in motion: masks and boundary.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "mpc/eval/motions.h"
#include "mpc/io/gltf.h"
#include "mpc/render/boundary.h"
#include "mpc/render/raster.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/skinning.h"
#include "support/data_dir.h"

namespace mpc {
namespace {

constexpr double kDistance_m = 3.5;

// Only one edge in fifty is longer, m.
double LongEdge(const Eigen::Matrix3Xf& positions, const SurfaceTopology& topology) {
  std::vector<float> lengths;
  for (const SurfaceTopology::Edge& edge : topology.edges) {
    lengths.push_back((positions.col(edge.v0) - positions.col(edge.v1)).norm());
  }
  const auto nth = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() * 49 / 50);
  std::nth_element(lengths.begin(), nth, lengths.end());
  return *nth;
}

// The actor in some frames of a motion, in front of the camera.
std::vector<Eigen::Matrix3Xf> Posed(const Character& character, MotionKind kind) {
  const Eigen::Matrix3d camera_from_world = Eigen::Vector3d(1, -1, -1).asDiagonal();
  const Eigen::MatrixXd poses = TransformPoses(camera_from_world, {0, 0.9, kDistance_m},
                                               MakeMotion(character.skeleton, kind, 3, 2));
  std::vector<Eigen::Matrix3Xf> result;
  for (const auto& pose : poses.colwise()) {
    KinematicState state;
    ForwardKinematics(character.skeleton, pose, &state);
    SkinCharacter(character, state, &result.emplace_back());
  }
  return result;
}

TEST(RenderDataTest, ActorsInMotion) {
  MPC_REQUIRE_DATA();
  const Camera camera = Camera::FromFov(1920, 1080, 1.2);
  for (const char* name : {"male_tpose.glb", "female_apose.glb", "male_apose_lod5k.glb"}) {
    const RigAsset rig = ReadRigGltf(*testing::DataDir() / "actors" / name);
    const Character character = BuildCharacter(rig, MapRigByNames(rig));
    const Triangles& triangles = character.mesh.triangles;
    const SurfaceTopology topology = SurfaceTopology::FromMesh(character.mesh);
    const double edge_px = LongEdge(character.mesh.positions, topology) * camera.fx / kDistance_m;
    for (const MotionKind kind : {MotionKind::kReach, MotionKind::kWalk}) {
      for (const Eigen::Matrix3Xf& positions : Posed(character, kind)) {
        SCOPED_TRACE(name);
        // Twins.
        RasterBuffers fast, plain;
        RasterizeMesh(camera, positions, triangles, {}, &fast);
        RasterizeMeshScalar(camera, positions, triangles, {}, &plain);
        EXPECT_EQ(cv::countNonZero(fast.depth != plain.depth), 0);
        EXPECT_EQ(cv::countNonZero(fast.triangle_id != plain.triangle_id), 0);
        cv::Mat mask;
        ModelMask(camera, positions, topology, &mask);
        const cv::Mat drawn = plain.triangle_id >= 0;
        // Vertices on a UV seam have the same position but may be skinned with a rounding error.
        EXPECT_LE(cv::countNonZero(mask != drawn), 2);
        ASSERT_GT(cv::countNonZero(mask), 20000);

        // Every boundary vertex lies on the mask's contour, and the contour has one everywhere.
        const ModelBoundary boundary =
            FindModelBoundary(camera, positions, topology, mask, plain.depth);
        ASSERT_GT(boundary.vertices.size(), 300u);
        cv::Mat contour;
        cv::erode(mask, contour, cv::Mat());
        contour = mask & ~contour;
        cv::Mat from_contour, from_vertices;
        cv::distanceTransform(~contour, from_contour, cv::DIST_L2, cv::DIST_MASK_PRECISE);
        cv::Mat free_of_vertices(mask.size(), CV_8UC1, cv::Scalar(255));
        int inside = 0;
        for (Eigen::Index i = 0; i < boundary.pixels.cols(); ++i) {
          const Eigen::Vector2d pixel = boundary.pixels.col(i);
          const Eigen::Vector2d in = pixel - 2 * boundary.normals.col(i);
          const cv::Point at(cvRound(pixel.x()), cvRound(pixel.y()));
          EXPECT_LE(from_contour.at<float>(at), 1.5);
          free_of_vertices.at<uchar>(at) = 0;
          inside += mask.at<uchar>(cvRound(in.y()), cvRound(in.x())) != 0;
        }
        EXPECT_GT(inside, 0.95 * static_cast<double>(boundary.pixels.cols()));
        cv::distanceTransform(free_of_vertices, from_vertices, cv::DIST_L2, cv::DIST_MASK_PRECISE);
        const int far = cv::countNonZero((from_vertices > edge_px) & (contour > 0));
        EXPECT_LT(far, 0.02 * cv::countNonZero(contour)) << edge_px;
        if (::testing::Test::HasFailure()) return;
      }
    }
  }
}

}  // namespace
}  // namespace mpc
