// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "model/body.h"
#include "model/rigid_motion.h"

namespace sweepfit {

// A joint beyond the 21 that only carries skin. It moves as parts of the sweeps
// do, so that linear blend skinning can follow them where a joint bends or a
// bone twists:
//
//   <joint>_swing  the start of a limb: turned with its bone but not twisted
//   <joint>_half   the middle of the rounded corner at a joint; where the limb
//                  folds over itself two sections too, <joint>_bend_before
//                  and <joint>_bend_after
//   <joint>_twist  the middle of the bone that starts at the joint
//   <joint>_blend  half way between the trunk and the limb
//   <joint>_fold_before, _fold_after and each _far
//                  the skin on the inner side of a bend, before and after the
//                  joint, pressed back where the limb folds over itself
//   <joint>_tip, _tip_after
//                  the skin on the outer side: kneecap and point of the elbow
//   <joint>_side, _side_other
//                  the skin at both ends of the hinge, where it swells
//   <joint>_pit, _hollow, _rear
//                  the skin between a limb and the trunk, armpit and crotch,
//                  on the limb's side and on the trunk's, and behind the root
//                  of the limb
//   spine_fold_before_left, ... _right and _after_...
//                  the flanks of the waist
//   spine_crease, _crease_left, _crease_right
//                  narrow strips where a bent waist presses the belly back
//
// All are functions of the posture. File formats have no such rules, so their
// motion is baked into every clip; in an engine a constraint of half the
// rotation comes close. Left at rest they follow the joint they hang on.
struct HelperJoint {
  std::string name;
  int joint = 0;                              // one of the 21: named after it
  int parent = 0;                             // one of the 21: hangs on it
  Eigen::Vector3d joint_in_rest = {0, 0, 0};  // at rest, root at the origin
  struct Source {
    int sweep;
    double u;
    double weight;
  };
  std::vector<Source> sources;  // sections; several blend as dual quaternions
  // If not empty: it moves as these vertices do instead, in the sense of least
  // squares. The source then is where they lie.
  std::vector<int> skin;
};

// The helpers of a body; left and right mirror each other.
std::vector<HelperJoint> MakeHelperJoints(const Body& body);

// How each of the 21 joints and then each helper carries points from rest to a
// posture.
class JointMotions {
 public:
  // Keeps pointers to both.
  JointMotions(const Body& body, const std::vector<HelperJoint>& helpers);
  // With the deformer of the body, which is kept too, instead of one more.
  JointMotions(const Body& body,
               const std::vector<HelperJoint>& helpers,
               const BodyDeformer& deformer);

  std::vector<RigidMotion> At(const Pose& pose) const;
  // The same where the vertices of the body in that posture are known.
  std::vector<RigidMotion> At(
      const Pose& pose,
      const std::vector<Eigen::Vector3d>& vertices_in_world) const;
  // Helpers left at rest: they follow the joints they hang on.
  std::vector<RigidMotion> AtWithoutHelpers(const Pose& pose) const;

 private:
  const Body& body_;
  const std::vector<HelperJoint>& helpers_;
  JointFrames rest_;
  std::vector<SweepAxis> rest_axes_;
  std::unique_ptr<const BodyDeformer> own_deformer_;
  const BodyDeformer* deformer_ = nullptr;  // where a helper rides on the skin
};

}  // namespace sweepfit
