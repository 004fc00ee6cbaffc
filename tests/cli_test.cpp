// The command line as scripts see it: exit codes, messages, files, JSON.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

struct Outcome {
  int code;
  std::string out, err;
};

std::string content(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

/// A folder of its own for each test, and the program run in it.
class CommandLine : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / ("lobefit_cli_" + std::to_string(getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override {
    fs::permissions(folder_, fs::perms::owner_all);
    fs::remove_all(folder_);
  }

  Outcome run(const std::string& arguments) const {
    const std::string command = "cd '" + folder_.string() + "' && '" LOBEFIT_PROGRAM "' " + arguments + " >.out 2>.err";
    const int status = std::system(command.c_str());
    const Outcome outcome{WIFEXITED(status) ? WEXITSTATUS(status) : -1, content(folder_ / ".out"),
                          content(folder_ / ".err")};
    fs::remove(folder_ / ".out");
    fs::remove(folder_ / ".err");
    return outcome;
  }
  Json json(const std::string& arguments) const {
    const Outcome outcome = run(arguments + " --json");
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out);
  }
  /// One line on stderr that holds every fragment, nothing on stdout, and no new file.
  void expect_refused(const std::string& arguments, int code, std::initializer_list<const char*> fragments) const {
    const auto before = files();
    const Outcome outcome = run(arguments);
    EXPECT_EQ(outcome.code, code) << arguments << "\n" << outcome.err;
    EXPECT_EQ(outcome.out, "") << arguments;
    EXPECT_TRUE(outcome.err.starts_with("lobefit: error: ")) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    for (const char* fragment : fragments) EXPECT_NE(outcome.err.find(fragment), std::string::npos) << outcome.err;
    EXPECT_EQ(files(), before) << arguments;
  }
  /// An EXR of one channel and one value.
  void write_grey(const char* name, int width, int height, float value) const {
    const std::vector<float> pixels(static_cast<std::size_t>(width * height), value);
    Imf::Header header(width, height);
    header.channels().insert("Y", Imf::Channel(Imf::FLOAT));
    Imf::FrameBuffer frame;
    frame.insert("Y", Imf::Slice::Make(Imf::FLOAT, pixels.data(), Imath::V2i(0, 0), width, height));
    Imf::OutputFile file((folder_ / name).c_str(), header);
    file.setFrameBuffer(frame);
    file.writePixels(height);
  }
  std::vector<std::string> files() const {
    std::vector<std::string> names;
    for (const auto& file : fs::directory_iterator(folder_)) names.push_back(file.path().filename().string());
    std::sort(names.begin(), names.end());
    return names;
  }

  fs::path folder_;
};

TEST_F(CommandLine, WrongNamesOfferTheNearest) {
  expect_refused("evl", 2, {"evl", "eval"});
  expect_refused("eval proxmia --wi 0,0 --wo 0,0", 2, {"proxmia", "'proxima'"});
  expect_refused("eval proxima --set alhpa=0.5 --wi 0,0 --wo 0,0", 2, {"alhpa", "'alpha'"});
  expect_refused("reference microfacet_difuse --wi 0,0 --wo 0,0", 2, {"'microfacet_diffuse'"});
  expect_refused("refit proxma", 2, {"'proxima'"});
  expect_refused("eval proxima --bogus", 2, {"--bogus", "--help"});
}

TEST_F(CommandLine, ValuesOutOfRangeNameTheRange) {
  expect_refused("eval proxima --set alpha=1.5 --wi 0,0 --wo 0,0", 2, {"1.5", "alpha", "from 0 to 1"});
  expect_refused("eval proxima --set alpha=-0.1 --wi 0,0 --wo 0,0", 2, {"from 0 to 1"});
  expect_refused("eval proxima --set alpha=nan --wi 0,0 --wo 0,0", 2, {"not a finite number"});
  expect_refused("eval proxima --set albedo=inf --wi 0,0 --wo 0,0", 2, {"not a finite number"});
  expect_refused("eval proxima --set albedo=0.1,0.2 --wi 0,0 --wo 0,0", 2, {"albedo", "three"});
  expect_refused("eval proxima --wi 90,0 --wo 0,0", 2, {"--wi", "below 90"});
  expect_refused("eval proxima --wi 10,0 --wo 120,0", 2, {"--wo", "below 90"});
  expect_refused("eval proxima --wi nan,0 --wo 0,0", 2, {"not a finite number"});
  expect_refused("eval proxima --wi 1e999,0 --wo 0,0", 2, {"not a finite number"});
  expect_refused("reference microfacet_diffuse --set masking=smith --wi 0,0 --wo 0,0", 2, {"smith", "correlated"});
  expect_refused("render microfacet_diffuse --axis alpha=0.5,2 -o t.exr", 2, {"2", "from 0.001 to 1"});
  expect_refused("render microfacet_diffuse --axis masking=1 -o t.exr", 2, {"masking", "axis"});
}

TEST_F(CommandLine, OutputsAreWholeOrAbsent) {
  expect_refused("render microfacet_diffuse --grid small -o missing/t.exr", 1, {"missing/t.exr", "No such file"});
  ASSERT_EQ(run("render microfacet_diffuse --grid small --samples 64 -o t.exr").code, 0);
  const std::string first = content(folder_ / "t.exr");
  expect_refused("render microfacet_diffuse --grid small --samples 128 -o t.exr", 2, {"t.exr", "--force"});
  EXPECT_EQ(content(folder_ / "t.exr"), first);
  EXPECT_EQ(run("render microfacet_diffuse --grid small --samples 128 -o t.exr --force").code, 0);
  EXPECT_NE(content(folder_ / "t.exr"), first);
  EXPECT_EQ(files(), std::vector<std::string>{"t.exr"});
}

TEST_F(CommandLine, UnreadableTablesAreRefused) {
  ASSERT_EQ(run("render microfacet_diffuse --grid small --samples 64 -o t.exr").code, 0);
  const std::string whole = content(folder_ / "t.exr");
  std::ofstream(folder_ / "cut.exr", std::ios::binary) << whole.substr(0, whole.size() / 2);
  std::ofstream(folder_ / "text.exr") << "not a picture";
  std::ofstream(folder_ / "empty.exr");
  for (const char* name : {"cut.exr", "text.exr", "empty.exr", "absent.exr"}) {
    expect_refused(std::string("table info ") + name, 3, {name});
    expect_refused(std::string("fit proxima ") + name + " --free a -o fit.json", 3, {name});
  }
}

TEST_F(CommandLine, CtrlCLeavesNothingBroken) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (chdir(folder_.c_str()) != 0) _exit(127);
    // Hours of work, so that the signal surely comes in the middle.
    execl(LOBEFIT_PROGRAM, "lobefit", "render", "microfacet_diffuse", "--samples", "100000000", "-o", "long.exr",
          "--quiet", static_cast<char*>(nullptr));
    _exit(127);
  }
  // The probe for writing shows that the work is about to begin.
  for (int i = 0; i < 500 && files().empty(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_FALSE(files().empty());
  kill(child, SIGINT);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 130);
  EXPECT_TRUE(files().empty());
}

/// A run of the program that goes on beside the test, in `folder`; its stderr goes to the file `.log` there.
class Running {
 public:
  Running(const fs::path& folder, std::vector<std::string> arguments) : child_(fork()) {
    if (child_ != 0) return;
    std::vector<char*> argv{const_cast<char*>("lobefit")};
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    if (chdir(folder.c_str()) != 0 || !std::freopen(".log", "w", stderr)) _exit(127);
    execv(LOBEFIT_PROGRAM, argv.data());
    _exit(127);
  }
  /// The exit status as waitpid() tells it.
  int stop(int signal) const {
    kill(child_, signal);
    int status = 0;
    EXPECT_EQ(waitpid(child_, &status, 0), child_);
    return status;
  }

 private:
  pid_t child_;
};

TEST_F(CommandLine, KilledAndInterruptedRendersGoOnToTheSameFile) {
  // Enough for seconds on one thread; lines are kept from the first second on.
  std::ofstream(folder_ / "g.json") << R"({"theta_i":[0,60],"theta_o":[0,10,20,30,40,50,60,70,80],"phi":[0,180]})";
  const std::vector<std::string> words{
      "render", "microfacet_diffuse", "--set",     "facet=callisto", "--grid", "g.json",
      "--axis", "alpha=0.2,0.7",      "--samples", "500000",         "-o",     "t.exr"};
  std::string render;
  for (const std::string& word : words) render += (render.empty() ? "" : " ") + word;
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), words.begin(), words.end());
    return more;
  };
  const auto kept = [&] {
    std::error_code none;
    const auto size = fs::file_size(folder_ / "t.exr.part", none);
    return none ? 0 : size;
  };
  {
    const Running run(folder_, with({"--threads", "1"}));
    for (int i = 0; i < 6000 && kept() < 2500; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    ASSERT_TRUE(WIFSIGNALED(run.stop(SIGKILL))) << "it should still have been at work";
  }
  ASSERT_GT(kept(), 0u);
  EXPECT_FALSE(fs::exists(folder_ / "t.exr"));
  fs::remove(folder_ / ".log");
  EXPECT_EQ(run(render).code, 2);
  EXPECT_EQ(files(), (std::vector<std::string>{"g.json", "t.exr.part"})) << "the killed program's probe is removed";
  expect_refused(render, 2, {"t.exr.part", "--resume", "--force"});
  expect_refused(render + " --seed 2 --resume", 2, {"t.exr.part", "seed is 1 there and 2 here"});
  expect_refused(render + " --shard 1/2 --resume", 2, {"shard is 1/1 there and 1/2 here"});
  {
    const Running run(folder_, with({"--resume", "--threads", "1"}));
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    const int status = run.stop(SIGINT);
    ASSERT_TRUE(WIFEXITED(status));
    EXPECT_EQ(WEXITSTATUS(status), 130);
    const std::string message = content(folder_ / ".log");
    EXPECT_NE(message.find("of 18 lines are kept (t.exr.part): the same command with --resume goes on"),
              std::string::npos)
        << message;
    fs::remove(folder_ / ".log");
  }
  const Outcome resumed = run(render + " --resume");
  ASSERT_EQ(resumed.code, 0) << resumed.err;
  EXPECT_NE(resumed.err.find("went on from "), std::string::npos) << resumed.err;
  EXPECT_EQ(files(), (std::vector<std::string>{"g.json", "t.exr"})) << "nothing is left behind";
  const std::string bytes = content(folder_ / "t.exr");
  ASSERT_EQ(run(render + " --force").code, 0);
  EXPECT_EQ(bytes, content(folder_ / "t.exr"));

  // Finished: nothing to do, so that loops over shards can be started again as they are.
  const auto written = fs::last_write_time(folder_ / "t.exr");
  const Outcome again = run(render + " --resume");
  EXPECT_EQ(again.code, 0);
  EXPECT_NE(again.err.find("finished already"), std::string::npos) << again.err;
  EXPECT_EQ(fs::last_write_time(folder_ / "t.exr"), written);
  expect_refused(render + " --seed 2 --resume", 2, {"t.exr", "seed is 1 there and 2 here", "--force"});
  EXPECT_EQ(files(), (std::vector<std::string>{"g.json", "t.exr"}));
}

TEST_F(CommandLine, LatLongPicturesOfSeveralViewsBecomeOneTable) {
  write_grey("lobe.exr", 64, 16, 0.25f);
  expect_refused("table info lobe.exr", 3, {"lobe.exr", "which direction it holds", "--wo"});
  expect_refused("table info lobe.exr --wo 95,0", 2, {"--wo", "out of range"});
  EXPECT_EQ(json("table info lobe.exr --wi 30,0")["format"], "lat_long");
  for (const char* view : {"0", "30", "60"}) {
    ASSERT_EQ(run(std::string("table convert lobe.exr --wo ") + view + ",0 -o view" + view + ".exr").code, 0);
  }
  ASSERT_EQ(run("table merge view60.exr view0.exr view30.exr -o views.exr").code, 0);
  const Json info = json("table info views.exr");
  EXPECT_EQ(info["axes"][0]["values"], (std::vector<double>{0.0, 30.0, 60.0}));
  EXPECT_EQ(info["entries"], 3 * 64 * 16);
  EXPECT_NEAR(json("eval views.exr --wi 40,170 --wo 45,0")["values"][0]["f"][0].get<double>(), 0.25, 1e-12);
  expect_refused("table merge view0.exr view0.exr -o v.exr", 3, {"theta_o = 0 comes twice"});
  expect_refused("table merge view0.exr view30.exr --partial -o v.exr", 2, {"--partial"});
  expect_refused("table info views.exr --wo 0,0", 2, {"--wo"});
}

TEST_F(CommandLine, ShardsMergeToTheSameFile) {
  const std::string render = "render microfacet_diffuse --grid small --samples 64 --axis alpha=0.2,0.7 ";
  ASSERT_EQ(run(render + "-o whole.exr").code, 0);
  for (const char* shard : {"1", "2", "3"}) {
    const std::string name = std::string("s") + shard + ".exr";
    ASSERT_EQ(run(render + "--shard " + shard + "/3 --resume -o " + name).code, 0);
    EXPECT_EQ(json("table info " + name)["provenance"]["shard"], std::string(shard) + "/3");
    EXPECT_EQ(json("table info " + name)["masked"], 2 * 810 * 2 / 3);
  }
  EXPECT_EQ(run("table merge s2.exr s3.exr s1.exr -o merged.exr").code, 0);
  EXPECT_EQ(content(folder_ / "merged.exr"), content(folder_ / "whole.exr"));
  EXPECT_EQ(json("table info merged.exr")["provenance"]["command"],
            "lobefit render microfacet_diffuse --grid small --samples 64 --axis alpha=0.2,0.7");
  expect_refused("table merge s2.exr s3.exr -o m.exr", 3, {"missing shard 1 of 3", "--partial"});
  expect_refused("table merge s2.exr s3.exr s2.exr -o m.exr", 3, {"shard 2", "s2.exr"});
  expect_refused("table merge s1.exr whole.exr -o m.exr", 3, {"whole.exr"});
  expect_refused("table merge s1.exr s2.exr s3.exr -o merged.exr", 2, {"merged.exr", "--force"});
  const Outcome partial = run("table merge s2.exr s3.exr --partial -o p.exr");
  EXPECT_EQ(partial.code, 0);
  EXPECT_NE(partial.err.find("shards 2,3/3 only"), std::string::npos) << partial.err;
  ASSERT_EQ(run("table merge s1.exr p.exr --force -o merged.exr").code, 0);
  EXPECT_EQ(content(folder_ / "merged.exr"), content(folder_ / "whole.exr"));
  for (const char* text : {"0/3", "4/3", "a/b", "3", "1/0", "''"}) {
    expect_refused(render + "-o bad.exr --shard " + text, 2, {"--shard", "I/N"});
  }
  expect_refused(render + "-o bad.exr --shard 1/19", 2, {"18 lines", "19 shards"});
}

TEST_F(CommandLine, RecolorGivesAnotherAlbedo) {
  const std::string render = "render microfacet_diffuse --grid small --samples 64 --set bounces=all --orders ";
  ASSERT_EQ(run(render + "-o white.exr").code, 0);
  ASSERT_EQ(run(render + "--set albedo=0.8,0.4,0.2 -o direct.exr").code, 0);
  ASSERT_EQ(run("table recolor white.exr --set albedo=0.8,0.4,0.2 -o colour.exr").code, 0);
  EXPECT_EQ(run("table compare direct.exr colour.exr --tolerance 1e-6").code, 0);
  const Json info = json("table info colour.exr");
  EXPECT_EQ(info["provenance"]["params"]["albedo"], (Json{0.8, 0.4, 0.2}));
  EXPECT_EQ(info["orders"], 24);
  EXPECT_EQ(info["provenance"]["command"],
            "lobefit render microfacet_diffuse --grid small --samples 64 --set bounces=all --orders && "
            "lobefit table recolor white.exr --set albedo=0.8,0.4,0.2");
  expect_refused("table recolor white.exr --set albedo=1.5 -o c.exr", 2, {"1.5", "from 0 to 1"});
  expect_refused("table recolor white.exr --set alpha=0.5 -o c.exr", 2, {"alpha", "albedo"});
  ASSERT_EQ(run("render microfacet_diffuse --grid small --samples 64 -o plain.exr").code, 0);
  expect_refused("table recolor plain.exr --set albedo=0.5 -o c.exr", 2, {"plain.exr", "--orders"});
}

TEST_F(CommandLine, ThreadsDoNotChangeTheBits) {
  const std::string render = "render microfacet_diffuse --grid small --samples 512 --axis alpha=0.2,0.7 ";
  ASSERT_EQ(run(render + "--threads 1 -o one.exr").code, 0);
  ASSERT_EQ(run(render + "--threads 2 -o two.exr").code, 0);
  EXPECT_EQ(content(folder_ / "one.exr"), content(folder_ / "two.exr"));
  ASSERT_EQ(run("fit proxima one.exr --free a,b --threads 1 -o one.json").code, 0);
  ASSERT_EQ(run("fit proxima one.exr --free a,b --threads 2 -o two.json").code, 0);
  EXPECT_EQ(content(folder_ / "one.json"), content(folder_ / "two.json"));
  ASSERT_EQ(run("render microfacet_diffuse --grid small --samples 512 --seed 2 -o other.exr").code, 0);
  EXPECT_NE(content(folder_ / "one.exr"), content(folder_ / "other.exr"));
}

TEST_F(CommandLine, EvalAnswersPairsAndFiles) {
  const Json answer = json("eval lambert --set albedo=0.8,0.4,0.2 --wi 30,0 --wo 60,90");
  EXPECT_EQ(answer["model"], "lambert");
  EXPECT_EQ(answer["params"]["albedo"], (Json{0.8, 0.4, 0.2}));
  ASSERT_EQ(answer["values"].size(), 1u);
  EXPECT_EQ(answer["values"][0]["wi"], (Json{30.0, 0.0}));
  const double inverse_pi = 0.31830988618379067;
  const double albedo[] = {0.8, 0.4, 0.2};
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(answer["values"][0]["f"][c], albedo[c] * inverse_pi, 1e-15);

  std::ofstream(folder_ / "pairs.csv") << "name,theta_i,phi_i,theta_o,phi_o\nfirst,10,0,20,0\nsecond,30,0,40,180\n";
  const Outcome csv = run("eval lambert --csv pairs.csv");
  EXPECT_EQ(csv.code, 0) << csv.err;
  EXPECT_TRUE(csv.out.starts_with("name,theta_i,phi_i,theta_o,phi_o,r,g,b\nfirst,10,0,20,0,0.31830988618379"))
      << csv.out;
  std::ofstream(folder_ / "bad.csv") << "theta_i,phi_i,theta_o,phi_o\n10,0,20,0\n10,0,95,0\n";
  const Outcome bad = run("eval lambert --csv bad.csv");
  EXPECT_EQ(bad.code, 3);
  EXPECT_NE(bad.err.find("bad.csv, line 3"), std::string::npos) << bad.err;
  std::ofstream(folder_ / "nan.csv") << "theta_i,phi_i,theta_o,phi_o\nnan,0,20,0\n";
  EXPECT_EQ(run("eval lambert --csv nan.csv").code, 3);
  EXPECT_EQ(run("eval lambert --csv absent.csv").code, 3);
}

TEST_F(CommandLine, SamplesComeWithDensityAndValue) {
  const Json answer = json("sample lambert --set albedo=0.8,0.4,0.2 --wo 30,0 -n 64");
  ASSERT_EQ(answer["samples"].size(), 64u);
  for (const Json& sample : answer["samples"]) {
    // Cosine sampling: pdf = cos θ/π, f = ρ/π.
    const double cosine = std::cos(sample["wi"][0].get<double>() * 0.017453292519943295);
    EXPECT_NEAR(sample["pdf"], cosine / 3.141592653589793, 1e-12);
    EXPECT_NEAR(sample["f"][1], 0.4 / 3.141592653589793, 1e-12);
  }
  EXPECT_NEAR(answer["albedo"][2], 0.2, 1e-12);  // of a perfect sampling, whatever the samples
  EXPECT_NEAR(answer["stderr"][2], 0.0, 1e-8);

  // Against quadrature. Five standard errors: a false alarm in about 1.7 million seeds; the seed is fixed.
  const Json metal = json("sample specular_ggx --set alpha=0.3 --set f0=0.9,0.5,0.1 --wo 60,0 -n 20000");
  const Json exact = json("albedo specular_ggx --set alpha=0.3 --set f0=0.9,0.5,0.1 --theta 60");
  for (std::size_t c = 0; c < 3; ++c) {
    const double error = metal["stderr"][c];
    EXPECT_GT(error, 0.0);
    EXPECT_NEAR(metal["albedo"][c].get<double>(), exact["albedo"][0][c].get<double>(), 5.0 * error);
  }

  const Outcome csv = run("sample lambert --wo 0,0 -n 3 --seed 7");
  EXPECT_TRUE(csv.out.starts_with("theta_i,phi_i,pdf,r,g,b\n")) << csv.out;
  EXPECT_EQ(std::count(csv.out.begin(), csv.out.end(), '\n'), 4);
  EXPECT_EQ(run("sample lambert --wo 0,0 -n 3 --seed 7").out, csv.out);
  EXPECT_NE(run("sample lambert --wo 0,0 -n 3 --seed 8").out, csv.out);
  expect_refused("sample d_ggx --wo 0,0", 2, {"d_ggx", "no importance sampling"});
  expect_refused("sample lambert --wo 95,0", 2, {"theta", "95"});
}

TEST_F(CommandLine, SlabShowsEvaluatesSimplifiesAndValidates) {
  const Json shown = json("slab show slide_collapse");
  EXPECT_EQ(shown["closures"].size(), 3u);
  int bits = 0;
  for (const Json& field : shown["storage"]["fields"]) bits += field["part"] == "medium" ? 0 : field["bits"].get<int>();
  EXPECT_EQ(bits + shown["storage"]["padding_bits"].get<int>(), 8 * shown["storage"]["bytes"].get<int>());
  EXPECT_NE(run("slab show slide_collapse --fields --svg tree.svg").out.find("diffuse_albedo"), std::string::npos);
  EXPECT_NE(content(folder_ / "tree.svg").find("<svg"), std::string::npos);

  // A lone slab is the model `slab`.
  std::ofstream(folder_ / "lone.json")
      << R"({"slab": {"diffuse_albedo": [0.6, 0.3, 0.1], "f0": 0.05, "roughness": 0.4}})";
  const Json tree = json("slab eval lone.json --wi 30,10 --wo 50,170");
  const Json model =
      json("eval slab --set diffuse_albedo=0.6,0.3,0.1 --set f0=0.05 --set roughness=0.4 --wi 30,10 --wo 50,170");
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(tree["values"][0]["f"][c].get<double>(), model["values"][0]["f"][c].get<double>(), 1e-12);
  }

  ASSERT_EQ(run("slab simplify slide_collapse --bytes 12 -o small.json").code, 0);
  const Json small = json("slab show small.json");
  EXPECT_EQ(small["storage"]["bytes"], 12);
  EXPECT_EQ(small["closures"].size(), 1u);
  expect_refused("slab simplify slide_collapse --bytes 11", 2, {"bytes"});
  EXPECT_NE(run("slab shader --lang glsl").out.find("Lobefit_BlendVertical"), std::string::npos);

  const Json validation = json("slab validate coated_metal --samples 32 -o out");
  ASSERT_GE(validation["levels"].size(), 2u);
  EXPECT_EQ(validation["levels"][0]["closures"], 2);
  EXPECT_EQ(validation["levels"][0]["simplification"]["error"], 0.0);
  EXPECT_GT(validation["levels"][0]["model"]["error"].get<double>(), 0.0);
  for (const char* name : {"validation.json", "validation.md", "error.svg", "error.png", "tree.svg"}) {
    EXPECT_TRUE(fs::exists(folder_ / "out" / name)) << name;
  }
  expect_refused("slab validate coated_metal --samples 32 -o out", 2, {"out", "--force"});
}

TEST_F(CommandLine, BadTreesAreRefusedWithTheirJsonPath) {
  const auto refuse = [&](const std::string& tree, std::initializer_list<const char*> fragments) {
    std::ofstream(folder_ / "bad.json") << tree;
    expect_refused("slab show bad.json", 3, fragments);
  };
  refuse(R"({"nodes": {"a": {"coverage": {"operand": "a", "weight": 0.5}}}, "root": "a"})", {"cycle", "a"});
  refuse(R"({"slab": {"rougness": 0.5}})", {"rougness", "roughness", "$.slab"});
  refuse(R"({"horizontal": {"background": {"slab": {}}, "mix": 0.5}})", {"foreground", "$.horizontal"});
  refuse(R"({"coverage": {"operand": {"slab": {}}, "weight": 1.5}})", {"1.5", "$.coverage.weight"});
  refuse(R"({"vertical": {"top": {"slab": {}}, "thickness": 1}})", {"nothing", "$.vertical"});
  refuse(R"({"vertical": {"top": {"slab": {}}, "bottom": {"slab": {}}, "thickness": -1}})",
         {"-1", "$.vertical.thickness"});
  refuse(R"({"slab": {"mean_free_path": [1, -2, 3]}})", {"-2", "$.slab.mean_free_path[1]"});
  refuse(R"({"nodes": {"a": {"slab": {}}, "b": {"horizontal": {"background": "a", "foreground": "a", "mix": 0.5}},
            "c": {"horizontal": {"background": "b", "foreground": "b", "mix": 0.5}},
            "d": {"horizontal": {"background": "c", "foreground": "c", "mix": 0.5}}},
            "root": {"horizontal": {"background": "d", "foreground": "d", "mix": 0.5}}})",
         {"16", "8"});
  expect_refused("slab show car_pant", 2, {"car_paint"});
}

TEST_F(CommandLine, ReferenceMeetsPublishedValues) {
  // formulas.md, section 3: alpha = ½, GGX, height-correlated, one bounce, per unit albedo.
  const std::string at = "reference microfacet_diffuse --set alpha=0.5 --wi 60,0 --exact --wo ";
  EXPECT_NEAR(json(at + "60,0")["f"][0], 0.361554992058, 5e-13);
  EXPECT_NEAR(json(at + "60,180")["f"][0], 0.127865601469, 5e-13);
  const Json sampled = json("reference microfacet_diffuse --set alpha=0.5 --wi 60,0 --wo 60,180 --samples 65536");
  EXPECT_EQ(sampled["method"], "monte_carlo");
  EXPECT_EQ(sampled["samples"], 65536);
  const double error = sampled["stderr"][0];
  EXPECT_GT(error, 0.0);
  // Four standard errors with 31 degrees of freedom: a false alarm in 2700 seeds; the seed is fixed.
  EXPECT_NEAR(sampled["f"][0], 0.127865601469, 4.0 * error);
}

TEST_F(CommandLine, FitCheckExportHangTogether) {
  ASSERT_EQ(run("render proxima --set a=-0.4 --set b=0.11 --axis alpha=0.3,0.9 --grid small -o t.exr").code, 0);
  ASSERT_EQ(run("fit proxima t.exr --free a,b --metric cosine -o fit.json").code, 0);
  const Json fit = Json::parse(content(folder_ / "fit.json"));
  EXPECT_EQ(fit["model"], "proxima");
  EXPECT_TRUE(fit["identifiable"]);
  for (const Json& parameter : fit["params"]) {
    if (parameter["name"] == "a") EXPECT_NEAR(parameter["value"], -0.4, 1e-6);
    if (parameter["name"] == "b") EXPECT_NEAR(parameter["value"], 0.11, 1e-6);
  }
  EXPECT_EQ(fit["provenance"]["table_sha256"].get<std::string>().size(), 64u);
  EXPECT_EQ(fit["provenance"]["command"], "lobefit fit proxima t.exr --free a,b --metric cosine");

  const Json check = json("check fit.json --table t.exr --pairs 65536");
  EXPECT_TRUE(check["passed"]);
  EXPECT_GT(check["max_abs"], 0.0);  // float is not double
  EXPECT_LT(check["table"]["rms_float"], 1e-6);
  const Outcome shader = run("export fit.json --lang hlsl");
  EXPECT_EQ(shader.code, 0);
  EXPECT_NE(shader.out.find("float3 Lobefit_proxima(float3 wi, float3 wo, Lobefit_proxima_Parameters p)"),
            std::string::npos);
  EXPECT_NE(shader.out.find("Lobefit_proxima_Fitted()"), std::string::npos);
  EXPECT_NE(shader.out.find("p.b = 0.11"), std::string::npos) << shader.out;
  EXPECT_NE(run("export fit.json --lang c").out.find("    p.b = 0.11"), std::string::npos);
  EXPECT_NE(run("export fit.json --lang wgsl").out.find("fn Lobefit_proxima_Fitted() -> "), std::string::npos);
  expect_refused("export fit.json --lang cg", 2, {"cg", "hlsl", "wgsl"});
}

/// The Vulkan loader with no driver to offer, for a while.
class NoVulkanDriver {
 public:
  NoVulkanDriver() {
    for (const char* name : names_) setenv(name, "/nonexistent", 1);
  }
  ~NoVulkanDriver() {
    for (const char* name : names_) unsetenv(name);
  }

 private:
  static constexpr std::array names_{"VK_ICD_FILENAMES", "VK_DRIVER_FILES"};
};

TEST_F(CommandLine, CheckWithoutAVulkanDriverSaysSo) {
  const NoVulkanDriver none;
  expect_refused("check lambert --device vulkan", 6, {"Vulkan", "install", "--device simd"});
  expect_refused("check lambert --device vulkan:0 --lang hlsl", 6, {"Vulkan"});
  const Json devices = json("check --list-devices")["devices"];
  ASSERT_EQ(devices.size(), 1u);
  EXPECT_EQ(devices[0]["device"], "simd");
  // All that there are; what is missing is said.
  const Outcome all = run("check lambert --device all --pairs 4096 --json");
  EXPECT_EQ(all.code, 0);
  EXPECT_EQ(Json::parse(all.out)["device"], "simd");
  EXPECT_NE(all.err.find("no Vulkan"), std::string::npos) << all.err;
}

TEST_F(CommandLine, CheckRefusesDevicesAndLanguagesThatAreNone) {
  expect_refused("check lambert --device cuda", 2, {"'cuda'", "simd", "vulkan"});
  expect_refused("check lambert --lang glsl", 2, {"--lang", "--device vulkan"});
  expect_refused("check lambert --device vulkan --lang cg", 2, {"cg"});
  expect_refused("check lambert --list-devices", 2, {"--list-devices"});
  expect_refused("check lambert --device vulkan:no_such_device", 6, {"Vulkan"});
}

TEST_F(CommandLine, CheckTellsWhatStorageCosts) {
  const Json check = json("check proxima --storage unorm8 --storage albedo=rgb776 --set exponent=0.5");
  EXPECT_EQ(check["model"], "proxima");
  EXPECT_EQ(check["parameter_sets"], 16);
  EXPECT_EQ(check["params"].size(), 5u);
  EXPECT_EQ(check["worst"], check["params"][0]["name"]);
  EXPECT_EQ(check["params"][0]["code"], "rgb776");
  EXPECT_EQ(check["params"][0]["bits"], 20);
  EXPECT_GT(check["rms"]["log"], 0.0);
  EXPECT_TRUE(check["passed"]);
  const Outcome text = run("check slab --storage fp16");
  EXPECT_EQ(text.code, 0);
  EXPECT_NE(text.out.find("the worst"), std::string::npos);
  EXPECT_NE(text.out.find("emissive is beyond fp16's largest number, 65504"), std::string::npos) << text.out;
  EXPECT_EQ(run("check lambert --storage unorm8 --set albedo=1 --tolerance 0").code, 0);
  EXPECT_EQ(run("check lambert --storage unorm8 --tolerance 1e-9").code, 5);
  expect_refused("check lambert --storage fp15", 2, {"'fp15'", "fp16"});
  expect_refused("check lambert --storage albdo=fp16", 2, {"'albdo'", "albedo"});
  expect_refused("check lambert --storage fp16 --device simd", 2, {"--storage"});
  expect_refused("check lambert --tolerance 1", 2, {"--storage"});
}

TEST_F(CommandLine, ImageSlicesOfModelsAndTables) {
  for (const char* file : {"a.svg", "b.svg"}) {
    ASSERT_EQ(
        run(std::string("plot image callisto --set alpha=0.3 --with eon:roughness=0.5 --steps 20 -o ") + file).code, 0);
  }
  EXPECT_TRUE(content(folder_ / "a.svg").starts_with("<?xml"));
  EXPECT_EQ(content(folder_ / "a.svg"), content(folder_ / "b.svg"));
  ASSERT_EQ(run("render lambert --axis albedo=0.25,0.5 --grid small -o t.exr").code, 0);
  ASSERT_EQ(run("plot image t.exr --set albedo=0.5 --with lambert --steps 9 -o t.png").code, 0);
  EXPECT_TRUE(content(folder_ / "t.png").starts_with("\x89PNG"));
  expect_refused("plot image t.exr --steps 9 -o u.png", 2, {"albedo"});
  expect_refused("plot image callisto --with eon:roughness=alpha -o u.png", 2, {"callisto", "no table"});
  expect_refused("plot image callisto --phi-d 200 -o u.png", 2, {"phi_d", "180"});
  expect_refused("plot image none.exr -o u.png", 3, {"none.exr"});
}

TEST_F(CommandLine, ConvergenceIsDrawnOfFits) {
  ASSERT_EQ(run("render eon --set roughness=0.6 --grid small -o t.exr").code, 0);
  ASSERT_EQ(run("fit proxima t.exr --free a,b -o fit.json").code, 0);
  const Json history = Json::parse(content(folder_ / "fit.json"))["solver"]["history"];
  ASSERT_GE(history.size(), 2u);
  EXPECT_LT(history.back(), history.front());
  for (const char* file : {"a.svg", "b.svg"}) {
    ASSERT_EQ(run(std::string("plot convergence fit.json -o ") + file).code, 0);
  }
  EXPECT_EQ(content(folder_ / "a.svg"), content(folder_ / "b.svg"));
  std::ofstream(folder_ / "no.json") << "{}";
  expect_refused("plot convergence no.json -o c.svg", 3, {"no.json"});
}

TEST_F(CommandLine, ParetoRefusesBeforeItWorks) {
  expect_refused("plot pareto -o pareto.txt", 2, {"--output", ".svg"});
  expect_refused("plot pareto --samples 0", 2, {"--samples"});
  std::ofstream(folder_ / "pareto.svg") << "mine";
  expect_refused("plot pareto -o pareto.svg", 2, {"pareto.svg", "--force"});
}

TEST_F(CommandLine, CheckRunsShadersOnVulkanDevices) {
  const Json devices = json("check --list-devices")["devices"];
  if (devices.size() < 2) GTEST_SKIP() << "no Vulkan device, or no Vulkan in this build";
  const Json one = json("check proxima --device vulkan:0 --lang hlsl --pairs 65536");
  EXPECT_EQ(one["device"], devices[1]["name"]);
  EXPECT_EQ(one["software"], devices[1]["software"]);
  EXPECT_EQ(one["language"], "hlsl");
  EXPECT_TRUE(one["passed"]);
  EXPECT_GT(one["evaluations_per_s"], 0.0);
  const Json all = json("check proxima --device all --pairs 65536")["checks"];
  EXPECT_EQ(all.size(), 1 + 2 * (devices.size() - 1));

  // Over a table, whose rows are parameter sets: what the shader finds is what SIMD code finds, but for rounding.
  ASSERT_EQ(run("render proxima --axis alpha=0.3,0.9 --grid small -o t.exr").code, 0);
  const Json table = json("check proxima --table t.exr --device vulkan --pairs 4096")["table"];
  EXPECT_LT(table["rms_double"], 1e-7);
  EXPECT_GT(table["rms_float"], 0.0);
  EXPECT_LT(table["rms_float"], 1e-6);
}

TEST_F(CommandLine, ExportToTheGBufferTellsWhatIsLost) {
  const auto parameter = [](const Json& document, const std::string& name) {
    for (const Json& p : document["params"]) {
      if (p["name"] == name) return p;
    }
    ADD_FAILURE() << name;
    return Json();
  };
  // Bytes 51, 102, 153 of linear fields, sRGB's 188 of the albedo: nothing is lost, at any precision of the text.
  const std::string exact =
      "callisto_ue427 --set albedo=0.50288645803256838 --set roughness=0.4 --set diffuse_fresnel=51.2 "
      "--set retroreflection=0.6 --set diffuse_fresnel_falloff=0.2 --set retroreflection_falloff=0.8 "
      "--set terminator_length=0.2 --set f0=0.032 --set specular_fresnel_falloff=0.6";
  const Json kept = json("export " + exact + " --gbuffer");
  EXPECT_EQ(kept["pixel"]["GBufferC"], (Json{188, 188, 188, 204}));
  EXPECT_EQ(kept["pixel"]["GBufferB"], (Json{0, 102, 102, 0}));
  EXPECT_EQ(kept["pixel"]["GBufferD"], (Json{153, 153, 51, 51}));
  EXPECT_EQ(kept["pixel"]["GBufferF"], (Json{0, 0, 0, 51}));
  EXPECT_EQ(kept["error"]["grid"], "measured");
  EXPECT_FALSE(kept["error"].contains("rms"));
  for (const auto& [quantity, difference] : kept["error"]["differences"].items()) {
    EXPECT_EQ(difference["port_fit"], 0.0) << quantity;
    EXPECT_LT(difference["packed_fit"], 1e-7) << quantity;
  }

  const std::string lossy =
      "export callisto --set retroreflection=2 --set terminator=0.8 --set f0=0.2,0.1,0.05 --gbuffer";
  const Json lost = json(lossy);
  EXPECT_EQ(parameter(lost, "retroreflection")["losses"][0]["kind"], "clamped");
  EXPECT_EQ(parameter(lost, "retroreflection")["decoded"], 1.0);
  EXPECT_EQ(parameter(lost, "retroreflection")["field"]["place"], "GBufferD.g");
  EXPECT_EQ(parameter(lost, "terminator")["losses"][0]["kind"], "dropped");
  EXPECT_TRUE(parameter(lost, "terminator")["field"].is_null());
  EXPECT_EQ(parameter(lost, "f0")["losses"].size(), 2u);  // grey, and clamped to .08 exactly
  EXPECT_EQ(parameter(lost, "f0")["decoded"], (Json{0.08, 0.08, 0.08}));
  EXPECT_EQ(parameter(lost, "dual_specular")["value"], "mix");
  for (const char* column : {"port_fit", "packed_port", "packed_fit"})
    EXPECT_GT(lost["error"]["differences"]["log"][column], 1e-4) << column;
  const std::string text = run(lossy).out;
  for (const char* fragment : {"2 clamped to 1, the most that CustomData.g holds", "GBufferD.g 255",
                               "always has weight 0.5", "Metallic is 0", "grid measured", "packed - fit"})
    EXPECT_NE(text.find(fragment), std::string::npos) << fragment << "\n" << text;
  const Json lit = json("export " + exact + " --gbuffer --static-lighting");
  EXPECT_EQ(parameter(lit, "retroreflection_falloff")["decoded"], 1.0);
  EXPECT_GT(lit["error"]["differences"]["log"]["packed_port"], 1e-4);

  const Json metal = json("export " + exact + " --set albedo=0 --set f0=0.8,0.4,0.2 --gbuffer --metallic");
  EXPECT_EQ(metal["pixel"]["GBufferB"][0], 255);
  EXPECT_LT(metal["error"]["differences"]["log"]["packed_fit"], 1e-3);

  ASSERT_EQ(run("export callisto --gbuffer -o g.txt").code, 0);
  expect_refused("export callisto --gbuffer -o g.txt", 2, {"g.txt", "--force"});
  expect_refused("export callisto --gbuffer --lang hlsl", 2, {"--gbuffer", "--lang"});
  expect_refused("export callisto --table t.exr", 2, {"--table", "--gbuffer"});
  expect_refused("export callisto --static-lighting", 2, {"--static-lighting", "--gbuffer"});
  expect_refused("export callisto --metallic", 2, {"--metallic", "--gbuffer"});
  expect_refused("export eon --gbuffer", 2, {"eon", "callisto_ue427"});
  expect_refused("export callisto --gbuffer --table absent.exr", 3, {"absent.exr"});
}

TEST_F(CommandLine, ExportToTheGBufferScoresAFitAsTheFitDid) {
  const std::string material = "render callisto_ue427 --set albedo=0.3 --set f0=0.05 --set terminator_length=0.33 ";
  ASSERT_EQ(run(material + "--set roughness=0.37 --grid small -o t.exr").code, 0);
  const std::string fit = "fit callisto t.exr --weights sin_theta_i,cos_theta_o --free albedo,alpha,f0,terminator ";
  ASSERT_EQ(run(fit + "-o fit.json").code, 0);
  const Json fitted = Json::parse(content(folder_ / "fit.json"));
  const Json scored = json("export fit.json --gbuffer --table t.exr");
  EXPECT_EQ(scored["error"]["grid"], "native");
  EXPECT_EQ(scored["error"]["weights"], (Json{"sin_theta_i", "cos_theta_o"}));
  for (const auto& [quantity, stages] : scored["error"]["rms"].items()) {
    EXPECT_EQ(stages["fit"], fitted["metrics"][quantity]) << quantity;
    EXPECT_NE(stages["port"], stages["fit"]) << quantity;
    EXPECT_NE(stages["packed"], stages["port"]) << quantity;
  }
  // On another grid than the table's own, which the fit remembers.
  ASSERT_EQ(run(fit + "--grid small -o small.json").code, 0);
  EXPECT_EQ(json("export small.json --gbuffer --table t.exr")["error"]["grid"], "small");
  ASSERT_EQ(run(material + "--set roughness=0.5 --grid small -o other.exr").code, 0);
  EXPECT_NE(run("export fit.json --gbuffer --table other.exr").err.find("not the table"), std::string::npos);

  // An axis gives every row its own material: which one, the settings say.
  ASSERT_EQ(run(material + "--axis roughness=0.2,0.6 --grid small -o rows.exr").code, 0);
  ASSERT_EQ(run("fit callisto_ue427 rows.exr --free albedo -o rows.json").code, 0);
  expect_refused("export rows.json --gbuffer", 2, {"roughness", "--set roughness=VALUE"});
  expect_refused("export rows.json --gbuffer --table rows.exr", 2, {"roughness", "--set roughness=VALUE"});
  expect_refused("export rows.json --gbuffer --table t.exr --quiet", 2, {"roughness", "--set roughness=VALUE"});
  const Json second = json("export rows.json --gbuffer --table rows.exr --set roughness=0.6");
  EXPECT_EQ(second["pixel"]["GBufferB"][2], 153);
  EXPECT_LT(second["error"]["rms"]["log"]["fit"], 1e-6);
  EXPECT_EQ(json("export rows.json --gbuffer --set roughness=0.2")["pixel"]["GBufferB"][2], 51);

  std::string broken = content(folder_ / "fit.json");
  broken.replace(broken.find("sin_theta_i"), 11, "sin_theta_x");
  std::ofstream(folder_ / "broken.json") << broken;
  expect_refused("export broken.json --gbuffer --table t.exr", 3, {"broken.json", "$.solver", "sin_theta_x"});
}

TEST_F(CommandLine, ParametersWithoutEffectAreNamedNotReported) {
  std::ofstream(folder_ / "slice.json") << R"({"theta_i":[0,20,40,60,80],"theta_o":[0],"phi":[0]})";
  ASSERT_EQ(run("render microfacet_diffuse --grid slice.json --axis alpha=0.3,0.9 --exact -o t.exr").code, 0);
  const Json fit = json("fit proxima t.exr --free a,b,exponent --metric cosine");
  EXPECT_FALSE(fit["identifiable"]);
  EXPECT_NE(fit["remarks"].dump().find("exponent has no effect"), std::string::npos) << fit["remarks"];
}

TEST_F(CommandLine, CompareExitsWithFiveBeyondTheTolerance) {
  ASSERT_EQ(run("render lambert --grid small -o a.exr").code, 0);
  ASSERT_EQ(run("render lambert --set albedo=0.9 --grid small -o b.exr").code, 0);
  // π f cos θ differs by 0.1 cos θ: the mean square of the cosine over 0, 10, …, 80° is known.
  double squares = 0.0;
  for (int i = 0; i < 9; ++i) squares += std::pow(0.1 * std::cos(i * 10.0 * 0.017453292519943295), 2) / 9.0;
  EXPECT_NEAR(json("table compare a.exr b.exr")["metrics"]["cosine"], std::sqrt(squares), 1e-7);
  EXPECT_EQ(run("table compare a.exr b.exr --tolerance 0.2").code, 0);
  EXPECT_EQ(run("table compare a.exr b.exr --tolerance 0.01").code, 5);
  ASSERT_EQ(run("render lambert --grid default -o c.exr").code, 0);
  expect_refused("table compare a.exr c.exr", 3, {"axes"});
}

TEST_F(CommandLine, CompareReportsEveryMetric) {
  ASSERT_EQ(run("render lambert --grid default -o a.exr").code, 0);
  const Json report = json("table compare a.exr lambert --set albedo=0.75 --sphere 24")["report"];
  EXPECT_NEAR(report["rms"]["brdf"]["solid_angle"], 0.25, 1e-6);
  EXPECT_NEAR(report["smape"]["uniform"], 0.25 / 1.75, 1e-6);
  EXPECT_NEAR(report["bihemispherical"]["absolute"], 0.25 * 3.14159265, 1e-5);
  EXPECT_NEAR(report["albedo"]["relative"]["worst"], 0.25, 1e-6);
  EXPECT_EQ(report["albedo"]["angles"].size(), 18u);
  EXPECT_EQ(report["sphere"]["size"], 24);
  for (const char* lighting : {"directional", "three_lights", "environment"}) {
    EXPECT_GT(report["sphere"][lighting]["delta_e_itp_mean"], 1.0) << lighting;
    EXPECT_GE(report["sphere"][lighting]["delta_e_itp_p95"], report["sphere"][lighting]["delta_e_itp_mean"]);
    EXPECT_GT(report["sphere"][lighting]["flip_mean"], 0.01) << lighting;
  }
  EXPECT_EQ(report["not_formed"], Json::array());
  EXPECT_TRUE(json("table compare a.exr lambert --sphere 0")["report"]["sphere"].is_null());
  // A fit stands where a model does; weights of one's own are beside the report.
  ASSERT_EQ(run("fit lambert a.exr -o fit.json").code, 0);
  const Json fitted = json("table compare a.exr fit.json --weights cos_theta_o,quadrature --tolerance 1e-6");
  EXPECT_EQ(fitted["passed"], true);
  EXPECT_EQ(fitted["weights"], "cos_theta_o,quadrature");
  EXPECT_LT(fitted["report"]["sphere"]["environment"]["delta_e_itp_p95"], 1e-3);
  const Outcome text = run("table compare a.exr lambert --set albedo=0.75");
  for (const char* line : {"rms cube_root", "smape", "bihemispherical", "albedo", "environment", "solid angle"}) {
    EXPECT_NE(text.out.find(line), std::string::npos) << line;
  }
  std::ofstream(folder_ / "plane.json") << R"({"theta_i":[0,30,60],"theta_o":[0,30,60],"phi":[0]})";
  ASSERT_EQ(run("render lambert --grid plane.json -o plane.exr").code, 0);
  EXPECT_NE(run("table compare plane.exr lambert").out.find("no albedo: "), std::string::npos);
  expect_refused("table compare a.exr lambert --sphere -1", 2, {"--sphere"});
}

TEST_F(CommandLine, SpheresAreWrittenWholeAndTheSameTwice) {
  ASSERT_EQ(run("sphere lambert --light 0,0 --size 32 -o a.png").code, 0);
  ASSERT_EQ(run("sphere lambert --light 0,0 --size 32 -o b.png --threads 1").code, 0);
  EXPECT_TRUE(content(folder_ / "a.png").starts_with("\x89PNG"));
  EXPECT_EQ(content(folder_ / "a.png"), content(folder_ / "b.png"));
  ASSERT_EQ(run("sphere callisto --set alpha=0.2 --exposure 1 --size 32 -o a.exr").code, 0);
  EXPECT_TRUE(content(folder_ / "a.exr").starts_with("\x76\x2f\x31\x01"));
  ASSERT_EQ(run("render lambert --grid small -o t.exr").code, 0);
  const Json sphere = json("sphere t.exr --lighting three_lights --size 16 -o t.png");
  EXPECT_EQ(sphere["lighting"], "three_lights");
  expect_refused("sphere lambert --light 0,0 -o a.png", 2, {"a.png", "--force"});
  expect_refused("sphere lambert -o a.gif", 2, {".gif", ".png"});
  expect_refused("sphere lambert --light 40 -o c.png", 2, {"--light", "THETA,PHI"});
  expect_refused("sphere lambert --lighting candle -o c.png", 2, {"candle", "environment"});
  expect_refused("sphere hair_unreal -o c.png", 2, {"hair_unreal", "opaque"});
  expect_refused("sphere microfacet_diffuse --set bounces=all --set alpha_x=0.2 --set alpha_y=0.5 -o c.png", 2,
                 {"microfacet_diffuse", "table"});
}

TEST_F(CommandLine, SpheresUnderPicturesAndDisks) {
  write_grey("room.exr", 64, 32, 0.5f);
  const Json room = json("sphere lambert --set albedo=0.5 --environment room.exr --rotate 20 --size 32 -o a.exr");
  EXPECT_EQ(room["lighting"], "room.exr");
  EXPECT_LT(room["noise"], 0.1);
  ASSERT_EQ(run("sphere lambert --environment room.exr --size 32 --threads 1 -o b.png").code, 0);
  ASSERT_EQ(run("sphere lambert --environment room.exr --size 32 -o c.png").code, 0);
  EXPECT_EQ(content(folder_ / "b.png"), content(folder_ / "c.png"));
  const Json pair = json(
      "sphere lambert --area 40,120,8 --against lambert --against-set albedo=0.4 --difference d.png "
      "--size 32 -o d.exr");
  EXPECT_GT(pair["against"]["flip_mean"], 0.01);
  EXPECT_TRUE(content(folder_ / "d.png").starts_with("\x89PNG"));
  EXPECT_EQ(json("sphere eon --against eon --size 16 -o same.png")["against"]["delta_e_itp_mean"], 0.0);

  expect_refused("sphere lambert --environment none.exr -o e.png", 3, {"none.exr"});
  expect_refused("sphere lambert --environment b.png -o e.png", 3, {"b.png", "twice as wide as high"});
  expect_refused("sphere lambert --difference e.exr -o e.png", 2, {"--difference", "--against"});
  expect_refused("sphere lambert --area 1,2 -o e.png", 2, {"--area", "THETA,PHI,RADIUS"});
  expect_refused("sphere lambert --area 1,2,0 -o e.png", 2, {"radius", "90"});
  EXPECT_FALSE(fs::exists(folder_ / "e.png"));
}

TEST_F(CommandLine, ModelsDescribeThemselves) {
  const Json all = json("models")["models"];
  EXPECT_GE(all.size(), 8u);
  for (const Json& model : all) {
    for (const char* key : {"name", "kind", "params", "source", "properties", "operations"})
      EXPECT_TRUE(model.contains(key)) << model;
    for (const Json& parameter : model["params"]) {
      EXPECT_FALSE(parameter["doc"].get<std::string>().empty()) << parameter;
      if (parameter.contains("choices")) {
        EXPECT_NE(std::ranges::find(parameter["choices"], parameter["default"]), parameter["choices"].end());
      } else {
        EXPECT_LE(parameter["range"][0], parameter["default"]) << parameter;
        EXPECT_LE(parameter["default"], parameter["range"][1]) << parameter;
      }
    }
  }
  for (const char* verb : {"models", "eval", "albedo", "references", "reference", "render", "table", "fit", "refit",
                           "report", "check", "export", "plot", "sphere"}) {
    const Outcome help = run(std::string(verb) + " --help");
    EXPECT_EQ(help.code, 0);
    EXPECT_NE(help.out.find(verb), std::string::npos);
  }
}

TEST_F(CommandLine, ReadingAnUnfinishedRecipeNamesTheJsonPath) {
  std::ofstream(folder_ / "r.json")
      << R"({"recipe":"r","title":"t","description":"d","model":"proxima","published":{"a":-0.5},
    "axes":{"alpha":[0.5]},"tolerance":0.01,"rows":[{"name":"n","views":"all","reference":{"name":"microfacet_diffuse"},
    "grid":"small","metric":"cosine","weights":"uniform","free":[["a","gamma"]]}]})";
  expect_refused("refit r.json -o out", 3, {"r.json", "$.rows[0].free[0][1]", "gamma"});
  std::ofstream(folder_ / "s.json") << "{\"recipe\": ";
  expect_refused("refit s.json -o out", 3, {"s.json, line 1"});
  std::ofstream(folder_ / "k.json") << R"({"recipe":"r","kind":"curvs"})";
  expect_refused("refit k.json -o out", 3, {"k.json", "$.kind", "curves"});
  std::ofstream(folder_ / "c.json")
      << R"({"recipe":"r","kind":"curves","title":"t","description":"d","alpha":[0.5,0.1]})";
  expect_refused("refit c.json -o out", 3, {"c.json", "$.alpha", "increase"});
}

TEST_F(CommandLine, MeasuredFilesAreTables) {
  std::ofstream(folder_ / "tape.dat") << "#DIM 3 1\n#VS 0\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n"
                                         "#PARAM_OUT INV_STERADIAN\n0.5 0.5 0 0.25\n0.5 -0.5 0 0.125\n0.5 0 0.5 0.25\n";
  const Json info = json("table info tape.dat");
  EXPECT_EQ(info["format"], "alta");
  EXPECT_EQ(info["coordinates"], "list");
  EXPECT_EQ(info["entries"], 3);
  EXPECT_EQ(json("eval tape.dat --wi 28.6479,10 --wo 28.6479,10")["values"][0]["f"], Json::array({0.25}));
  EXPECT_EQ(run("table convert tape.dat -o tape.exr").code, 0);
  EXPECT_EQ(json("table info tape.exr")["entries"], 3);
  EXPECT_EQ(json("table compare tape.dat tape.exr --tolerance 1e-7")["passed"], true);
  EXPECT_EQ(run("table convert tape.exr -o tape.csv").code, 0);
  EXPECT_TRUE(content(folder_ / "tape.csv").starts_with("theta_i,phi_i,theta_o,phi_o,f\n"));
  // 0.25 twice and 0.125: by least squares in f the albedo is π times their mean.
  const Json fit = json("fit lambert tape.dat --metric brdf");
  EXPECT_NEAR(fit["params"][0]["value"].get<double>(), 3.14159265 * 0.625 / 3.0, 1e-6);
  expect_refused("table convert tape.dat -o tape.bsdf", 2, {"RGL files alone"});
  expect_refused("table convert tape.dat -o tape.xyz", 2, {".binary"});
  std::ofstream(folder_ / "broken.bsdf") << std::string("tensor_file\0\1\0\1", 15);
  expect_refused("table info broken.bsdf", 3, {"byte 14", "truncated"});
  expect_refused("fit lambert broken.bsdf -o fit.json", 3, {"broken.bsdf"});
}

}  // namespace
