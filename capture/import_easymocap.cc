// SPDX-License-Identifier: Apache-2.0
//
// intri.yml and extri.yml of EasyMocap (easymocap/mytools/camera_utils.py):
// per camera K_<name>, dist_<name> (some writers D_<name>), H_<name>, W_<name>;
// R_<name> (axis-angle), Rot_<name> (matrix), T_<name>.
#include "capture/import_camera.h"
#include "capture/import_format.h"
#include "capture/import_storage.h"
#include "model/rigid_motion.h"

namespace sweepfit {
namespace {

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// The axis-angle vector where there is one: text rounds it to a rotation still.
Eigen::Matrix3d ReadRotation(const StorageFile& extri,
                             const std::string& name,
                             std::string* where) {
  const std::string R = "R_" + name, Rot = "Rot_" + name;
  const bool has_matrix = extri.Has(Rot);
  Eigen::Matrix3d matrix;
  if (has_matrix) {
    *where = extri.Where(Rot) + ": camera " + name;
    matrix = Eigen::Map<const RowMajor>(extri.Numbers(Rot, 9).data());
  }
  if (!extri.Has(R)) {
    if (!has_matrix) {
      FailImport(extri.Where(R), "neither '" + R + "' nor '" + Rot + "'");
    }
    return matrix;
  }
  *where = extri.Where(R) + ": camera " + name;
  const Eigen::Matrix3d rotation =
      RotationOf(Eigen::Map<const Eigen::Vector3d>(extri.Numbers(R, 3).data()));
  constexpr double kMaxDeviation = 1e-3;
  if (has_matrix &&
      !((rotation - matrix).cwiseAbs().maxCoeff() <= kMaxDeviation)) {
    FailImport(*where, "'" + R + "' and '" + Rot + "' disagree");
  }
  return rotation;
}

}  // namespace

ImportedCalibration ReadEasyMocap(const std::filesystem::path& source) {
  const StorageFile intri(source / "intri.yml");
  const StorageFile extri(source / "extri.yml");
  ImportedCalibration calibration;
  calibration.axes_are_chosen = true;
  calibration.folder = source;
  for (const std::string& name : intri.Texts("names")) {
    Camera& camera = calibration.cameras.emplace_back().camera;
    camera.id = name;
    const auto where = [&](const std::string& key) {
      return intri.Where(key) + ": camera " + name;
    };
    const auto width = intri.Number("W_" + name);
    const auto height = intri.Number("H_" + name);
    if (width && height) {
      SetSize(*width, *height, where("W_" + name), &camera);
    }
    const std::string K = "K_" + name;
    SetIntrinsics(Eigen::Map<const RowMajor>(intri.Numbers(K, 9).data()),
                  where(K),
                  &camera);
    for (const std::string& key : {"dist_" + name, "D_" + name}) {
      if (!intri.Has(key)) continue;
      SetDistortion(intri.Numbers(key), where(key), &camera);
      break;
    }
    std::string pose_where;
    const Eigen::Matrix3d R = ReadRotation(extri, name, &pose_where);
    const auto t = extri.Numbers("T_" + name, 3);
    SetPose(
        R, Eigen::Map<const Eigen::Vector3d>(t.data()), pose_where, &camera);
  }
  return calibration;
}

}  // namespace sweepfit
