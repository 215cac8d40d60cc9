// SPDX-License-Identifier: Apache-2.0
#include <utility>

#include "model/input_error.h"
#include "volume/floor_cut.h"
#include "volume/greedy.h"
#include "volume/photo.h"
#include "volume/volume.h"

namespace sweepfit {

std::optional<std::string> VolumeOptions::Check() const {
  if (mode != "hull" && mode != "photo" && mode != "greedy") {
    return "volume.mode: must be hull, photo or greedy, not '" + mode + "'";
  }
  for (const auto& error :
       {HullOptions{voxel_size}.Check(), photo.Check(), greedy.Check()}) {
    if (error) return error;
  }
  return std::nullopt;
}

Volume BuildVolume(const std::vector<View>& views,
                   const VolumeOptions& options,
                   Progress* progress,
                   StageSummary* summary) {
  if (const auto error = options.Check()) throw InputError(*error);
  if (summary != nullptr) summary->figures["mode"] = options.mode;
  double cut = 0;
  Volume hull = CutBelowFloor(
      views,
      BuildVisualHull(
          views, HullOptions{options.voxel_size}, progress, summary),
      &cut);
  if (summary != nullptr) {
    const Eigen::Vector3d size = hull.BoxMax() - hull.BoxMin();
    summary->figures["box_size"] = {size.x(), size.y(), size.z()};
    summary->figures["cut_below_floor"] = cut;
  }
  if (options.mode == "hull") return hull;
  if (options.mode == "greedy") {
    return CarveGreedily(views, std::move(hull), options.greedy, summary);
  }
  return RefineByPhotoConsistency(
      views, std::move(hull), options.photo, progress, summary);
}

}  // namespace sweepfit
