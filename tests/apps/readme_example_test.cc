// SPDX-License-Identifier: Apache-2.0
//
// The library example of README.md, word for word, so that it keeps compiling.
#include <gtest/gtest.h>

// README.md begins here.
#include <iostream>

#include "capture/capture.h"
#include "experiments/fit_to_folder.h"
#include "model/input_error.h"

int FitOne(const std::string& capture_folder,
           const std::string& result_folder) {
  try {
    const sweepfit::Capture capture = sweepfit::LoadCapture(capture_folder);
    sweepfit::FitConfig config;
    config.options.joints.weights.anthropometric = 0.3;
    config.options.until = "joints";
    const auto report =
        sweepfit::FitToFolder(capture, config, result_folder, nullptr);
    std::cout << report["stages"].dump(1) << "\n";
    return 0;
  } catch (const sweepfit::InputError& error) {
    std::cerr << error.what() << "\n";  // names file, key or camera
    return 2;
  } catch (const sweepfit::FitError& error) {
    std::cerr << error.what() << "\n";  // the pictures show no such body
    return 1;
  }
}
// README.md ends here.

namespace sweepfit {
namespace {

TEST(ReadmeExample, ReportsBadInput) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(FitOne(testing::TempDir() + "no_such_capture", "unused"), 2);
  EXPECT_NE(testing::internal::GetCapturedStderr().find("no_such_capture"),
            std::string::npos);
}

}  // namespace
}  // namespace sweepfit
