// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace sweepfit {

// How light that falls on the background may differ from the plate's.
struct OtherLight {
  float log_probability;  // ln of the prior that it does
  float reflected;  // scale of the colour that a person adds, per change of L
  float sharpest;   // change of ln light per pixel: beyond, it is an outline
};

// Up in the air few pixels are in other light, on the floor more, around the
// feet more still; and there its edges are sharper and it takes the colour of
// the feet. `at_feet`: 0 in the air, 1/2 on the floor, 1 around the feet.
OtherLight ExpectedLight(float at_feet);

// ln of the density of a change of ln light of the background, given that it is
// in other light: an exponential prior of scale `depth`, and softness. `slope`
// is its change per pixel, `sigma` the noise of a pixel's ln light.
float LogDensityOfLight(float log_light,
                        float slope,
                        float sigma,
                        const OtherLight& light,
                        double depth);

// Length of the gradient, per pixel.
cv::Mat1f Slope(const cv::Mat1f& image);

// The candidates that are joined to plain background without crossing an edge
// of the light: light changes softly across the plate, whereas a garment that
// is a darker shade of the wall has an outline. (The plate's own edges cancel
// in the ratio of picture and plate.) Gaps in edges are closed: in the air up
// to 6 pixels, at the feet up to 2.
// `slope` is that of ln light; `at_feet` is given per row.
cv::Mat1b SoftlyLit(const cv::Mat1b& candidate,
                    const cv::Mat1b& plain,
                    const cv::Mat1f& slope,
                    const std::vector<float>& at_feet);

}  // namespace sweepfit
