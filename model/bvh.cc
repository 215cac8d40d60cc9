// SPDX-License-Identifier: Apache-2.0
#include "model/bvh.h"

#include <glog/logging.h>

#include <Eigen/Geometry>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <set>
#include <string_view>

#include "model/file_io.h"
#include "model/input_error.h"

namespace sweepfit {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kFileUnitsPerMetre = 100;  // of the files that we write
constexpr std::array<std::string_view, 6> kChannelNames = {"Xposition",
                                                           "Yposition",
                                                           "Zposition",
                                                           "Xrotation",
                                                           "Yrotation",
                                                           "Zrotation"};
// Against files that would exhaust memory or stack.
constexpr std::size_t kMaxJoints = 10000;
constexpr int kMaxDepth = 500;

// ---------------------------------------------------------------- reading

struct Token {
  std::string_view text;  // empty at the end of the file
  int line = 0;
};

class Reader {
 public:
  Reader(std::string_view text, const std::string& source)
      : rest_(text), source_(source) {
    constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";
    if (rest_.starts_with(kByteOrderMark)) rest_.remove_prefix(3);
  }

  BvhMotion Read() {
    Expect("HIERARCHY");
    const Token root = Next();
    if (root.text != "ROOT") Fail(root, "expected ROOT, found " + Show(root));
    ReadJoint(-1, 0);
    Token token = Next();
    if (token.text == "ROOT") {
      Fail(token, "a second ROOT: the file must hold one skeleton");
    }
    if (token.text != "MOTION") {
      Fail(token, "expected MOTION, found " + Show(token));
    }
    if (num_channels_ == 0) Fail(token, "no joint has channels");
    ReadMotion();
    return std::move(motion_);
  }

 private:
  [[noreturn]] void Fail(const Token& token, const std::string& what) const {
    throw InputError(source_ + ":" + std::to_string(token.line) + ": " + what);
  }

  static std::string Show(const Token& token) {
    if (token.text.empty()) return "the end of the file";
    constexpr std::size_t kLongest = 40;
    std::string shown;
    for (const char c : token.text.substr(0, kLongest)) {
      shown += c >= 32 && c < 127 ? c : '?';
    }
    return "'" + shown + "'";
  }

  static bool IsBlank(char c) {
    return c == ' ' || c == '\t' || c == '\r' || c == '\n';
  }

  // The next word; a word ends at blanks only.
  Token Next() {
    while (!rest_.empty() && IsBlank(rest_.front())) {
      if (rest_.front() == '\n') ++line_;
      rest_.remove_prefix(1);
    }
    std::size_t size = 0;
    while (size < rest_.size() && !IsBlank(rest_[size])) ++size;
    const Token token{rest_.substr(0, size), line_};
    rest_.remove_prefix(size);
    return token;
  }

  void Expect(std::string_view word) {
    const Token token = Next();
    if (token.text != word) {
      Fail(token, "expected " + std::string(word) + ", found " + Show(token));
    }
  }

  double Number(const char* what) {
    const Token token = Next();
    std::string_view text = token.text;
    if (text.starts_with('+')) text.remove_prefix(1);
    double number = 0;
    const auto [end, error] =
        std::from_chars(text.data(), text.data() + text.size(), number);
    if (text.empty() || error != std::errc() ||
        end != text.data() + text.size() || !std::isfinite(number)) {
      Fail(token, std::string(what) + " is not a number but " + Show(token));
    }
    return number;
  }

  int Count(const char* what) {
    const Token token = Next();
    int count = 0;
    const char* const last = token.text.data() + token.text.size();
    const auto [end, error] = std::from_chars(token.text.data(), last, count);
    if (token.text.empty() || error != std::errc() || end != last ||
        count < 0) {
      Fail(token, std::string(what) + " is not a count but " + Show(token));
    }
    return count;
  }

  Vector3d ReadOffset() {
    Expect("OFFSET");
    Vector3d offset;
    for (int i = 0; i < 3; ++i) offset[i] = Number("OFFSET");
    return offset;
  }

  void ReadJoint(int parent, int depth) {
    // Names may hold blanks: the rest of the line is the name.
    const Token name = RestOfLine();
    if (name.text.empty()) Fail(name, "a joint without a name");
    if (!names_.insert(std::string(name.text)).second) {
      Fail(name, "a second joint " + Show(name));
    }
    Add(name, parent, depth);
    const int joint = static_cast<int>(motion_.joints.size()) - 1;
    motion_.joints[joint].name = name.text;
    Expect("{");
    motion_.joints[joint].offset = ReadOffset();
    bool has_channels = false;
    for (Token token = Next(); token.text != "}"; token = Next()) {
      if (token.text == "CHANNELS") {
        if (has_channels) Fail(token, "CHANNELS twice in one joint");
        has_channels = true;
        ReadChannels(joint);
      } else if (token.text == "JOINT") {
        ReadJoint(joint, depth + 1);
      } else if (token.text == "End") {
        ReadEndSite(token, joint, depth + 1);
      } else {
        Fail(token,
             "expected CHANNELS, JOINT, End Site or }, found " + Show(token));
      }
    }
  }

  void ReadEndSite(const Token& where, int parent, int depth) {
    Expect("Site");
    Add(where, parent, depth);
    const std::size_t joint = motion_.joints.size() - 1;
    Expect("{");
    motion_.joints[joint].offset = ReadOffset();
    Expect("}");
  }

  void Add(const Token& where, int parent, int depth) {
    if (motion_.joints.size() >= kMaxJoints || depth > kMaxDepth) {
      Fail(where, "the hierarchy is too large");
    }
    BvhJoint joint;
    joint.parent = parent;
    joint.first_channel = num_channels_;
    motion_.joints.push_back(joint);
  }

  void ReadChannels(int joint) {
    const int count = Count("CHANNELS");
    BvhJoint& target = motion_.joints[joint];
    target.first_channel = num_channels_;
    for (int i = 0; i < count; ++i) {
      const Token token = Next();
      int channel = 0;
      while (channel < 6 && !SameWord(token.text, kChannelNames[channel])) {
        ++channel;
      }
      if (channel == 6) Fail(token, "no channel is called " + Show(token));
      for (const BvhChannel earlier : target.channels) {
        if (static_cast<int>(earlier) == channel) {
          Fail(token, "channel " + Show(token) + " twice in one joint");
        }
      }
      target.channels.push_back(static_cast<BvhChannel>(channel));
    }
    num_channels_ += count;
  }

  // Some writers say XPosition.
  static bool SameWord(std::string_view a, std::string_view b) {
    return a.size() == b.size() &&
           std::equal(a.begin(), a.end(), b.begin(), [](char x, char y) {
             return std::tolower(static_cast<unsigned char>(x)) ==
                    std::tolower(static_cast<unsigned char>(y));
           });
  }

  // What is left of this line, without blanks around it.
  Token RestOfLine() {
    std::string_view text = rest_.substr(0, rest_.find('\n'));
    rest_.remove_prefix(text.size());
    while (!text.empty() && IsBlank(text.front())) text.remove_prefix(1);
    while (!text.empty() && IsBlank(text.back())) text.remove_suffix(1);
    // The brace may stand on the same line.
    if (text.ends_with('{')) {
      rest_ = std::string_view(
          text.data() + text.size() - 1,
          rest_.data() + rest_.size() - (text.data() + text.size() - 1));
      text.remove_suffix(1);
      while (!text.empty() && IsBlank(text.back())) text.remove_suffix(1);
    }
    return {text, line_};
  }

  void ReadMotion() {
    Expect("Frames:");
    const int num_frames = Count("Frames");
    if (num_frames == 0) Fail({"", line_}, "a motion without frames");
    Expect("Frame");
    Expect("Time:");
    motion_.frame_time = Number("Frame Time");
    if (motion_.frame_time <= 0) {
      Fail({"", line_}, "Frame Time is not positive");
    }
    // The file must be at least as long as the values that it promises.
    if (static_cast<double>(num_frames) * num_channels_ > rest_.size()) {
      Fail({"", line_},
           "the file ends before its " + std::to_string(num_frames) +
               " frames do");
    }
    motion_.values.resize(num_frames, num_channels_);
    for (int frame = 0; frame < num_frames; ++frame) ReadFrame(frame);
    const Token token = Next();
    if (!token.text.empty()) {
      Fail(token,
           "more than the " + std::to_string(num_frames) +
               " frames announced: " + Show(token));
    }
  }

  // A frame is a line.
  void ReadFrame(int frame) {
    int line = 0;
    for (int channel = 0; channel < num_channels_; ++channel) {
      const std::string_view before = rest_;
      const int line_before = line_;
      const Token token = Next();
      if (token.text.empty()) {
        Fail(token,
             "the file ends in frame " + std::to_string(frame + 1) + " of " +
                 std::to_string(motion_.num_frames()));
      }
      if (channel == 0) line = token.line;
      if (token.line != line) {
        Fail({"", line},
             "frame " + std::to_string(frame + 1) + " has " +
                 std::to_string(channel) + " values, not " +
                 std::to_string(num_channels_));
      }
      rest_ = before;
      line_ = line_before;
      motion_.values(frame, channel) = Number("a value");
    }
    const Token extra = RestOfLine();
    if (!extra.text.empty()) {
      Fail(extra,
           "frame " + std::to_string(frame + 1) + " has more than its " +
               std::to_string(num_channels_) + " values");
    }
  }

  std::string_view rest_;
  std::string source_;
  int line_ = 1;
  int num_channels_ = 0;
  std::set<std::string> names_;
  BvhMotion motion_;
};

// ------------------------------------------------------------- kinematics

bool IsRotation(BvhChannel channel) {
  return channel >= BvhChannel::kXRotation;
}

int AxisOf(BvhChannel channel) { return static_cast<int>(channel) % 3; }

// The joints' frames; without a frame number those of the rest pose.
BvhFrames Frames(const BvhMotion& motion, int frame) {
  BvhFrames frames;
  frames.world_from_joint.reserve(motion.joints.size());
  frames.joint_in_world.reserve(motion.joints.size());
  for (const BvhJoint& joint : motion.joints) {
    Vector3d joint_in_parent = joint.offset;
    Matrix3d parent_from_joint = Matrix3d::Identity();
    for (std::size_t i = 0; frame >= 0 && i < joint.channels.size(); ++i) {
      const BvhChannel channel = joint.channels[i];
      const double value = motion.values(
          frame, joint.first_channel + static_cast<Eigen::Index>(i));
      if (IsRotation(channel)) {
        parent_from_joint =
            parent_from_joint *
            Eigen::AngleAxisd(value * kDegree, Vector3d::Unit(AxisOf(channel)));
      } else {
        joint_in_parent[AxisOf(channel)] = value;
      }
    }
    if (joint.parent < 0) {
      frames.world_from_joint.push_back(parent_from_joint);
      frames.joint_in_world.push_back(joint_in_parent);
      continue;
    }
    const Matrix3d& world_from_parent = frames.world_from_joint[joint.parent];
    frames.joint_in_world.push_back(frames.joint_in_world[joint.parent] +
                                    world_from_parent * joint_in_parent);
    frames.world_from_joint.push_back(world_from_parent * parent_from_joint);
  }
  return frames;
}

// ---------------------------------------------------------------- writing

void AppendNumbers(const Eigen::Ref<const Eigen::VectorXd>& numbers,
                   std::string* text) {
  char number[40];
  for (Eigen::Index i = 0; i < numbers.size(); ++i) {
    // Adding zero turns -0 into 0.
    std::snprintf(number, sizeof(number), "%.8f", numbers[i] + 0.0);
    *text += i == 0 ? "" : " ";
    *text += std::string_view(number) == "-0.00000000" ? number + 1 : number;
  }
}

void AppendJoint(const BvhMotion& motion,
                 const std::vector<std::vector<int>>& children,
                 int index,
                 int depth,
                 std::string* text) {
  const BvhJoint& joint = motion.joints[index];
  const std::string indent(depth, '\t');
  if (joint.is_end_site()) {
    *text += indent + "End Site\n";
  } else {
    *text +=
        indent + (joint.parent < 0 ? "ROOT " : "JOINT ") + joint.name + "\n";
  }
  *text += indent + "{\n" + indent + "\tOFFSET ";
  AppendNumbers(joint.offset, text);
  *text += "\n";
  if (!joint.channels.empty()) {
    *text += indent + "\tCHANNELS " + std::to_string(joint.channels.size());
    for (const BvhChannel channel : joint.channels) {
      *text += " " + std::string(kChannelNames[static_cast<int>(channel)]);
    }
    *text += "\n";
  }
  for (const int child : children[index]) {
    AppendJoint(motion, children, child, depth + 1, text);
  }
  *text += indent + "}\n";
}

// Angles z, x, y in degrees with R = Rz Rx Ry, near to those before.
Vector3d AnglesZxy(const Matrix3d& rotation, const Vector3d& before) {
  const double sine = std::clamp(rotation(2, 1), -1.0, 1.0);
  Vector3d angles;
  // Within a thousandth of a degree of 90 the other two angles turn about the
  // same axis: keep z and leave the rest to y.
  if (std::abs(sine) > 1 - 1e-10) {
    const double z = before[0] * kDegree;
    const double x = std::copysign(std::numbers::pi / 2, sine);
    const Matrix3d about_y = (Eigen::AngleAxisd(z, Vector3d::UnitZ()) *
                              Eigen::AngleAxisd(x, Vector3d::UnitX()))
                                 .toRotationMatrix()
                                 .transpose() *
                             rotation;
    angles = {z, x, std::atan2(about_y(0, 2), about_y(0, 0))};
  } else {
    angles = {std::atan2(-rotation(0, 1), rotation(1, 1)),
              std::asin(sine),
              std::atan2(-rotation(2, 0), rotation(2, 2))};
  }
  angles /= kDegree;
  const auto nearest = [&before](Vector3d candidate) {
    for (int i = 0; i < 3; ++i) {
      candidate[i] += 360 * std::round((before[i] - candidate[i]) / 360);
    }
    return candidate;
  };
  const Vector3d first = nearest(angles);
  const Vector3d second =
      nearest({angles[0] + 180, 180 - angles[1], angles[2] + 180});
  return (second - before).squaredNorm() < (first - before).squaredNorm()
             ? second
             : first;
}

// ----------------------------------------------------------- our skeleton

constexpr int kLCollar = kNumJoints;  // indices after those of Joint
constexpr int kRCollar = kNumJoints + 1;

struct OurJoint {
  const char* name;  // nullptr: an End Site
  int joint;
  int parent;  // index into the table
};
// Depth first, as the file lists them.
constexpr std::array<OurJoint, kNumJoints + 2> kOurJoints = {{
    {"root", kRoot, -1},
    {"spine", kSpine, 0},
    {"neck", kNeck, 1},
    {"head", kHead, 2},
    {nullptr, kHeadEnd, 3},
    {"l_collar", kLCollar, 2},
    {"l_shoulder", kLShoulder, 5},
    {"l_elbow", kLElbow, 6},
    {"l_wrist", kLWrist, 7},
    {nullptr, kLHandEnd, 8},
    {"r_collar", kRCollar, 2},
    {"r_shoulder", kRShoulder, 10},
    {"r_elbow", kRElbow, 11},
    {"r_wrist", kRWrist, 12},
    {nullptr, kRHandEnd, 13},
    {"l_hip", kLHip, 0},
    {"l_knee", kLKnee, 15},
    {"l_ankle", kLAnkle, 16},
    {nullptr, kLFootEnd, 17},
    {"r_hip", kRHip, 0},
    {"r_knee", kRKnee, 19},
    {"r_ankle", kRAnkle, 20},
    {nullptr, kRFootEnd, 21},
}};

BvhMotion OurHierarchy(const Skeleton& skeleton) {
  BvhMotion motion;
  int num_channels = 0;
  for (const OurJoint& ours : kOurJoints) {
    BvhJoint joint;
    joint.parent = ours.parent;
    joint.offset.setZero();
    if (ours.parent >= 0 && ours.joint < kNumJoints) {
      joint.offset = kFileUnitsPerMetre * skeleton.length[ours.joint] *
                     skeleton.rest_direction[ours.joint];
    }
    joint.first_channel = num_channels;
    if (ours.name != nullptr) {
      joint.name = ours.name;
      if (ours.parent < 0) {
        joint.channels = {BvhChannel::kXPosition,
                          BvhChannel::kYPosition,
                          BvhChannel::kZPosition};
      }
      joint.channels.insert(joint.channels.end(),
                            {BvhChannel::kZRotation,
                             BvhChannel::kXRotation,
                             BvhChannel::kYRotation});
      num_channels += static_cast<int>(joint.channels.size());
    }
    motion.joints.push_back(joint);
  }
  motion.values.resize(0, num_channels);
  return motion;
}

// Rotation against the parent in the file of entry `index` of kOurJoints.
Eigen::Quaterniond OurRotation(const Pose& pose, int index) {
  const int joint = kOurJoints[index].joint;
  if (joint == kLCollar) return pose.collar[0];
  if (joint == kRCollar) return pose.collar[1];
  // A collar moves the shoulder without turning it; in the file it turns it.
  if (joint == kLShoulder)
    return pose.collar[0].conjugate() * pose.rotation[joint];
  if (joint == kRShoulder)
    return pose.collar[1].conjugate() * pose.rotation[joint];
  return pose.rotation[joint];
}

}  // namespace

int BvhMotion::Find(const std::string& name) const {
  for (std::size_t i = 0; i < joints.size(); ++i) {
    if (!joints[i].is_end_site() && joints[i].name == name) {
      return static_cast<int>(i);
    }
  }
  return -1;
}

BvhMotion ParseBvh(const std::string& text, const std::string& source) {
  return Reader(text, source).Read();
}

BvhMotion LoadBvh(const std::string& path) {
  return ParseBvh(ReadWholeFile(path), path);
}

std::string BvhToText(const BvhMotion& motion) {
  std::vector<std::vector<int>> children(motion.joints.size());
  for (std::size_t i = 1; i < motion.joints.size(); ++i) {
    children[motion.joints[i].parent].push_back(static_cast<int>(i));
  }
  std::string text = "HIERARCHY\n";
  AppendJoint(motion, children, 0, 0, &text);
  char line[80];
  std::snprintf(line,
                sizeof(line),
                "MOTION\nFrames: %d\nFrame Time: %.10g\n",
                motion.num_frames(),
                motion.frame_time);
  text += line;
  for (int frame = 0; frame < motion.num_frames(); ++frame) {
    AppendNumbers(motion.values.row(frame).transpose(), &text);
    text += "\n";
  }
  return text;
}

void SaveBvh(const BvhMotion& motion, const std::string& path) {
  WriteWholeFile(BvhToText(motion), path);
}

BvhFrames BvhRestFrames(const BvhMotion& motion) { return Frames(motion, -1); }

BvhFrames BvhFramesAt(const BvhMotion& motion, int frame) {
  CHECK(frame >= 0 && frame < motion.num_frames()) << "frame " << frame;
  return Frames(motion, frame);
}

BvhMotion BvhFromPoses(const Skeleton& skeleton,
                       const std::vector<Pose>& poses,
                       double frame_time) {
  CHECK_GT(frame_time, 0);
  BvhMotion motion = OurHierarchy(skeleton);
  motion.frame_time = frame_time;
  motion.values.setZero(static_cast<Eigen::Index>(poses.size()),
                        motion.values.cols());
  std::vector<Vector3d> before(kOurJoints.size(), Vector3d::Zero());
  for (std::size_t frame = 0; frame < poses.size(); ++frame) {
    auto row = motion.values.row(static_cast<Eigen::Index>(frame));
    row.head<3>() = kFileUnitsPerMetre * poses[frame].root_in_world.transpose();
    for (std::size_t i = 0; i < kOurJoints.size(); ++i) {
      const BvhJoint& joint = motion.joints[i];
      if (joint.is_end_site()) continue;
      const Eigen::Quaterniond rotation =
          OurRotation(poses[frame], static_cast<int>(i)).normalized();
      before[i] = AnglesZxy(rotation.toRotationMatrix(), before[i]);
      row.segment<3>(joint.first_channel + (i == 0 ? 3 : 0)) =
          before[i].transpose();
    }
  }
  return motion;
}

BvhPoses PosesFromBvh(const BvhMotion& motion, const std::string& source) {
  BvhPoses result;
  const BvhMotion ours = OurHierarchy(result.skeleton = [] {
    Skeleton empty;
    empty.rest_direction.fill(Vector3d::Zero());
    empty.length.fill(0);
    return empty;
  }());
  bool same = motion.joints.size() == ours.joints.size();
  for (std::size_t i = 0; same && i < ours.joints.size(); ++i) {
    same = motion.joints[i].name == ours.joints[i].name &&
           motion.joints[i].parent == ours.joints[i].parent &&
           motion.joints[i].channels == ours.joints[i].channels;
  }
  if (!same) {
    throw InputError(source + ": not the skeleton that sweepfit writes");
  }
  for (std::size_t i = 0; i < kOurJoints.size(); ++i) {
    const int joint = kOurJoints[i].joint;
    if (joint == kRoot || joint >= kNumJoints) continue;
    const double length = motion.joints[i].offset.norm();
    result.skeleton.length[joint] = length / kFileUnitsPerMetre;
    result.skeleton.rest_direction[joint] =
        length > 0 ? Vector3d(motion.joints[i].offset / length)
                   : Vector3d(Vector3d::UnitY());
  }
  result.skeleton.rest_direction[kRoot] = Vector3d::UnitY();
  for (int frame = 0; frame < motion.num_frames(); ++frame) {
    const BvhFrames frames = BvhFramesAt(motion, frame);
    Pose pose;
    pose.root_in_world = frames.joint_in_world[0] / kFileUnitsPerMetre;
    for (std::size_t i = 0; i < kOurJoints.size(); ++i) {
      const BvhJoint& joint = motion.joints[i];
      if (joint.is_end_site()) continue;
      Matrix3d rotation = frames.world_from_joint[i];
      if (joint.parent >= 0) {
        rotation = frames.world_from_joint[joint.parent].transpose() * rotation;
      }
      const int target = kOurJoints[i].joint;
      if (target == kLCollar) {
        pose.collar[0] = Eigen::Quaterniond(rotation);
      } else if (target == kRCollar) {
        pose.collar[1] = Eigen::Quaterniond(rotation);
      } else if (target == kLShoulder) {
        pose.rotation[target] = pose.collar[0] * Eigen::Quaterniond(rotation);
      } else if (target == kRShoulder) {
        pose.rotation[target] = pose.collar[1] * Eigen::Quaterniond(rotation);
      } else {
        pose.rotation[target] = Eigen::Quaterniond(rotation);
      }
    }
    result.poses.push_back(pose);
  }
  return result;
}

}  // namespace sweepfit
