// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "capture/capture.h"

namespace sweepfit {

// A point of the person found in one picture by somebody else.
struct Keypoint2 {
  std::string camera_id;
  std::string pose;
  // A joint ("l_wrist") or one of kKeypointLandmarks.
  std::string name;
  Eigen::Vector2d pixel;  // of the picture as taken, centres at integers
  double sigma = 0;       // per coordinate, pixels
};

// What a keypoint may be besides the 21 joints. mid_shoulder is the middle
// between the shoulder joints (OpenPose calls it the neck), l_heel and
// l_small_toe lie on the skin or the shoe.
inline constexpr std::string_view kKeypointLandmarks[] = {"nose",
                                                          "l_eye",
                                                          "r_eye",
                                                          "l_ear",
                                                          "r_ear",
                                                          "mid_shoulder",
                                                          "l_heel",
                                                          "r_heel",
                                                          "l_small_toe",
                                                          "r_small_toe",
                                                          "l_armpit",
                                                          "r_armpit",
                                                          "crotch",
                                                          "l_neck",
                                                          "r_neck"};

// Reads keypoints of a capture. The path is one of
//   a file of our own:
//     {"version": 1, "keypoints": [{"camera": "cam00", "pose": "A", "name":
//      "l_wrist", "u": 512.3, "v": 402.8, "sigma": 4}, ...]}
//   a COCO data set (images, annotations, categories) whose images[].file_name
//     ends like the paths of the capture's pictures
//   a folder with one OpenPose or COCO file per picture, POSE/CAMERA.json or
//     POSE_CAMERA.json, with or without _keypoints before .json
// OpenPose: BODY_25 and the 18 points of its COCO model. COCO: the 17 points of
// a person, or those that the categories name. Of several people in a picture
// the one with the largest sum of confidences counts. Neither format states an
// error; sigma is then the spread of COCO's annotators (the constants of its
// object keypoint similarity) times 0.4 of the longer side of the box around
// the points, over the confidence; points below a confidence of 0.2 are left
// out. Sorted by pose and camera in the order of the capture.
//
// InputError naming the file and the entry or line: not JSON, an unknown
// camera, pose, name or key, a number that is none, a point outside its picture
// (our own files; detectors may guess beyond the frame, which is left out), a
// point given twice, no point at all.
std::vector<Keypoint2> LoadKeypoints(const std::filesystem::path& path,
                                     const Capture& capture);

}  // namespace sweepfit
