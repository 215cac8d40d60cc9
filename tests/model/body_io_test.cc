// SPDX-License-Identifier: Apache-2.0
#include "model/body_io.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "model/file_io.h"
#include "model/input_error.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/toy_body.h"

namespace sweepfit {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::ordered_json;

class BodyIoTest : public ::testing::Test {
 protected:
  BodyIoTest() {
    body_ = ToyBody(6);
    for (int v = 0; v < body_.num_vertices(); ++v) {
      body_.displacement_in_section[v] =
          Eigen::Vector3d(std::sin(v), std::cos(v), std::exp(-v)) / 300;
    }
    body_.topology.uv[3][1] = Eigen::Vector2f(1.0f / 3, 0.1f);
    body_.sex = 1.0 / 3;
    body_.stature = 1.6543217890123456;
    body_.mass = 71.1;
  }
  ~BodyIoTest() override { std::remove(path_.c_str()); }

  std::string ErrorOf(const std::string& text) const {
    WriteWholeFile(text, path_);
    try {
      LoadBody(path_);
    } catch (const InputError& error) {
      return error.what();
    }
    return "no error";
  }

  Body body_;
  TemporaryFolder folder_;
  std::string path_ = (folder_.path() / "body.json").string();
};

TEST_F(BodyIoTest, RoundTripPosesToTheSameBytes) {
  SaveBody(body_, path_);
  const Body loaded = LoadBody(path_);
  EXPECT_EQ(loaded.sex, body_.sex);
  EXPECT_EQ(loaded.stature, body_.stature);
  EXPECT_EQ(loaded.mass, body_.mass);
  EXPECT_EQ(loaded.topology.quads, body_.topology.quads);
  EXPECT_EQ(loaded.topology.uv, body_.topology.uv);
  EXPECT_EQ(loaded.topology.mirror_vertex, body_.topology.mirror_vertex);
  EXPECT_EQ(loaded.topology.part, body_.topology.part);
  ASSERT_EQ(loaded.sweeps.size(), body_.sweeps.size());
  for (std::size_t i = 0; i < body_.sweeps.size(); ++i) {
    EXPECT_EQ(loaded.sweeps[i].name, body_.sweeps[i].name);
    EXPECT_EQ(loaded.sweeps[i].feature_weight, body_.sweeps[i].feature_weight);
  }
  for (unsigned seed = 0; seed < 3; ++seed) {
    const Pose pose = RandomPose(1.0, seed);
    EXPECT_EQ(PoseVertices(loaded, pose), PoseVertices(body_, pose));
  }
}

TEST_F(BodyIoTest, SavingTwiceGivesTheSameBytes) {
  SaveBody(body_, path_);
  const std::string first = ReadWholeFile(path_);
  SaveBody(LoadBody(path_), path_);
  EXPECT_EQ(ReadWholeFile(path_), first);
}

TEST_F(BodyIoTest, EveryFaultIsNamed) {
  SaveBody(body_, path_);
  const std::string sound_text = ReadWholeFile(path_);
  ASSERT_EQ(ErrorOf(sound_text), "no error");
  const Json sound = Json::parse(sound_text);

  struct Fault {
    std::string expected;
    std::function<void(Json*)> apply;
  };
  const std::vector<Fault> faults = {
      {"format is not 'sweepfit-body'",
       [](Json* j) { (*j)["format"] = "other"; }},
      {"version is not supported", [](Json* j) { (*j)["version"] = 2; }},
      {"misses 'format'", [](Json* j) { j->erase("format"); }},
      {"misses 'sweeps'", [](Json* j) { j->erase("sweeps"); }},
      {"unknown key 'extra'", [](Json* j) { (*j)["extra"] = 1; }},
      {"mass is not a number", [](Json* j) { (*j)["mass"] = nullptr; }},
      {"stature is not positive", [](Json* j) { (*j)["stature"] = -1.7; }},
      {"skeleton misses 'l_knee'",
       [](Json* j) { (*j)["skeleton"].erase("l_knee"); }},
      {"skeleton.l_knee.length is not positive",
       [](Json* j) { (*j)["skeleton"]["l_knee"]["length"] = 0; }},
      {"skeleton.neck.rest_direction is not a unit vector",
       [](Json* j) {
         (*j)["skeleton"]["neck"]["rest_direction"] = {1, 1, 0};
       }},
      {"sweeps[1].chain[1] does not follow",
       [](Json* j) { (*j)["sweeps"][1]["chain"][1] = "head"; }},
      {"sweeps[1].chain[0] is no joint: 'tail'",
       [](Json* j) { (*j)["sweeps"][1]["chain"][0] = "tail"; }},
      {"sweeps[0].rest_reference lies along the first bone",
       [](Json* j) {
         (*j)["sweeps"][0]["rest_reference"] =
             (*j)["skeleton"]["spine"]["rest_direction"];
       }},
      {"sweeps[0].key_u[3] does not ascend",
       [](Json* j) { (*j)["sweeps"][0]["key_u"][3] = 0; }},
      {"sweeps[0].radius[2] has 15 entries instead of 16",
       [](Json* j) { (*j)["sweeps"][0]["radius"][2].erase(0); }},
      {"sweeps[0].radius is not positive",
       [](Json* j) { (*j)["sweeps"][0]["radius"][2][0] = 0; }},
      {"sweeps[1].log_ratio has",
       [](Json* j) { (*j)["sweeps"][1]["log_ratio"].erase(0); }},
      {"sweeps[1].rigid_end is neither",
       [](Json* j) { (*j)["sweeps"][1]["rigid_end"] = 1; }},
      {"topology.quads[5][2] is 100000, not within",
       [](Json* j) { (*j)["topology"]["quads"][5][2] = 100000; }},
      {"topology.quads[5][2] is not an integer",
       [](Json* j) { (*j)["topology"]["quads"][5][2] = 1.5; }},
      {"topology.part[0] is no part of a body: 'tail'",
       [](Json* j) { (*j)["topology"]["part"][0] = "tail"; }},
      {"topology.mirror_vertex[1] is -1",
       [](Json* j) { (*j)["topology"]["mirror_vertex"][1] = -1; }},
      {"topology.uv has", [](Json* j) { (*j)["topology"]["uv"].erase(0); }},
      {"binding[4][0][0] is 2, not within 0..1",
       [](Json* j) { (*j)["binding"][4][0][0] = 2; }},
      {"binding[4] has 0 attachments",
       [](Json* j) { (*j)["binding"][4] = Json::array(); }},
      {"binding[4] has weights that do not sum to 1",
       [](Json* j) { (*j)["binding"][4][0][1] = 0.4; }},
      {"binding[4][0] has 5 entries",
       [](Json* j) { (*j)["binding"][4][0].erase(0); }},
      {"displacement_in_section[7][1] is not a number",
       [](Json* j) { (*j)["displacement_in_section"][7][1] = "x"; }},
      {"displacement_in_section has",
       [](Json* j) { (*j)["displacement_in_section"].erase(0); }},
  };
  for (const Fault& fault : faults) {
    Json broken = sound;
    fault.apply(&broken);
    EXPECT_THAT(ErrorOf(broken.dump()), HasSubstr(fault.expected));
    EXPECT_THAT(ErrorOf(broken.dump()), HasSubstr(path_));
  }
}

TEST_F(BodyIoTest, TruncatedAndOverflowingFilesAreRefused) {
  SaveBody(body_, path_);
  const std::string sound = ReadWholeFile(path_);
  for (const double part : {0.0, 0.1, 0.5, 0.9, 0.9999}) {
    const auto size = static_cast<std::size_t>(part * sound.size());
    EXPECT_THAT(ErrorOf(sound.substr(0, size)), HasSubstr("not sound JSON"));
  }
  EXPECT_THAT(ErrorOf("[]"), HasSubstr("is not an object"));
  std::string huge = sound;
  huge.replace(huge.find("71.1"), 4, "1e999");
  EXPECT_THAT(ErrorOf(huge), HasSubstr("beyond the range"));
}

TEST_F(BodyIoTest, MissingFilesAndFoldersAreRefused) {
  EXPECT_THROW(LoadBody("/no/such/body.json"), InputError);
  EXPECT_THROW(LoadBody(::testing::TempDir()), InputError);
  EXPECT_THROW(SaveBody(body_, "/no/such/folder/body.json"), InputError);
}

}  // namespace
}  // namespace sweepfit
