// SPDX-License-Identifier: Apache-2.0
#include "experiments/fit_to_folder.h"

#include <gtest/gtest.h>

#include <filesystem>

namespace sweepfit {
namespace {

Capture TwoCameras() {
  Capture capture;
  capture.cameras.resize(2);
  capture.cameras[0].camera.id = "left";
  capture.cameras[1].camera.id = "right";
  capture.poses.resize(1);
  capture.poses[0].name = "A";
  return capture;
}

TEST(ResolveConfig, PathsMeanTheSameFromAnyFolder) {
  FitConfig config;
  config.options.landmarks.keypoints = "keypoints/anna.json";
  config.options.body_template.file = "person.glb";
  config.options.body_template.names = "./names.yaml";
  const FitConfig resolved = ResolveConfig(TwoCameras(), config);
  const std::filesystem::path here = std::filesystem::current_path();
  EXPECT_EQ(resolved.options.landmarks.keypoints, here / "keypoints/anna.json");
  EXPECT_EQ(resolved.options.body_template.file, here / "person.glb");
  EXPECT_EQ(resolved.options.body_template.names, here / "names.yaml");
  // Nothing changes once they are.
  EXPECT_EQ(FitConfigToYaml(ResolveConfig(TwoCameras(), resolved)),
            FitConfigToYaml(resolved));
}

TEST(ResolveConfig, WordsThatAreNoPathsStay) {
  FitConfig config;
  config.options.body_template.names = "mixamo";
  const FitOptions options = ResolveConfig(TwoCameras(), config).options;
  EXPECT_EQ(options.landmarks.keypoints, "none");
  EXPECT_EQ(options.body_template.file, "generic");
  EXPECT_EQ(options.body_template.names, "mixamo");
}

}  // namespace
}  // namespace sweepfit
