// SPDX-License-Identifier: Apache-2.0
//
// NAME_par.txt of the multi-view data sets at vision.middlebury.edu/mview: the
// number of images, then per line a picture's name, K, R and t with P = K [R
// t].
#include <sstream>

#include "capture/import_camera.h"
#include "capture/import_format.h"
#include "model/file_io.h"

namespace sweepfit {

ImportedCalibration ReadMiddlebury(const std::filesystem::path& source) {
  ImportedCalibration calibration;
  calibration.axes_are_chosen = true;
  calibration.folder = source.parent_path();
  std::istringstream lines(ReadWholeFile(source.string()));
  int number = 0;
  double count = -1;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::string where = source.string() + ":" + std::to_string(number);
    std::istringstream words(line);
    std::string name;
    if (!(words >> name)) continue;
    if (count < 0) {
      std::string rest;
      if (!ParseDouble(name, &count) || count < 0 || words >> rest) {
        FailImport(where, "the first line must be the number of images");
      }
      continue;
    }
    ImportedCamera& camera = calibration.cameras.emplace_back();
    camera.image = name;
    camera.camera.id = std::filesystem::path(name).stem().string();
    where += ": camera " + camera.camera.id;
    std::vector<double> values;
    for (std::string word; words >> word;) {
      double value = 0;
      if (!ParseDouble(word, &value)) {
        FailImport(where, "'" + word + "' is no number");
      }
      values.push_back(value);
    }
    constexpr size_t kNumValues = 21;
    if (values.size() != kNumValues) {
      FailImport(where,
                 "expected 21 numbers (K, R, t), not " +
                     std::to_string(values.size()));
    }
    using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    SetIntrinsics(
        Eigen::Map<const RowMajor>(values.data()), where, &camera.camera);
    SetPose(Eigen::Map<const RowMajor>(values.data() + 9),
            Eigen::Map<const Eigen::Vector3d>(values.data() + 18),
            where,
            &camera.camera);
  }
  if (count != static_cast<double>(calibration.cameras.size())) {
    FailImport(source.string() + ":1",
               count < 0 ? "the first line must be the number of images"
                         : "announces another number of images than the " +
                               std::to_string(calibration.cameras.size()) +
                               " that follow");
  }
  return calibration;
}

}  // namespace sweepfit
