// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace sweepfit {

// pose ("" when the pattern does not tell poses apart) -> camera id -> file
using FoundPictures =
    std::map<std::string, std::map<std::string, std::filesystem::path>>;

// Finds the files of a pattern: a path in which {camera} stands for a camera's
// id, {pose} for the name of a pose, * for anything and ? for any character
// within one part of the path, e.g. shots/{pose}/{camera}.jpg. Without {camera}
// the camera is the one whose id is the file's name without extension, else a
// folder of its path, else a word of its name. Files of no camera are left out.
// InputError: no file is found, a file may be of two cameras, or two files are
// of the same camera and pose.
FoundPictures FindPictures(const std::string& pattern,
                           const std::vector<std::string>& camera_ids);

}  // namespace sweepfit
