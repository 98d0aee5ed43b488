// Loads an actor, bends its left elbow and raises its right knee, and writes the mesh as .obj.
//
//   example_load_and_skin_actor ACTOR.glb OUTPUT.obj

#include <cstdio>
#include <fstream>

#include "mpc/core/error.h"
#include "mpc/io/gltf.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/kinematics.h"
#include "mpc/skeleton/rig_map.h"
#include "mpc/skeleton/skinning.h"

namespace {

void SetAngle(const mpc::Skeleton& skeleton, const char* hinge, double angle_rad,
              Eigen::VectorXd* pose) {
  for (size_t h = 0; h < skeleton.hinges.size(); ++h) {
    if (skeleton.hinges[h].name == hinge) (*pose)[static_cast<int>(6 + h)] = angle_rad;
  }
}

void WriteObj(const char* path, const Eigen::Matrix3Xf& positions,
              const mpc::Triangles& triangles) {
  std::ofstream out(path);
  for (const auto& x : positions.colwise()) {
    out << "v " << x[0] << ' ' << x[1] << ' ' << x[2] << '\n';
  }
  for (const auto& t : triangles.colwise()) {
    out << "f " << t[0] + 1 << ' ' << t[1] + 1 << ' ' << t[2] + 1 << '\n';
  }
  if (!out.flush()) throw mpc::Error(mpc::ErrorCode::kWriteFailed, "the .obj was not written");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  try {
    const mpc::RigAsset rig = mpc::ReadRigGltf(argv[1]);
    const mpc::RigMap map = mpc::MapRigByNames(rig);
    std::printf("%s", mpc::MappingReport(rig, map).c_str());

    const mpc::Character character = mpc::BuildCharacter(rig, map);
    Eigen::VectorXd pose = character.bind_pose;
    SetAngle(character.skeleton, "left_elbow_flexion", 1.5, &pose);
    SetAngle(character.skeleton, "right_hip_flexion", 1.2, &pose);
    SetAngle(character.skeleton, "right_knee_flexion", 1.2, &pose);

    mpc::KinematicState state;
    mpc::ForwardKinematics(character.skeleton, pose, &state);
    Eigen::Matrix3Xf positions;
    mpc::SkinCharacter(character, state, &positions);
    WriteObj(argv[2], positions, character.mesh.triangles);
  } catch (const mpc::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
