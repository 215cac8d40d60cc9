// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "model/body.h"

namespace sweepfit {

struct TemplateOptions {
  double sex = 0.5;       // 0 female .. 1 male, shapes blend linearly
  double stature = 1.70;  // metres, 0.6 .. 2.5
  double mass = 0;        // kg; 0: the mean for sex and stature
};

// Builds the generic body from the tables in model/data (template.yaml,
// anthropometry.yaml): an all-quad closed ring mesh bound to seven sweeps
// (trunk with head, two arms with hands, two legs, two feet). Rest pose: arms
// 45 degrees below the horizontal, palms facing front-down, legs slightly
// apart, facing +Z, root joint at the origin of RestVertices. Left and right
// mirror each other exactly (x -> -x). Throws InputError on options out of
// range.
Body BuildTemplate(const TemplateOptions& options);

}  // namespace sweepfit
