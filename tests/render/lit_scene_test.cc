#include "mpc/render/lit_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "mpc/core/rigid.h"
#include "mpc/render/raster.h"
#include "render/meshes.h"
#include "support/expect_error.h"

namespace mpc {
namespace {

// A floor of 20 x 20 m at y = 0.
LitMesh FloorMesh() {
  LitMesh floor;
  floor.mesh.positions.resize(3, 4);
  floor.mesh.positions << -10, 10, 10, -10, 0, 0, 0, 0, 10, 10, -10, -10;
  floor.mesh.triangles.resize(3, 2);
  floor.mesh.triangles << 0, 0, 1, 2, 2, 3;
  return floor;
}

// Looks down from (0, 5, 5) at the origin.
Camera LookingDown(int width = 320, int height = 240) {
  Camera camera = Camera::FromFov(width, height, 1);
  camera.has_extrinsics = true;
  camera.camera_from_world.rotation =
      ExpSO3({M_PI / 4, 0, 0}) * Eigen::Vector3d(1, -1, -1).asDiagonal();
  camera.camera_from_world.translation =
      -(camera.camera_from_world.rotation * Eigen::Vector3d(0, 5, 5));
  return camera;
}

cv::Mat Draw(const Camera& camera, const LitScene& scene) {
  cv::Mat sum = cv::Mat::zeros(camera.height, camera.width, CV_32FC4);
  AddLitPicture(camera, scene, &sum);
  return sum;
}

// The picture's light at a point of the world; blue.
float LightAt(const cv::Mat& sum, const Camera& camera, const Eigen::Vector3d& x) {
  Eigen::Vector2d pixel;
  EXPECT_TRUE(Project(camera, camera.camera_from_world * x, &pixel));
  return sum.at<cv::Vec4f>(cvRound(pixel.y()), cvRound(pixel.x()))[0];
}

class LitSceneTest : public ::testing::Test {
 protected:
  LitSceneTest() {
    scene_.place = {&floor_};
    scene_.lighting.lamp_in_world = {30, 40, 0};
    floor_.bgr = {255, 255, 255};
  }
  LitMesh floor_ = FloorMesh();
  LitScene scene_;
  Camera camera_ = LookingDown();
};

TEST_F(LitSceneTest, AFloorIsLitByLampAndSky) {
  const float expected = scene_.lighting.sky_bgr[0] + 0.8f * scene_.lighting.lamp_bgr[0];
  EXPECT_NEAR(LightAt(Draw(camera_, scene_), camera_, {0, 0, 0}), expected, 1e-5);
  floor_.glows = true;
  EXPECT_FLOAT_EQ(LightAt(Draw(camera_, scene_), camera_, {0, 0, 0}), 1);
}

TEST_F(LitSceneTest, AShadowLiesWhereGeometrySays) {
  LitMesh ball;
  ball.mesh = testing::Ball({0, 1, 0}, 0.3);
  scene_.bodies = {&ball};
  const TriangleMesh* bodies[] = {&ball.mesh};
  const ShadowMap shadow = MakeShadowMap(scene_.lighting.lamp_in_world, bodies, 512);
  scene_.shadows = {&shadow};
  const cv::Mat sum = Draw(camera_, scene_);
  const float lit = scene_.lighting.sky_bgr[0] + 0.8f * scene_.lighting.lamp_bgr[0];
  // The line from the lamp through the ball's middle meets the floor at x = -30 / 39.
  const Eigen::Vector3d middle(-30.0 / 39, 0, 0);
  EXPECT_NEAR(LightAt(sum, camera_, middle), scene_.lighting.sky_bgr[0], 1e-5);
  // Across the light the shadow is as wide as the ball (and 40 / 39 of it), along it by 1 / 0.8.
  const double radius = 0.3 * 40 / 39;
  for (const double side : {-1.0, 1.0}) {
    EXPECT_NEAR(LightAt(sum, camera_, middle + Eigen::Vector3d(0, 0, side * (radius - 0.04))),
                scene_.lighting.sky_bgr[0], 1e-5);
    EXPECT_NEAR(LightAt(sum, camera_, middle + Eigen::Vector3d(0, 0, side * (radius + 0.04))), lit,
                1e-5);
    EXPECT_NEAR(LightAt(sum, camera_, middle + Eigen::Vector3d(side * (radius / 0.8 - 0.05), 0, 0)),
                scene_.lighting.sky_bgr[0], 1e-5);
    EXPECT_NEAR(LightAt(sum, camera_, middle + Eigen::Vector3d(side * (radius / 0.8 + 0.05), 0, 0)),
                lit, 1e-5);
  }
}

TEST_F(LitSceneTest, ABallShadesOnlyItsFarSide) {
  // As bright as without a shadow map wherever the surface faces the lamp.
  LitMesh ball;
  ball.mesh = testing::Ball({0, 1, 0}, 0.8);
  VertexNormals(ball.mesh.positions, ball.mesh.triangles, &ball.normals);
  scene_.bodies = {&ball};
  const cv::Mat bare = Draw(camera_, scene_);
  const TriangleMesh* bodies[] = {&ball.mesh};
  const ShadowMap shadow = MakeShadowMap(scene_.lighting.lamp_in_world, bodies, 512);
  scene_.shadows = {&shadow};
  const cv::Mat shaded = Draw(camera_, scene_);
  const Eigen::Vector3d to_lamp = Eigen::Vector3d(30, 40, 0).normalized();
  int compared = 0;
  for (const auto& x : ball.mesh.positions.colwise()) {
    const Eigen::Vector3d normal = (x.cast<double>() - Eigen::Vector3d(0, 1, 0)).normalized();
    const Eigen::Vector3d to_camera = (Eigen::Vector3d(0, 5, 5) - x.cast<double>()).normalized();
    if (normal.dot(to_lamp) < 0.1 || normal.dot(to_camera) < 0.2) continue;
    EXPECT_EQ(LightAt(shaded, camera_, x.cast<double>()), LightAt(bare, camera_, x.cast<double>()));
    ++compared;
  }
  EXPECT_GT(compared, 500);
}

TEST_F(LitSceneTest, ContactDarkensTheFloorUnderABody) {
  LitMesh ball;
  ball.mesh = testing::Ball({0, 0.1, 0}, 0.1);
  const TriangleMesh* bodies[] = {&ball.mesh};
  const ContactMap contact = MakeContactMap(bodies);
  EXPECT_GT(contact.At(0, 0), 0.4f);
  EXPECT_LT(contact.At(0.25f, 0), 0.01f);
  EXPECT_NEAR(contact.At(0.05f, 0), contact.At(-0.05f, 0), 0.03f);
  EXPECT_NEAR(contact.At(0, 0.05f), contact.At(0.05f, 0), 0.03f);
  EXPECT_EQ(contact.At(5, 5), 0);
  ball.mesh.positions.row(1).array() += 1;
  EXPECT_LT(MakeContactMap(bodies).At(0, 0), 0.01f);
  scene_.contact = &contact;
  const cv::Mat sum = Draw(camera_, scene_);
  EXPECT_EQ(LightAt(sum, camera_, {0, 0, 0}), LightAt(sum, camera_, {2, 0, 0})) << "no floor";
  floor_.is_floor = true;
  const cv::Mat dark = Draw(camera_, scene_);
  EXPECT_LT(LightAt(dark, camera_, {0, 0, 0}), LightAt(dark, camera_, {2, 0, 0}) - 0.1f);
}

TEST_F(LitSceneTest, BodiesHideThePlaceAndNothingElse) {
  // A body under the floor is still seen; the pixels are exactly RasterizeMesh's.
  LitMesh ball;
  ball.mesh = testing::Ball({0.3, -1, 0}, 0.5);
  ball.glows = floor_.glows = true;
  ball.bgr = {0, 0, 0};
  scene_.bodies = {&ball};
  const cv::Mat sum = Draw(camera_, scene_);
  const cv::Mat mask = MeshMask(camera_, ToCamera(camera_.camera_from_world, ball.mesh.positions),
                                ball.mesh.triangles);
  ASSERT_GT(cv::countNonZero(mask), 500);
  cv::Mat blue;
  cv::extractChannel(sum, blue, 0);
  EXPECT_EQ(cv::countNonZero((blue == 0) != mask), 0);
}

TEST_F(LitSceneTest, TexturesArePerspectiveCorrectAndClippedOnesToo) {
  // A chequered floor that reaches behind the camera: every square has its colour.
  cv::Mat chequers(2, 2, CV_8UC3, cv::Scalar(255, 255, 255));
  chequers.at<cv::Vec3b>(0, 1) = chequers.at<cv::Vec3b>(1, 0) = {0, 0, 0};
  cv::resize(chequers, chequers, {256, 256}, 0, 0, cv::INTER_NEAREST);
  floor_.texture = std::make_shared<const Texture>(chequers);
  floor_.uv.resize(2, 4);
  floor_.uv << 0, 10, 10, 0, 10, 10, 0, 0;  // squares of 1 m
  floor_.glows = true;
  for (const double height : {5.0, 1.6}) {  // the lower one sees the floor from beneath its feet
    Camera camera = camera_;
    camera.camera_from_world.translation =
        -(camera.camera_from_world.rotation * Eigen::Vector3d(0, height, height));
    const cv::Mat sum = Draw(camera, scene_);
    int compared = 0;
    for (double x = -1.9; x < 2; x += 0.2) {
      for (double z = -1.9; z < 2; z += 0.2) {
        Eigen::Vector2d pixel;
        const Eigen::Vector3d at(x, 0, z);
        if (!Project(camera, camera.camera_from_world * at, &pixel)) continue;
        if (!cv::Rect(1, 1, 318, 238).contains({cvRound(pixel.x()), cvRound(pixel.y())})) continue;
        const double edge = std::min(std::abs(x - std::round(x)), std::abs(z - std::round(z)));
        if (edge < 0.06) continue;
        const int column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(z));
        EXPECT_NEAR(LightAt(sum, camera, at), (column + row) % 2 == 0 ? 1 : 0, 0.02)
            << x << " " << z;
        ++compared;
      }
    }
    EXPECT_GT(compared, 100);
  }
}

TEST_F(LitSceneTest, AMovingCameraSeesTheRightParallax) {
  // Three white cards at different depths; wherever the camera is, each is seen where it projects.
  std::vector<LitMesh> cards;
  const std::vector<Eigen::Vector3d> places = {{-0.8, 0.5, 1}, {0.5, 1, -2}, {0.2, 0.3, 1.8}};
  for (const Eigen::Vector3d& x : places) {
    LitMesh card;
    card.mesh = testing::Ball(x, 0.05);
    card.glows = true;
    card.bgr = {255, 255, 255};
    cards.push_back(card);
  }
  for (const LitMesh& card : cards) scene_.place.push_back(&card);
  floor_.glows = true;
  floor_.bgr = {0, 0, 0};
  std::mt19937 random(7);
  std::normal_distribution<double> shake(0, 0.15);
  for (int f = 0; f < 5; ++f) {
    Camera camera = camera_;
    for (int i = 0; i < 3; ++i) camera.camera_from_world.translation[i] += shake(random);
    camera.camera_from_world.rotation =
        ExpSO3({0.1 * shake(random), 0.2 * shake(random), shake(random)}) *
        camera.camera_from_world.rotation;
    cv::Mat white, labels, stats, centres;
    cv::extractChannel(Draw(camera, scene_), white, 0);
    ASSERT_EQ(cv::connectedComponentsWithStats(white > 0.5, labels, stats, centres), 4);
    for (const Eigen::Vector3d& x : places) {
      Eigen::Vector2d pixel;
      ASSERT_TRUE(Project(camera, camera.camera_from_world * x, &pixel));
      double nearest = 1e9;
      for (int label = 1; label < 4; ++label) {
        nearest = std::min(nearest, std::hypot(centres.at<double>(label, 0) - pixel.x(),
                                               centres.at<double>(label, 1) - pixel.y()));
      }
      EXPECT_LT(nearest, 0.4);
    }
  }
}

TEST(TextureTest, IsExactAtTexelsAndAMeanFromAfar) {
  cv::Mat picture(8, 16, CV_8UC3);
  std::mt19937 random(3);
  for (cv::Vec3b& c : cv::Mat_<cv::Vec3b>(picture)) {
    for (int i = 0; i < 3; ++i) c[i] = static_cast<uchar>(random() % 256);
  }
  const Texture texture(picture);
  Eigen::Array4f mean = Eigen::Array4f::Zero();
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 16; ++x) {
      // One repeat to the left and above, as any other.
      const Eigen::Array4f found =
          texture.Sample(static_cast<float>(x) / 16 - 31.0f / 32,
                         static_cast<float>(y) / 8 - 15.0f / 16, 1.0f / 128);
      for (int i = 0; i < 3; ++i) {
        EXPECT_NEAR(found[i], LinearFromByte(picture.at<cv::Vec3b>(y, x)[i]), 1e-5);
      }
      mean += found / 128;
    }
  }
  EXPECT_LT((texture.Sample(0.3f, 0.7f, 1) - mean).abs().maxCoeff(), 1e-3);
  // Across the seam: the mean of the last and the first column.
  const Eigen::Array4f seam = texture.Sample(0, 0.5f / 8, 0);
  const Eigen::Array4f sides =
      texture.Sample(0.5f / 16, 0.5f / 8, 0) + texture.Sample(-0.5f / 16, 0.5f / 8, 0);
  EXPECT_LT((seam - sides / 2).abs().maxCoeff(), 1e-5);
}

TEST(DevelopedTest, UndoesLinearLight) {
  cv::Mat sum(1, 256, CV_32FC4);
  for (int i = 0; i < 256; ++i) {
    const float light = 3 * LinearFromByte(static_cast<float>(i));
    sum.at<cv::Vec4f>(0, i) = {light, 5, -1, 0};
  }
  const cv::Mat picture = Developed(sum, 3);
  for (int i = 0; i < 256; ++i) {
    EXPECT_NEAR(picture.at<cv::Vec3b>(0, i)[0], i, i < 2 ? 1 : 0);
    EXPECT_EQ(picture.at<cv::Vec3b>(0, i)[1], 255);
    EXPECT_EQ(picture.at<cv::Vec3b>(0, i)[2], 0);
  }
}

TEST_F(LitSceneTest, MisuseIsRefused) {
  cv::Mat sum = cv::Mat::zeros(240, 320, CV_32FC4);
  Camera bent = camera_;
  bent.distortion[0] = 0.1;
  EXPECT_MPC_ERROR(AddLitPicture(bent, scene_, &sum), kInvalidArgument, "distortion");
  Camera lost = camera_;
  lost.has_extrinsics = false;
  EXPECT_MPC_ERROR(AddLitPicture(lost, scene_, &sum), kInvalidArgument, "extrinsics");
  cv::Mat small(10, 10, CV_32FC4);
  EXPECT_MPC_ERROR(AddLitPicture(camera_, scene_, &small), kInvalidArgument, "10 x 10");
  floor_.uv.resize(2, 3);
  EXPECT_MPC_ERROR(AddLitPicture(camera_, scene_, &sum), kInvalidArgument, "texture coordinates");
  EXPECT_MPC_ERROR(Texture(cv::Mat(4, 4, CV_8UC1)), kInvalidArgument, "texture");
  const TriangleMesh ball = testing::Ball({0, 0, 0}, 2);
  const TriangleMesh* bodies[] = {&ball};
  EXPECT_MPC_ERROR(MakeShadowMap({1, 0, 0}, bodies, 64), kInvalidArgument, "lamp");
}

}  // namespace
}  // namespace mpc
