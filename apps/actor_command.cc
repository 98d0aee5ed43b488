#include <fmt/format.h>

#include <cstdio>
#include <memory>
#include <string>

#include "command.h"
#include "console.h"
#include "mpc/io/gltf.h"
#include "mpc/skeleton/character.h"
#include "mpc/skeleton/rig_map.h"

namespace monoperfcap {
namespace {

int Run(const std::string& path) {
  const mpc::RigAsset rig = mpc::ReadRigGltf(path);
  Eigen::Index num_triangles = 0;
  for (const mpc::RigMesh& mesh : rig.meshes) num_triangles += mesh.mesh.triangles.cols();
  std::printf("%s",
              fmt::format("{}: {} bones, {} meshes, {} vertices, {} triangles\n", path,
                          rig.bones.size(), rig.meshes.size(), rig.num_vertices(), num_triangles)
                  .c_str());
  for (const std::string& fault : mpc::CheckWeights(rig)) PrintMessage("warning", fault);
  const mpc::RigMap map = mpc::MapRigByNames(rig);
  std::printf("%s", mpc::MappingReport(rig, map).c_str());
  const mpc::Character character = mpc::BuildCharacter(rig, map);
  const Eigen::Vector3f size =
      character.mesh.positions.rowwise().maxCoeff() - character.mesh.positions.rowwise().minCoeff();
  std::printf("%s", fmt::format("size at bind: {:.3f} m wide, {:.3f} m tall, {:.3f} m deep\n"
                                "capture skeleton: {} joints, {} degrees of freedom\n",
                                size.x(), size.y(), size.z(), character.skeleton.num_joints(),
                                character.skeleton.num_dofs())
                        .c_str());
  return kExitOk;
}

}  // namespace

Command AddActorInfoCommand(CLI::App* parent) {
  CLI::App* const app =
      parent->add_subcommand("info", "Which bones were recognised, and what is wrong with a rig");
  const auto path = std::make_shared<std::string>();
  app->add_option("actor", *path, "The rigged mesh: .glb or .gltf")->required();
  return {app, [path] { return Run(*path); }};
}

}  // namespace monoperfcap
