// Long renders: whatever the threads, the shards and the interruptions, the same bits; and no failure stays silent.
#include "reference/render.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <atomic>
#include <bit>
#include <cmath>
#include <fstream>
#include <limits>
#include <numeric>
#include <set>
#include <sstream>

#include "reference/merge.h"
#include "reference/output_file.h"

namespace lobefit {
namespace {

namespace fs = std::filesystem;

/// A folder of its own for each test, removed with it.
class Renders : public ::testing::Test {
 protected:
  Renders()
      : folder_(fs::temp_directory_path() / ("lobefit_render_" + std::to_string(getpid()) + "_" +
                                             ::testing::UnitTest::GetInstance()->current_test_info()->name())) {
    fs::create_directories(folder_);
  }
  ~Renders() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  fs::path file(const std::string& name) const { return folder_ / name; }

  const fs::path folder_;
};

std::string bytes_of(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream content;
  content << stream.rdbuf();
  return content.str();
}

void write_bytes(const fs::path& path, std::string_view bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

/// The Error that `act` throws, or a failure of the test. Every fragment has to be in its message.
template <class Act>
void expect_error(ExitCode code, std::initializer_list<std::string> fragments, Act&& act,
                  const std::string& what = "") {
  try {
    act();
    ADD_FAILURE() << what << ": no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << what << ": " << error.what();
    for (const std::string& fragment : fragments) {
      EXPECT_NE(std::string(error.what()).find(fragment), std::string::npos)
          << what << ": '" << error.what() << "' lacks '" << fragment << "'";
    }
  }
}

class StopAfter : public Monitor {
 public:
  explicit StopAfter(int checks) : left_(checks) {}
  void check() override {
    if (--left_ < 0) throw Interrupted();
  }

 private:
  std::atomic<int> left_;
};

class Counting : public Monitor {
 public:
  void begin(std::string_view, std::uint64_t steps, std::uint64_t done) override {
    steps_ = steps;
    done_ = done;
  }
  void advance(std::uint64_t steps) override { advanced_ += steps; }

  std::uint64_t steps_ = 0, done_ = 0;
  std::atomic<std::uint64_t> advanced_ = 0;
};

// ---- a reference that does what tests want -------------------------------------------------------------------------

/// Noise about a smooth function of the directions; trouble where the light's polar angle is 50 degrees.
class Fake : public Integrator {
 public:
  explicit Fake(const ParameterValues& values)
      : scale_(values.get("scale")), noise_(values.get("noise")), trouble_(values.choice("trouble")) {}

  int orders() const override { return 2; }
  bool has_exact() const override { return true; }
  void exact_row(const Direction& wo, std::span<const Direction> wi, const Line& line) const override {
    for (std::size_t j = 0; j < wi.size(); ++j) set(line, wi.size(), j, value(wo, wi[j]));
  }
  void sample_row(const Direction& wo, std::span<const Direction> wi, const SamplePoints& points, std::uint32_t samples,
                  bool, const Line& line) const override {
    // Stubborn noise does not fall with the samples.
    const bool stubborn = trouble_ == "stubborn";
    double sum = 0.0;
    const std::uint32_t count = stubborn ? 1 : samples;
    for (std::uint32_t k = 0; k < count; ++k) sum += points(k)[0] - 0.5;
    for (std::size_t j = 0; j < wi.size(); ++j) {
      // Towards normal lights there is more noise.
      double f = value(wo, wi[j]) + noise_ * wi[j].z * sum / count;
      const bool at_fifty = std::abs(wi[j].z - std::cos(radians(50.0))) < 1e-9;
      if (at_fifty && trouble_ == "nan") f = std::nan("");
      if (at_fifty && trouble_ == "infinite") f = std::numeric_limits<double>::infinity();
      // The first replicate of a stream is told by its first number.
      if (at_fifty && trouble_ == "nan_replicate" && points(0)[0] > 0.97) f = std::nan("");
      // Too large for one replicate's float, though the mean over 32 is not.
      if (at_fifty && trouble_ == "huge_replicate" && points(0)[0] > 0.97) f = 1e39;
      set(line, wi.size(), j, f);
    }
  }

 private:
  double value(const Direction& wo, const Direction& wi) const { return scale_ * (1.0 + wo.z + 0.1 * wi.x + wi.z); }
  static void set(const Line& line, std::size_t n, std::size_t j, double f) {
    line.values[j] = {f, f, f};
    if (line.orders.empty()) return;
    line.orders[j] = 0.75 * f;
    line.orders[n + j] = 0.25 * f;
  }

  double scale_, noise_;
  std::string trouble_;
};

constexpr std::array<std::string_view, 6> troubles{"none",           "nan",     "infinite", "nan_replicate",
                                                   "huge_replicate", "stubborn"};

Reference fake() {
  std::vector<ParameterInfo> parameters{
      {.name = "scale", .upper = 10.0, .initial = 1.0, .offset = 0},
      {.name = "noise", .upper = 10.0, .initial = 1.0, .offset = 1},
      {.name = "trouble", .upper = 5.0, .choices = troubles, .offset = 2},
      {.name = "stack", .file = true, .components = 0, .offset = 3},
  };
  return {.name = "fake", .parameters = parameters, .make = [](const ParameterValues& values) {
            return std::unique_ptr<const Integrator>(std::make_unique<Fake>(values));
          }};
}

ParameterValues fake_values(const std::string& trouble = "none") {
  ParameterValues values = fake().defaults();
  values.set_text("trouble", trouble);
  return values;
}

Axis axis(const std::string& name, std::vector<double> values, const std::string& unit = "degree") {
  return {name, unit, std::move(values), false};
}

Grid grid() {
  return {axis("theta_i", {0.0, 20.0, 50.0, 80.0}), axis("theta_o", {0.0, 45.0, 85.0}),
          axis("phi", {0.0, 60.0, 180.0})};
}

std::vector<Axis> scales() { return {axis("scale", {0.25, 1.0, 2.0}, "")}; }

/// What is rendered, apart from how.
struct Scene {
  std::string name;
  std::function<Table(Monitor&, const RenderJob&)> render;
};

/// Every kind of render: all ways to sample, a real reference and a model.
std::vector<Scene> scenes() {
  std::vector<Scene> result;
  const auto add_fake = [&](const std::string& name, const RenderOptions& options,
                            const std::string& trouble = "none") {
    result.push_back({name, [=](Monitor& monitor, const RenderJob& job) {
                        return render(fake(), fake_values(trouble), scales(), grid(), options, monitor, job);
                      }});
  };
  add_fake("shared", {.sampling = {.samples = 320}});
  add_fake("independent", {.sampling = {.samples = 320}, .shared_facets = false});
  add_fake("adaptive", {.sampling = {.samples = 320, .stderr_target = 1e-3}});
  add_fake("adaptive, independent", {.sampling = {.samples = 320, .stderr_target = 1e-3}, .shared_facets = false});
  add_fake("philox", {.sampling = {.samples = 320, .sampler = Sampler::philox}});
  add_fake("orders", {.sampling = {.samples = 320}, .orders = true});
  add_fake("exact", {.exact = true, .orders = true});
  add_fake("nan", {.sampling = {.samples = 320}}, "nan");
  add_fake("nan_replicate", {.sampling = {.samples = 320}}, "nan_replicate");
  add_fake("huge_replicate", {.sampling = {.samples = 320}}, "huge_replicate");
  result.push_back({"microfacet_diffuse", [](Monitor& monitor, const RenderJob& job) {
                      ParameterValues values = find_reference("microfacet_diffuse").defaults();
                      values.set("albedo", std::array{0.2, 0.4, 0.8});
                      values.set_text("bounces", "all");
                      return render(find_reference("microfacet_diffuse"), values, {axis("alpha", {0.25, 1.0}, "")},
                                    grid(), {.sampling = {.samples = 320}, .orders = true}, monitor, job);
                    }});
  result.push_back({"proxima", [](Monitor& monitor, const RenderJob& job) {
                      return render(find_model("proxima"), find_model("proxima").defaults(),
                                    {axis("alpha", {0.25, 1.0}, "")}, grid(), monitor, job);
                    }});
  return result;
}

constexpr std::chrono::milliseconds at_once{0};

// ---- shards --------------------------------------------------------------------------------------------------------

TEST(Shards, AreReadStrictly) {
  EXPECT_EQ(Shards::parse("2/3", "").text(), "2/3");
  EXPECT_EQ(Shards::parse("1,3/7", "").text(), "1,3/7");
  EXPECT_TRUE(Shards::parse("1/1", "").all());
  EXPECT_EQ(Shards::parse("1,3/4", "").missing(), (std::vector<std::uint32_t>{2, 4}));
  for (const char* text :
       {"",      "/",   "1",    "1/",    "/3",    "0/3",   "4/3",  "a/b",  "1/3x",         " 1/3",          "-1/3",
        "1.5/3", "1/0", "1//3", "1/3/3", "1,1/3", "2,1/3", "1,/3", ",1/3", "1/4294967297", "99999999999/3", "1e0/3"}) {
    expect_error(
        ExitCode::usage, {"--shard", "I/N"}, [&] { Shards::parse(text, "--shard"); }, text);
  }
}

TEST(Shards, ShareTheLinesFairly) {
  for (const std::uint32_t count : {1u, 2u, 3u, 7u, 9u, 18u, 36u}) {
    for (const std::size_t lines : {std::size_t{36}, std::size_t{54}, std::size_t{61}}) {
      std::vector<std::size_t> held(count + 1, 0);
      for (std::size_t y = 0; y < lines; ++y) {
        const std::uint32_t owner = Shards{count, {1}}.of(y);
        ASSERT_GE(owner, 1u);
        ASSERT_LE(owner, count);
        ++held[owner];
        for (std::uint32_t index = 1; index <= count; ++index) {
          EXPECT_EQ((Shards{count, {index}}.hold(y)), index == owner);
        }
      }
      for (std::uint32_t index = 1; index <= count; ++index) {
        EXPECT_GE(held[index], lines / count);
        EXPECT_LE(held[index], lines / count + 1);
      }
    }
  }
  // 18 views and 18 shards: no shard has all the grazing ones.
  std::set<std::uint32_t> grazing;
  for (std::size_t row = 0; row < 18; ++row) grazing.insert(Shards{18, {1}}.of(row * 18 + 17));
  EXPECT_EQ(grazing.size(), 18u);
}

TEST_F(Renders, HaveTheSameBytesForAnyThreadsAndShards) {
  for (const Scene& scene : scenes()) {
    SCOPED_TRACE(scene.name);
    Monitor silent;
    std::string whole;
    {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
      scene.render(silent, {}).write(file("whole.exr"));
      whole = bytes_of(file("whole.exr"));
    }
    scene.render(silent, {}).write(file("many.exr"));
    EXPECT_EQ(bytes_of(file("many.exr")), whole);

    std::vector<fs::path> shards;
    std::size_t failed = 0;
    for (const std::uint32_t index : {3u, 1u, 2u}) {
      const Shards shard{3, {index}};
      const Table table = scene.render(silent, {.shards = shard});
      shards.push_back(file("shard" + std::to_string(index) + ".exr"));
      table.write(shards.back());
      EXPECT_EQ(Table::read(shards.back()).shards, shard);
      failed += table.failed().size();
      for (std::size_t entry = 0; entry < table.entries(); ++entry) {
        if (!shard.hold(entry / table.width())) {
          EXPECT_EQ(table.valid[entry], 0);
        }
      }
    }
    const Table merged = merge_shards(shards, false);
    EXPECT_EQ(merged.failed().size(), failed);
    merged.write(file("merged.exr"));
    EXPECT_EQ(bytes_of(file("merged.exr")), whole);

    // In two steps, the first of them partial.
    merge_shards(std::span(shards).first(2), true).write(file("partial.exr"));
    EXPECT_EQ(Table::read(file("partial.exr")).shards.text(), "1,3/3");
    const std::vector<fs::path> rest{shards[2], file("partial.exr")};
    merge_shards(rest, false).write(file("merged.exr"));
    EXPECT_EQ(bytes_of(file("merged.exr")), whole);
  }
}

TEST_F(Renders, OnlyShardsOfOneRenderAreMerged) {
  Monitor silent;
  const auto write = [&](const std::string& name, Shards shards, std::uint64_t seed = 1,
                         std::vector<Axis> axes = scales()) {
    Table table = render(fake(), fake_values(), std::move(axes), grid(), {.sampling = {.samples = 320, .seed = seed}},
                         silent, {.shards = std::move(shards)});
    table.command = "by " + name;
    table.write(file(name));
    return file(name);
  };
  const fs::path one = write("one.exr", {3, {1}}), two = write("two.exr", {3, {2}}),
                 three = write("three.exr", {3, {3}});
  const auto merge = [](std::vector<fs::path> files, bool partial = false) { return merge_shards(files, partial); };
  EXPECT_EQ(merge({three, one, two}).command, "by one.exr") << "whatever the order";
  expect_error(ExitCode::invalid_input, {"missing shard 2 of 3", "--partial"}, [&] { merge({one, three}); });
  expect_error(ExitCode::invalid_input, {"missing shards 1, 3 of 3"}, [&] { merge({two}); });
  expect_error(ExitCode::invalid_input, {"shard 1 is in", "one.exr too"}, [&] { merge({one, two, one}); });
  expect_error(ExitCode::invalid_input, {"whole", "whole.exr"}, [&] { merge({one, write("whole.exr", {})}); });
  expect_error(ExitCode::invalid_input, {"seed is 1 there and 2 here", "other.exr"}, [&] {
    merge({one, two, write("other.exr", {3, {3}}, 2)});
  });
  expect_error(ExitCode::invalid_input, {"axes.scale.values", "axes.exr"}, [&] {
    merge({one, two, write("axes.exr", {3, {3}}, 1, {axis("scale", {0.25, 1.0, 3.0}, "")})});
  });
  expect_error(ExitCode::invalid_input, {"one of 4 shards"}, [&] { merge({one, write("four.exr", {4, {2}})}); });
  expect_error(ExitCode::invalid_input, {"absent.exr"}, [&] { merge({one, file("absent.exr")}); });
  expect_error(ExitCode::usage, {"9 lines can't be cut into 10 shards"}, [&] { write("ten.exr", {10, {1}}); });
}

// ---- what is kept --------------------------------------------------------------------------------------------------

TEST_F(Renders, GoOnAfterInterruptionsWithTheSameBytes) {
  for (const Scene& scene : scenes()) {
    for (const Shards& shards : {Shards{}, Shards{2, {2}}}) {
      SCOPED_TRACE(scene.name + ", shard " + shards.text());
      Monitor silent;
      scene.render(silent, {.shards = shards}).write(file("whole.exr"));
      const std::string whole = bytes_of(file("whole.exr"));
      // Interrupted again and again; with a long patience only the interruption itself writes.
      for (const int checks : {1, 3, 40, 77, 150}) {
        fs::remove(file("t.exr.part"));
        int runs = 0;
        std::size_t before = 0;
        bool finished = false;
        while (!finished) {
          // More and more, so that it ends where a line needs more checks than the first run has.
          StopAfter monitor(checks * ++runs);
          PartFile part(file("t.exr"),
                        {.resume = true, .patience = runs % 2 == 0 ? at_once : std::chrono::milliseconds(1'000'000)});
          try {
            scene.render(monitor, {.shards = shards, .part = &part}).write(file("t.exr"));
            part.remove();
            finished = true;
          } catch (const Interrupted&) {
            EXPECT_EQ(fs::exists(part.path()), part.kept() > 0);
          }
          EXPECT_EQ(part.resumed(), before);
          before = part.kept();
        }
        EXPECT_EQ(bytes_of(file("t.exr")), whole) << checks;
        EXPECT_FALSE(fs::exists(file("t.exr.part")));
        fs::remove(file("t.exr"));
      }
    }
  }
}

class KeptLines : public Renders {
 protected:
  Table render_fake(const RenderJob& job, const RenderOptions& options = {.sampling = {.samples = 320}},
                    const ParameterValues& values = fake_values()) {
    Monitor silent;
    return render(fake(), values, scales(), grid(), options, silent, job);
  }
  /// Renders all, and leaves what was kept behind.
  void leave_part() {
    PartFile part(file("t.exr"), {.patience = at_once});
    render_fake({.part = &part}).write(file("whole.exr"));
    ASSERT_EQ(part.kept(), 9u);
  }
};

TEST_F(KeptLines, ShortRendersDoNotTouchTheDisk) {
  PartFile part(file("t.exr"), {});
  render_fake({.part = &part});
  EXPECT_FALSE(fs::exists(part.path()));
  EXPECT_EQ(part.kept(), 0u);
  part.remove();
}

TEST_F(KeptLines, SurviveATornEnd) {
  leave_part();
  const std::string kept = bytes_of(file("t.exr.part")), whole = bytes_of(file("whole.exr"));
  const std::size_t block = 8 + 8 + 34 * 12 * 4 + 12 + 32, header = kept.size() - 9 * block;
  ASSERT_LT(header, 2000u) << "the file is a header and nine blocks";
  for (std::size_t length = 0; length <= kept.size(); length += length < header + 100 ? 13 : 97) {
    write_bytes(file("t.exr.part"), kept.substr(0, length));
    PartFile part(file("t.exr"), {.resume = true, .patience = at_once});
    render_fake({.part = &part}).write(file("t.exr"));
    EXPECT_EQ(bytes_of(file("t.exr")), whole) << length;
    EXPECT_EQ(part.resumed(), length < header ? 0 : (length - header) / block) << length;
    EXPECT_EQ(part.kept(), 9u);
    EXPECT_EQ(fs::file_size(file("t.exr.part")), kept.size()) << length;
    EXPECT_EQ(part.dropped(), length >= header && (length - header) % block != 0) << length;
    part.remove();
    fs::remove(file("t.exr"));
  }
}

TEST_F(KeptLines, AreNotTakenOverWhenDamaged) {
  leave_part();
  const std::string kept = bytes_of(file("t.exr.part")), whole = bytes_of(file("whole.exr"));
  const std::size_t block = 8 + 8 + 34 * 12 * 4 + 12 + 32, header = kept.size() - 9 * block;
  for (std::size_t place = 0; place < kept.size(); place += place < header ? 7 : 131) {
    std::string broken = kept;
    broken[place] = static_cast<char>(broken[place] ^ 0x10);
    write_bytes(file("t.exr.part"), broken);
    PartFile part(file("t.exr"), {.resume = true, .patience = at_once});
    try {
      render_fake({.part = &part}).write(file("t.exr"));
      EXPECT_EQ(bytes_of(file("t.exr")), whole) << place;
      if (place >= header) {
        EXPECT_EQ(part.resumed(), (place - header) / block) << place;
      } else {
        EXPECT_EQ(part.resumed(), 0u) << place;
      }
    } catch (const Error& error) {
      EXPECT_LT(place, header) << error.what();
      EXPECT_EQ(bytes_of(file("t.exr.part")), broken) << "what is refused stays as it is";
    }
    fs::remove(file("t.exr"));
  }
  // Blocks after noise, and noise after blocks.
  write_bytes(file("t.exr.part"), kept + std::string(100'000, '\xa5'));
  PartFile part(file("t.exr"), {.resume = true});
  render_fake({.part = &part}).write(file("t.exr"));
  EXPECT_EQ(part.resumed(), 9u);
  EXPECT_TRUE(part.dropped());
  EXPECT_EQ(bytes_of(file("t.exr")), whole);
}

TEST_F(KeptLines, OfAnotherRenderAreRefusedWithWhatDiffers) {
  write_bytes(file("stack.json"), R"({"layers":[1]})");
  write_bytes(file("same.json"), R"({"layers": [1]})");
  write_bytes(file("other.json"), R"({"layers":[2]})");
  struct Setting {
    RenderOptions options{.sampling = {.samples = 320, .stderr_target = 1e-2}};
    ParameterValues values = fake_values();
    std::vector<Axis> axes{axis("scale", {0.25, 1.0}, "")};
    Grid where = grid();
    Shards shards;
    Reference reference = fake();
  };
  const auto go = [&](const Setting& s, const PartFile::Options& options) {
    PartFile part(file("t.exr"), options);
    Monitor silent;
    render(s.reference, s.values, s.axes, s.where, s.options, silent, {.shards = s.shards, .part = &part});
    return part.resumed();
  };
  Setting original;
  original.values.set_text("stack", file("stack.json").string());
  go(original, {.patience = at_once});
  const std::string kept = bytes_of(file("t.exr.part"));

  struct Change {
    std::string fragment;
    std::function<void(Setting&)> make;
  };
  for (const Change& change : {
           Change{"seed is 1 there and 2 here", [](Setting& s) { s.options.sampling.seed = 2; }},
           {"samples is 320 there and 640 here", [](Setting& s) { s.options.sampling.samples = 640; }},
           {"sampler is sobol there and philox here", [](Setting& s) { s.options.sampling.sampler = Sampler::philox; }},
           {"stderr_target is 0.01 there and 0.02 here", [](Setting& s) { s.options.sampling.stderr_target = 0.02; }},
           {"stderr_target", [](Setting& s) { s.options.sampling.stderr_target = 0.0; }},
           {"shared_facets is true there and false here", [](Setting& s) { s.options.shared_facets = false; }},
           {"method is monte_carlo there and exact here", [](Setting& s) { s.options.exact = true; }},
           {"orders is 0 there and 2 here", [](Setting& s) { s.options.orders = true; }},
           {"params.noise is 1.0 there and 0.5 here", [](Setting& s) { s.values.set("noise", 0.5); }},
           {"params.trouble is none there and nan here", [](Setting& s) { s.values.set_text("trouble", "nan"); }},
           {"params.stack.layers is [1] there and [2] here",
            [&](Setting& s) { s.values.set_text("stack", file("other.json").string()); }},
           {"axes.scale.values is [0.25,1.0] there and [0.25,2.0] here",
            [](Setting& s) {
              s.axes = {axis("scale", {0.25, 2.0}, "")};
            }},
           {"axes.noise",
            [](Setting& s) {
              s.axes = {axis("noise", {0.25, 1.0}, "")};
            }},
           {"axes.theta_o.values", [](Setting& s) { s.where.theta_o.values[1] = 44.0; }},
           {"axes.phi.kind", [](Setting& s) { s.where.phi.midpoints = true; }},
           {"shard is 1/1 there and 2/3 here",
            [](Setting& s) {
              s.shards = {3, {2}};
            }},
       }) {
    Setting changed = original;
    change.make(changed);
    expect_error(
        ExitCode::usage, {change.fragment, "another render", "t.exr.part"}, [&] { go(changed, {.resume = true}); },
        change.fragment);
    expect_error(
        ExitCode::usage, {change.fragment, "--force"}, [&] { go(changed, {}); }, change.fragment);
    expect_error(
        ExitCode::usage, {change.fragment}, [&] { go(changed, {.resume = true, .overwrite = true}); }, change.fragment);
    EXPECT_EQ(bytes_of(file("t.exr.part")), kept) << "refusals change nothing";
  }
  // The same render, but nobody asked to go on with it.
  expect_error(ExitCode::usage, {"t.exr.part", "--resume", "--force"}, [&] { go(original, {}); });
  // What a file holds counts, not where it lies.
  Setting moved = original;
  moved.values.set_text("stack", file("same.json").string());
  EXPECT_EQ(go(moved, {.resume = true}), 6u);
  // Starting anew.
  EXPECT_EQ(go(original, {.overwrite = true}), 0u);
  write_bytes(file("t.exr.part"), "somebody else's");
  expect_error(ExitCode::usage, {"t.exr.part", "not a file of kept lines"}, [&] { go(original, {.resume = true}); });
}

TEST_F(KeptLines, AreNotNeededWhereTheOutputIsFinished) {
  render_fake({}).write(file("t.exr"));
  const std::string whole = bytes_of(file("t.exr"));
  StopAfter at_any_work(0);
  {
    PartFile part(file("t.exr"), {.resume = true});
    Table table =
        render(fake(), fake_values(), scales(), grid(), {.sampling = {.samples = 320}}, at_any_work, {.part = &part});
    EXPECT_TRUE(part.output_is_finished());
    table.write(file("again.exr"));
    EXPECT_EQ(bytes_of(file("again.exr")), whole);
  }
  PartFile part(file("t.exr"), {.resume = true});
  expect_error(ExitCode::usage, {"seed is 1 there and 2 here", "t.exr)", "--force"},
               [&] { render_fake({.part = &part}, {.sampling = {.samples = 320, .seed = 2}}); });
  // To be replaced: then it does not count.
  PartFile fresh(file("t.exr"), {.resume = true, .overwrite = true});
  render_fake({.part = &fresh}, {.sampling = {.samples = 320, .seed = 2}});
  EXPECT_FALSE(fresh.output_is_finished());
}

TEST_F(KeptLines, BelongToOneProgramAtATime) {
  leave_part();
  PartFile first(file("t.exr"), {.resume = true});
  render_fake({.part = &first});
  PartFile second(file("t.exr"), {.resume = true});
  expect_error(ExitCode::usage, {"another lobefit", "t.exr.part"}, [&] { render_fake({.part = &second}); });
}

TEST_F(KeptLines, FullDisksAreErrors) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  fs::create_symlink("/dev/full", file("t.exr.part"));
  PartFile part(file("t.exr"), {.resume = true, .patience = at_once});
  expect_error(ExitCode::failure, {"t.exr.part", "can't keep finished lines", "--resume"},
               [&] { render_fake({.part = &part}); });
}

TEST_F(KeptLines, CountAsDoneButNotAsThisRunsWork) {
  {
    StopAfter monitor(150);
    PartFile part(file("t.exr"), {.patience = at_once});
    EXPECT_THROW(
        render(fake(), fake_values(), scales(), grid(), {.sampling = {.samples = 320}}, monitor, {.part = &part}),
        Interrupted);
  }
  for (const RenderOptions& options :
       {RenderOptions{.sampling = {.samples = 320}},
        RenderOptions{.sampling = {.samples = 320}, .shared_facets = false},
        RenderOptions{.sampling = {.samples = 320, .stderr_target = 1e-3}}, RenderOptions{.exact = true}}) {
    Counting monitor;
    render(fake(), fake_values(), scales(), grid(), options, monitor);
    EXPECT_EQ(monitor.advanced_, monitor.steps_);
    EXPECT_EQ(monitor.done_, 0u);
  }
  Counting monitor;
  PartFile part(file("t.exr"), {.resume = true});
  render(fake(), fake_values(), scales(), grid(), {.sampling = {.samples = 320}}, monitor, {.part = &part});
  EXPECT_GT(part.resumed(), 0u);
  EXPECT_EQ(monitor.done_, part.resumed() * 32);
  EXPECT_EQ(monitor.steps_, 9u * 32);
  EXPECT_EQ(monitor.advanced_, monitor.steps_ - monitor.done_);
}

// ---- what fails, and what falls short ------------------------------------------------------------------------------

TEST(Failures, AreMaskedCountedAndPlaced) {
  Monitor silent;
  for (const bool shared : {true, false}) {
    for (const char* trouble : {"nan", "infinite"}) {
      const Table table = render(fake(), fake_values(trouble), scales(), grid(),
                                 {.sampling = {.samples = 320}, .shared_facets = shared}, silent);
      EXPECT_EQ(table.failed().size(), table.entries() / 4);
      EXPECT_EQ(table.masked(), table.entries() / 4);
      for (std::size_t entry = 0; entry < table.entries(); ++entry) {
        EXPECT_EQ(table.valid[entry] == 0, table.theta_i_index(entry) == 2);
      }
      EXPECT_EQ(table.place(table.failed().front()), "theta_i 50, theta_o 0, phi 0, scale 0.25");
    }
  }
}

TEST(Failures, OfOneReplicateMaskTheEntry) {
  // A quarter of the lights, in those streams where a replicate goes wrong: in some, not in all.
  Monitor silent;
  for (const char* trouble : {"nan_replicate", "huge_replicate"}) {
    const Table table = render(fake(), fake_values(trouble), scales(), grid(), {.sampling = {.samples = 320}}, silent);
    EXPECT_GT(table.failed().size(), 0u) << trouble;
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      bool finite = std::isfinite(table.value(entry)) && std::isfinite(table.standard_error(entry));
      for (int r = 0; r < replicate_count; ++r) finite = finite && std::isfinite(table.replicate(r, entry));
      EXPECT_EQ(table.valid[entry] != 0, finite) << trouble << " " << table.place(entry);
      if (table.theta_i_index(entry) != 2) {
        EXPECT_NE(table.valid[entry], 0);
      }
    }
  }
}

TEST(Failures, DoNotHideErrorsFromTheTarget) {
  // The noisiest lights come before those that fail, in the same line.
  Monitor silent;
  const Table table = render(fake(), fake_values("nan"), {}, grid(),
                             {.sampling = {.samples = 64, .stderr_target = 2e-3, .sampler = Sampler::philox}}, silent);
  EXPECT_EQ(table.failed().size(), table.entries() / 4);
  for (std::size_t entry = 0; entry < table.entries(); ++entry) {
    if (table.valid[entry]) {
      EXPECT_LE(table.standard_error(entry), 2e-3f);
    }
    EXPECT_GT(table.sample_counts[entry], 64.0f);
    EXPECT_LT(table.sample_counts[entry], 1e6f) << "what fails must not draw samples for ever";
  }
}

TEST(Targets, OutOfReachEndAtTheMostSamples) {
  Monitor silent;
  for (const bool shared : {true, false}) {
    const Table table = render(fake(), fake_values("stubborn"), {}, grid(),
                               {.sampling = {.samples = 1024, .stderr_target = 1e-6}, .shared_facets = shared}, silent);
    EXPECT_EQ(table.stderr_target, 1e-6);
    for (std::size_t entry = 0; entry < table.entries(); ++entry) {
      EXPECT_EQ(table.sample_counts[entry], static_cast<float>(most_samples));
      EXPECT_GT(table.standard_error(entry), 1e-6f);
      EXPECT_EQ(table.valid[entry], 1) << "a large error is no failure";
    }
  }
}

TEST(Targets, AreMetPerEntryOrPerLine) {
  Monitor silent;
  const auto counts = [&](bool shared) {
    const Table table = render(
        fake(), fake_values(), {}, grid(),
        {.sampling = {.samples = 64, .stderr_target = 2e-3, .sampler = Sampler::philox}, .shared_facets = shared},
        silent);
    std::size_t mixed_lines = 0;
    for (std::size_t y = 0; y < table.height(); ++y) {
      const auto first = table.sample_counts.begin() + static_cast<std::ptrdiff_t>(y * table.width());
      mixed_lines += std::set<float>(first, first + static_cast<std::ptrdiff_t>(table.width())).size() > 1 ? 1 : 0;
    }
    for (const float error : table.stderr_values) EXPECT_LE(error, 2e-3f);
    return std::pair(mixed_lines, std::accumulate(table.sample_counts.begin(), table.sample_counts.end(), 0.0));
  };
  const auto [mixed_shared, shared] = counts(true);
  const auto [mixed_independent, independent] = counts(false);
  EXPECT_EQ(mixed_shared, 0u) << "a line of shared facets has the samples that its worst light needs";
  EXPECT_EQ(mixed_independent, 3u);
  EXPECT_LT(independent, shared);
}

// ---- another albedo ------------------------------------------------------------------------------------------------

class Recolor : public Renders {
 protected:
  /// Order n = 1, 2, … of an entry.
  static double order(const Table& table, std::size_t n, std::size_t entry) {
    return table.order_values[(n - 1) * table.entries() + entry];
  }
  static Table diffuse(const std::array<double, 3>& albedo, const RenderOptions& options, double alpha = 1.0) {
    ParameterValues values = find_reference("microfacet_diffuse").defaults();
    values.set("alpha", alpha);
    values.set("albedo", albedo);
    values.set_text("bounces", "all");
    Monitor silent;
    return render(find_reference("microfacet_diffuse"), values, {}, grid(), options, silent);
  }
};

TEST_F(Recolor, EqualsARenderAtThatAlbedo) {
  for (const bool exact : {false, true}) {
    const RenderOptions options{.sampling = {.samples = 1024}, .exact = exact, .orders = true};
    diffuse({1.0, 1.0, 1.0}, options).write(file("white.exr"));
    const Table white = Table::read(file("white.exr"));
    ASSERT_EQ(white.orders, 24);
    for (const std::array<double, 3>& albedo : {std::array{0.9, 0.5, 0.2}, {0.3, 0.3, 0.3}, {1.0, 1.0, 1.0}}) {
      if (exact && albedo[0] != 0.9) continue;  // one is enough, and slow
      const Table direct = diffuse(albedo, options);
      const Table recolored = white.with_albedo({albedo[0], albedo[1], albedo[2]});
      EXPECT_EQ(recolored.fingerprint(), direct.fingerprint());
      ASSERT_EQ(recolored.channels, direct.channels);
      ASSERT_EQ(recolored.replicates.size(), direct.replicates.size());
      for (std::size_t entry = 0; entry < direct.entries(); ++entry) {
        for (int c = 0; c < direct.channels; ++c) {
          const float f = direct.value(entry, c);
          // 24 floats are rounded before the sum, and it afterwards. Order 24 lumps all further ones: it is weighted by
          // ρ^24, where they weigh ρ^25 and less.
          const double rho = albedo[static_cast<std::size_t>(c)];
          const double weight = rho < 1.0 ? std::pow(rho, 24) : 0.0;
          const double lumped = order(white, 24, entry) * weight;
          EXPECT_LT(lumped, 1e-5) << "and that is little";
          EXPECT_NEAR(recolored.value(entry, c), f, 4e-7 * f + lumped) << direct.place(entry);
          EXPECT_NEAR(recolored.standard_error(entry, c), direct.standard_error(entry, c),
                      1e-4f * direct.standard_error(entry, c) + 1e-7f * f)
              << direct.place(entry);
          for (int r = 0; r < replicate_count && !exact; ++r) {
            const double f_r = direct.replicate(r, entry, c);
            const auto slot = (static_cast<std::size_t>(r) * 24 + 23) * white.entries() + entry;
            EXPECT_NEAR(recolored.replicate(r, entry, c), f_r, 4e-7 * f_r + white.order_replicates[slot] * weight);
          }
        }
      }
    }
  }
}

TEST_F(Recolor, TheLastOrderLumpsAllFurtherOnes) {
  const Table white = diffuse({1.0, 1.0, 1.0}, {.exact = true, .orders = true});
  for (std::size_t entry = 0; entry < white.entries(); ++entry) {
    // Orders fall from one to the next; what is more than the one before holds others too. Values know all orders.
    EXPECT_LT(order(white, 23, entry), 0.8 * order(white, 22, entry));
    EXPECT_GT(order(white, 24, entry), 1.5 * order(white, 23, entry)) << white.place(entry);
    double sum = 0.0;
    for (std::size_t n = 1; n <= 24; ++n) sum += order(white, n, entry);
    EXPECT_NEAR(white.value(entry), sum, 4e-7 * sum);
  }
}

TEST_F(Recolor, WithoutReplicatesErrorsAreBoundedFromAbove) {
  const RenderOptions options{.sampling = {.samples = 1024}, .orders = true, .shared_facets = false};
  const Table direct = diffuse({0.5, 0.5, 0.5}, options);
  const Table recolored = diffuse({1.0, 1.0, 1.0}, options).with_albedo({0.5, 0.5, 0.5});
  for (std::size_t entry = 0; entry < direct.entries(); ++entry) {
    EXPECT_NEAR(recolored.value(entry), direct.value(entry), 4e-7f * direct.value(entry));
    EXPECT_GE(recolored.standard_error(entry), direct.standard_error(entry) * 0.9999f);
  }
}

TEST_F(Recolor, NeedsOrdersAndOneAlbedo) {
  expect_error(ExitCode::usage, {"--orders"}, [] {
    diffuse({1.0, 1.0, 1.0}, {.exact = true}).with_albedo({0.5, 0.5, 0.5});
  });
  Monitor silent;
  const Table other = render(fake(), fake_values(), {}, grid(), {.exact = true, .orders = true}, silent);
  expect_error(ExitCode::usage, {"albedo", "fake"}, [&] { other.with_albedo({0.5, 0.5, 0.5}); });
  ParameterValues values = find_reference("microfacet_diffuse").defaults();
  values.set_text("bounces", "all");
  const Table axes = render(find_reference("microfacet_diffuse"), values, {axis("albedo", {0.5, 1.0}, "")}, grid(),
                            {.sampling = {.samples = 64}, .orders = true}, silent);
  expect_error(ExitCode::usage, {"albedo"}, [&] { axes.with_albedo({0.5, 0.5, 0.5}); });
}

// ---- left behind by a kill -----------------------------------------------------------------------------------------

TEST_F(Renders, TemporaryFilesOfKilledProgramsAreRemoved) {
  write_bytes(file(".t.partial-999999999.exr"), "");  // no such process: the kernel's largest is 2^22
  write_bytes(file(".t.partial-1.exr"), "");          // alive
  write_bytes(file(".t.partial-x.exr"), "");
  write_bytes(file(".tt.partial-999999999.exr"), "");
  { OutputFile output(file("t.exr"), false); }
  EXPECT_FALSE(fs::exists(file(".t.partial-999999999.exr")));
  EXPECT_TRUE(fs::exists(file(".t.partial-1.exr")));
  EXPECT_TRUE(fs::exists(file(".t.partial-x.exr")));
  EXPECT_TRUE(fs::exists(file(".tt.partial-999999999.exr")));
}

}  // namespace
}  // namespace lobefit
