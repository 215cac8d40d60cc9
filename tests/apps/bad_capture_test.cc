// SPDX-License-Identifier: Apache-2.0
//
// Broken captures through the command: each ends with a status that says so,
// one line that says why, and no result folder.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "experiments/synthetic.h"
#include "tests/apps/command.h"

namespace sweepfit {
namespace {

namespace fs = std::filesystem;
using ::testing::AnyOf;
using ::testing::Eq;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr char kBadCamera[] = "cam01";

// A copy of a sound capture that a case may break in any way.
class Scene {
 public:
  Scene(const fs::path& sound, const fs::path& folder) : folder_(folder) {
    fs::copy(sound, folder, fs::copy_options::recursive);
    out_ = folder.parent_path() / "result";
    arguments_ = {"fit", folder.string(), "--out"};
  }

  const fs::path& folder() const { return folder_; }
  const fs::path& out() const { return out_; }
  void set_out(const fs::path& out) { out_ = out; }
  void set_capture(const fs::path& capture) { arguments_[1] = capture; }

  // Edits capture.yaml as a tree; `edit` gets its root.
  void Edit(const std::function<void(YAML::Node)>& edit) const {
    YAML::Node root = YAML::LoadFile(Yaml());
    edit(root);
    YAML::Emitter out;
    out << root;
    WriteBytes(Yaml(), out.c_str());
  }
  void EditCamera(const std::function<void(YAML::Node)>& edit) const {
    Edit([&](YAML::Node root) { edit(root["cameras"][1]); });
  }
  void EditPose(const std::function<void(YAML::Node)>& edit) const {
    Edit([&](YAML::Node root) { edit(root["poses"][0]); });
  }
  std::string Yaml() const { return (folder_ / "capture.yaml").string(); }

  // Path of one camera's picture, plate.
  fs::path Image(const std::string& camera = kBadCamera) const {
    const YAML::Node root = YAML::LoadFile(Yaml());
    return folder_ / root["poses"][0]["images"][camera].as<std::string>();
  }
  fs::path Plate(int camera) const {
    const YAML::Node root = YAML::LoadFile(Yaml());
    return folder_ / root["cameras"][camera]["background"].as<std::string>();
  }
  int NumCameras() const {
    return static_cast<int>(YAML::LoadFile(Yaml())["cameras"].size());
  }
  // Replaces one camera's picture by a PNG.
  void ReplaceImage(const cv::Mat& picture) const {
    cv::imwrite((folder_ / "replaced.png").string(), picture);
    EditPose(
        [](YAML::Node pose) { pose["images"][kBadCamera] = "replaced.png"; });
  }
  // Gives every camera the silhouette that `make` draws for it.
  void GiveMasks(const std::function<cv::Mat1b(const std::string& camera,
                                               cv::Size size)>& make) const {
    Edit([&](YAML::Node root) {
      for (const YAML::Node& camera : root["cameras"]) {
        const std::string id = camera["id"].as<std::string>();
        const cv::Size size(camera["width"].as<int>(),
                            camera["height"].as<int>());
        const std::string name = "given_" + id + ".png";
        cv::imwrite((folder_ / name).string(), make(id, size));
        root["poses"][0]["masks"][id] = name;
      }
    });
  }

  void Argue(const std::vector<std::string>& more) {
    arguments_.insert(arguments_.end(), more.begin(), more.end());
  }
  std::vector<std::string> Arguments() const {
    std::vector<std::string> arguments = arguments_;
    arguments.insert(arguments.begin() + 3, out_.string());
    return arguments;
  }

 private:
  fs::path folder_;
  fs::path out_;
  std::vector<std::string> arguments_;
};

cv::Mat1b Disc(cv::Size size) {
  cv::Mat1b mask(size, 0);
  cv::circle(mask,
             {size.width / 2, size.height / 2},
             size.height / 4,
             cv::Scalar(255),
             cv::FILLED);
  return mask;
}

enum class Ends {
  kBadInput,        // status 2
  kFails,           // 1 or 2
  kMayBeTolerated,  // or 0
};

struct Case {
  const char* name;
  Ends ends;
  const char* word;  // the error line contains it
  std::function<void(Scene*)> prepare;
};

std::vector<Case> BrokenFiles() {
  return {
      {"no folder",
       Ends::kBadInput,
       "nowhere",
       [](Scene* s) { s->set_capture(s->folder() / "nowhere"); }},
      {"a file instead of the folder",
       Ends::kBadInput,
       "capture.yaml",
       [](Scene* s) { s->set_capture(s->Yaml()); }},
      {"no capture.yaml",
       Ends::kBadInput,
       "capture.yaml",
       [](Scene* s) { fs::remove(s->Yaml()); }},
      {"capture.yaml is a folder",
       Ends::kBadInput,
       "capture.yaml",
       [](Scene* s) {
         fs::remove(s->Yaml());
         fs::create_directory(s->Yaml());
       }},
      {"malformed YAML",
       Ends::kBadInput,
       "capture.yaml",
       [](Scene* s) { WriteBytes(s->Yaml(), "cameras: [{id: a\nposes"); }},
      {"missing picture",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) { fs::remove(s->Image()); }},
      {"a folder instead of a picture",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         const fs::path image = s->Image();
         fs::remove(image);
         fs::create_directory(image);
       }},
      {"truncated JPEG",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         const fs::path cut = s->folder() / "cut.jpg";
         cv::imwrite(cut.string(), cv::imread(s->Image().string()));
         fs::resize_file(cut, fs::file_size(cut) / 2);
         s->EditPose(
             [](YAML::Node pose) { pose["images"][kBadCamera] = "cut.jpg"; });
       }},
      {"no picture but text",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) { WriteBytes(s->Image(), "this is no picture"); }},
      {"empty picture file",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) { WriteBytes(s->Image(), ""); }},
      {"a picture of one pixel",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) { s->ReplaceImage(cv::Mat3b(1, 1, cv::Vec3b(9, 9, 9))); }},
      {"picture of another size",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         s->ReplaceImage(cv::Mat3b(50, 60, cv::Vec3b(9, 9, 9)));
       }},
      {"missing plate",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) { fs::remove(s->Plate(1)); }},
      {"plate of another size",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         cv::imwrite(s->Plate(1).string(),
                     cv::Mat3b(50, 60, cv::Vec3b(9, 9, 9)));
       }},
  };
}

std::vector<Case> BrokenKeys() {
  return {
      {"version 2",
       Ends::kBadInput,
       "version",
       [](Scene* s) { s->Edit([](YAML::Node n) { n["version"] = 2; }); }},
      {"unknown unit",
       Ends::kBadInput,
       "furlong",
       [](Scene* s) { s->Edit([](YAML::Node n) { n["units"] = "furlong"; }); }},
      {"unknown up axis",
       Ends::kBadInput,
       "up",
       [](Scene* s) { s->Edit([](YAML::Node n) { n["up"] = "w"; }); }},
      {"unknown key",
       Ends::kBadInput,
       "camaras",
       [](Scene* s) { s->Edit([](YAML::Node n) { n["camaras"] = 1; }); }},
      {"unknown key of a camera",
       Ends::kBadInput,
       "focal",
       [](Scene* s) { s->EditCamera([](YAML::Node n) { n["focal"] = 1; }); }},
      {"missing key of a camera",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) { s->EditCamera([](YAML::Node n) { n.remove("t"); }); }},
      {"duplicate camera",
       Ends::kBadInput,
       "cam00",
       [](Scene* s) {
         s->EditCamera([](YAML::Node n) { n["id"] = "cam00"; });
       }},
      {"NaN in K",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         s->EditCamera([](YAML::Node n) { n["K"][2] = ".nan"; });
       }},
      {"text in K",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         s->EditCamera([](YAML::Node n) { n["K"][0] = "wide"; });
       }},
      {"negative focal length",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) { s->EditCamera([](YAML::Node n) { n["K"][0] = -900; }); }},
      {"reflected R",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         s->EditCamera([](YAML::Node n) {
           for (int i = 0; i < 3; ++i) n["R"][i] = -n["R"][i].as<double>();
         });
       }},
      {"R that is no rotation",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) { s->EditCamera([](YAML::Node n) { n["R"][4] = 3.0; }); }},
      {"short t",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         s->EditCamera([](YAML::Node n) { n["t"] = std::vector<int>{1, 2}; });
       }},
      {"wrong width",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) { s->EditCamera([](YAML::Node n) { n["width"] = 777; }); }},
      {"bad chroma key",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         s->EditCamera([](YAML::Node n) { n["chroma_key"] = "plaid"; });
       }},
      {"one camera",
       Ends::kBadInput,
       "two cameras",
       [](Scene* s) {
         s->Edit([](YAML::Node n) {
           YAML::Node one;
           one.push_back(n["cameras"][0]);
           n["cameras"] = one;
         });
       }},
      {"all but one camera held out",
       Ends::kBadInput,
       "two cameras",
       [](Scene* s) {
         s->Edit([](YAML::Node n) {
           YAML::Node held;
           for (size_t i = 1; i < n["cameras"].size(); ++i) {
             held.push_back(n["cameras"][i]["id"].as<std::string>());
           }
           n["holdout"] = held;
         });
       }},
      {"holdout of an unknown camera",
       Ends::kBadInput,
       "cam99",
       [](Scene* s) {
         s->Edit([](YAML::Node n) {
           n["holdout"] = std::vector<std::string>{"cam99"};
         });
       }},
      {"picture of an unknown camera",
       Ends::kBadInput,
       "cam99",
       [](Scene* s) {
         s->EditPose([](YAML::Node n) {
           n["images"]["cam99"] = n["images"][kBadCamera];
         });
       }},
      {"camera without a picture",
       Ends::kMayBeTolerated,
       kBadCamera,
       [](Scene* s) {
         s->EditPose([](YAML::Node n) { n["images"].remove(kBadCamera); });
       }},
      {"the same pose twice",
       Ends::kBadInput,
       "A",
       [](Scene* s) {
         s->Edit([](YAML::Node n) {
           n["poses"].push_back(YAML::Clone(n["poses"][0]));
         });
       }},
      {"no poses",
       Ends::kBadInput,
       "poses",
       [](Scene* s) { s->Edit([](YAML::Node n) { n.remove("poses"); }); }},
  };
}

std::vector<Case> BrokenSilhouettes() {
  return {
      {"empty mask",
       Ends::kFails,
       kBadCamera,
       [](Scene* s) {
         s->GiveMasks([](const std::string& camera, cv::Size size) {
           return camera == kBadCamera ? cv::Mat1b(size, 0) : Disc(size);
         });
       }},
      {"all masks empty",
       Ends::kFails,
       "cam00",
       [](Scene* s) {
         s->GiveMasks([](const std::string&, cv::Size size) {
           return cv::Mat1b(size, 0);
         });
       }},
      {"all-white masks",
       Ends::kFails,
       "",
       [](Scene* s) {
         s->GiveMasks([](const std::string&, cv::Size size) {
           return cv::Mat1b(size, 255);
         });
       }},
      {"mask of another size",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         s->GiveMasks([](const std::string& camera, cv::Size size) {
           return Disc(camera == kBadCamera ? size * 2 : size);
         });
       }},
      {"nobody there",
       Ends::kFails,
       "",
       [](Scene* s) {
         const YAML::Node root = YAML::LoadFile(s->Yaml());
         for (int i = 0; i < s->NumCameras(); ++i) {
           const std::string id = root["cameras"][i]["id"].as<std::string>();
           fs::copy_file(
               s->Plate(i), s->Image(id), fs::copy_options::overwrite_existing);
         }
       }},
      {"cameras that look away from one another",
       Ends::kFails,
       "",
       [](Scene* s) {
         s->GiveMasks(
             [](const std::string&, cv::Size size) { return Disc(size); });
         s->Edit([](YAML::Node n) {  // half a turn about each camera's y axis
           for (YAML::Node camera : n["cameras"]) {
             for (const int i : {0, 1, 2, 6, 7, 8}) {
               camera["R"][i] = -camera["R"][i].as<double>();
             }
             for (const int i : {0, 2}) {
               camera["t"][i] = -camera["t"][i].as<double>();
             }
           }
         });
       }},
      {"no way to find the person",
       Ends::kBadInput,
       kBadCamera,
       [](Scene* s) {
         s->EditCamera([](YAML::Node n) { n.remove("background"); });
       }},
      {"plate swapped with another camera's",
       Ends::kMayBeTolerated,
       "",
       [](Scene* s) {
         fs::copy_file(
             s->Plate(3), s->Plate(1), fs::copy_options::overwrite_existing);
       }},
      {"16-bit picture",
       Ends::kMayBeTolerated,
       kBadCamera,
       [](Scene* s) {
         cv::Mat wide;
         cv::imread(s->Image().string()).convertTo(wide, CV_16U, 257);
         s->ReplaceImage(wide);
       }},
      {"grey picture",
       Ends::kMayBeTolerated,
       "",
       [](Scene* s) {
         s->ReplaceImage(cv::imread(s->Image().string(), cv::IMREAD_GRAYSCALE));
       }},
  };
}

std::vector<Case> BrokenArguments() {
  return {
      {"unknown pose",
       Ends::kBadInput,
       "Q",
       [](Scene* s) {
         s->Argue({"--poses", "Q"});
       }},
      {"unknown camera",
       Ends::kBadInput,
       "cam77",
       [](Scene* s) {
         s->Argue({"--cameras", "cam00,cam77"});
       }},
      {"a camera twice",
       Ends::kBadInput,
       "cam00",
       [](Scene* s) {
         s->Argue({"--cameras", "cam00,cam00"});
       }},
      {"one camera asked for",
       Ends::kBadInput,
       "two cameras",
       [](Scene* s) {
         s->Argue({"--cameras", "cam00"});
       }},
      {"unknown setting",
       Ends::kBadInput,
       "joints.wieght",
       [](Scene* s) {
         s->Argue({"--set", "joints.wieght=1"});
       }},
      {"setting of the wrong type",
       Ends::kBadInput,
       "volume.voxel_size",
       [](Scene* s) {
         s->Argue({"--set", "volume.voxel_size=tiny"});
       }},
      {"setting out of range",
       Ends::kBadInput,
       "voxel_size",
       [](Scene* s) {
         s->Argue({"--set", "volume.voxel_size=-1"});
       }},
      {"unknown mode",
       Ends::kBadInput,
       "mode",
       [](Scene* s) {
         s->Argue({"--set", "segment.mode=magic"});
       }},
      {"unknown stage",
       Ends::kBadInput,
       "dinner",
       [](Scene* s) {
         s->Argue({"--until", "dinner"});
       }},
      {"no configuration file",
       Ends::kBadInput,
       "none.yaml",
       [](Scene* s) {
         s->Argue({"--config", "none.yaml"});
       }},
      {"bad configuration file",
       Ends::kBadInput,
       "bad.yaml:2",
       [](Scene* s) {
         const fs::path path = s->folder() / "bad.yaml";
         WriteBytes(path, "joints:\n  wieghts: 1\n");
         s->Argue({"--config", path.string()});
       }},
      {"output below a file",
       Ends::kBadInput,
       "file/result",
       [](Scene* s) {
         WriteBytes(s->folder() / "file", "");
         s->set_out(s->folder() / "file" / "result");
       }},
      {"output is a file",
       Ends::kBadInput,
       "taken",
       [](Scene* s) {
         WriteBytes(s->folder() / "taken", "");
         s->set_out(s->folder() / "taken");
       }},
      {"output is somebody else's folder",
       Ends::kBadInput,
       "report.json",
       [](Scene* s) { s->set_out(s->folder()); }},
  };
}

// Makes the sound capture, which takes longer than most cases.
class BadCaptureTest : public testing::Test {
 protected:
  BadCaptureTest() {
    SyntheticOptions options;
    options.num_cameras = 5;
    options.width = options.height = 240;
    WriteSyntheticCapture(scratch_.path() / "sound", options, nullptr);
  }

  void Run(const std::vector<Case>& cases) {
    for (const Case& broken : cases) {
      SCOPED_TRACE(broken.name);
      const fs::path place = scratch_.path() / "case";
      fs::create_directory(place);
      Scene scene(scratch_.path() / "sound", place / "capture");
      broken.prepare(&scene);
      // What may succeed need not be fitted to the end.
      if (broken.ends == Ends::kMayBeTolerated) {
        scene.Argue({"--until", "landmarks"});
      }
      const auto before = Entries(place);
      const CommandOutcome outcome =
          RunCommand(scene.Arguments(), scratch_.path());
      SCOPED_TRACE(outcome.err);
      Check(broken, outcome);
      if (outcome.status != 0) {
        EXPECT_EQ(Entries(place), before) << "the run left something behind";
      }
      fs::remove_all(place);
    }
  }

  TemporaryFolder scratch_;

 private:
  static std::vector<std::string> Entries(const fs::path& folder) {
    std::vector<std::string> entries;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      entries.push_back(entry.path().string());
    }
    std::sort(entries.begin(), entries.end());
    return entries;
  }

  static void Check(const Case& broken, const CommandOutcome& outcome) {
    if (broken.ends == Ends::kBadInput) {
      EXPECT_EQ(outcome.status, 2);
    } else if (broken.ends == Ends::kFails) {
      EXPECT_THAT(outcome.status, AnyOf(Eq(1), Eq(2)));
    } else {
      EXPECT_THAT(outcome.status, AnyOf(Eq(0), Eq(1), Eq(2)));
      if (outcome.status == 0) return;
    }
    const std::vector<std::string> errors = outcome.ErrorLines();
    ASSERT_THAT(errors, SizeIs(1));
    EXPECT_NE(errors[0].find(broken.word), std::string::npos)
        << "does not mention " << broken.word;
    EXPECT_EQ(errors[0].find("internal error"), std::string::npos);
  }
};

// What was tolerated is said at the end, not only in passing.
TEST_F(BadCaptureTest, TheSummaryNamesWeakStages) {
  Scene scene(scratch_.path() / "sound", scratch_.path() / "capture");
  fs::copy_file(
      scene.Plate(3), scene.Plate(1), fs::copy_options::overwrite_existing);
  scene.Argue({"--until", "segment"});
  const CommandOutcome outcome = RunCommand(scene.Arguments(), scratch_.path());
  EXPECT_EQ(outcome.status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("\nweak: segment A\n"));
}

TEST_F(BadCaptureTest, EachEndsWithOneLineAndNoResult) {
  Run(BrokenFiles());
  Run(BrokenKeys());
  Run(BrokenSilhouettes());
  Run(BrokenArguments());
}

}  // namespace
}  // namespace sweepfit
