// lobefit_convergence FILE.png: error against time of every way to make a table of diffuse microfacets, drawn with
// gnuplot, and the figures printed. One thread; seconds are the thread's CPU time, table totals.
//
// Error: rms of π (f - truth) over a table. Left: one bounce, 123,120 entries (20 α × 18 θo × 18 θi × 19 φ); truth is
// the quadrature. Right: all bounces at ρ = 1, 2,430 entries (3 α × 9 × 9 × 10); truth is SmithOrders at a resolution
// beyond those shown. Where a way has no shared work, a subset of entries is run and its time scaled to the whole
// table.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include "reference/diffuse/facet_quadrature.h"
#include "reference/diffuse/microfacet_diffuse.h"
#include "reference/diffuse/smith_orders.h"
#include "reference/references.h"
#include "reference/visible_normals.h"

namespace lobefit {

namespace {

double seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// One line of a table: a view and its lights on one surface.
struct TableLine {
  std::size_t surface;
  Direction wo;
  std::vector<Direction> wi;
};

struct Work {
  std::vector<double> alphas;
  std::vector<std::unique_ptr<const Integrator>> surfaces;
  std::vector<TableLine> lines;
  std::vector<std::vector<double>> truth;  // [line][light]

  std::size_t entries() const { return lines.size() * lines.front().wi.size(); }
};

/// Midpoints of the hemisphere's cells.
Work make_work(std::vector<double> alphas, int polar, int azimuths, std::string_view bounces) {
  Work work;
  work.alphas = std::move(alphas);
  for (std::size_t k = 0; k < work.alphas.size(); ++k) {
    ParameterValues values = find_reference(MicrofacetDiffuse::name).defaults();
    values.set("alpha", work.alphas[k]);
    values.set_text("bounces", bounces);
    work.surfaces.push_back(find_reference(MicrofacetDiffuse::name).make(values));
    for (int o = 0; o < polar; ++o) {
      TableLine line{k, direction(pi / 2.0 * (o + 0.5) / polar, 0.0), {}};
      for (int i = 0; i < polar; ++i) {
        for (int j = 0; j < azimuths; ++j) {
          line.wi.push_back(direction(pi / 2.0 * (i + 0.5) / polar, pi * j / (azimuths - 1)));
        }
      }
      work.lines.push_back(std::move(line));
    }
  }
  return work;
}

struct Point {
  double seconds, error;
};
struct Curve {
  std::string title;
  std::vector<Point> points;
};

/// f of every `stride`-th line at every `stride`-th light by `row`; time scaled to the whole table.
Point measure(const Work& work, std::size_t line_stride, std::size_t light_stride,
              const std::function<void(std::size_t line, std::span<const Direction> wi, std::span<double> f)>& row) {
  double squares = 0.0, count = 0.0;
  const double start = seconds();
  for (std::size_t l = 0; l < work.lines.size(); l += line_stride) {
    std::vector<Direction> wi;
    std::vector<double> truth;
    for (std::size_t j = l % light_stride; j < work.lines[l].wi.size(); j += light_stride) {
      wi.push_back(work.lines[l].wi[j]);
      truth.push_back(work.truth[l][j]);
    }
    std::vector<double> f(wi.size());
    row(l, wi, f);
    for (std::size_t j = 0; j < f.size(); ++j) squares += (f[j] - truth[j]) * (f[j] - truth[j]), ++count;
  }
  const double spent = seconds() - start;
  return {spent * static_cast<double>(work.entries()) / count, pi * std::sqrt(squares / count)};
}

/// Rows that share their facets, in float.
Point shared_rows(const Work& work, Sampler sampler, std::uint32_t samples) {
  return measure(work, 1, 1, [&](std::size_t l, std::span<const Direction> wi, std::span<double> f) {
    std::vector<Rgb> values(wi.size());
    work.surfaces[work.lines[l].surface]->sample_row(work.lines[l].wo, wi, SamplePoints(sampler, {1, l, 0}), samples,
                                                     true, {.values = values});
    for (std::size_t j = 0; j < f.size(); ++j) f[j] = values[j].x;
  });
}

/// Every entry by itself in scalar double with its own Philox numbers.
Point plain_monte_carlo(const Work& work, std::uint32_t samples, std::size_t line_stride, std::size_t light_stride) {
  return measure(
      work, line_stride, light_stride, [&](std::size_t l, std::span<const Direction> wi, std::span<double> f) {
        for (std::size_t j = 0; j < f.size(); ++j) {
          Rgb value;
          work.surfaces[work.lines[l].surface]->sample_row(work.lines[l].wo, wi.subspan(j, 1),
                                                           SamplePoints(Sampler::philox, {2, l * wi.size() + j, 0}),
                                                           samples, false, {.values = {&value, 1}});
          f[j] = value.x;
        }
      });
}

void print(const Curve& curve) {
  for (const Point& p : curve.points) fmt::print("{:<40} {:>12.4g} s  rms {:.3g}\n", curve.title, p.seconds, p.error);
  std::fflush(stdout);
}

/// Seconds at which a curve of slope -1/2 that ends in its last point would reach `error`.
double seconds_at(const Curve& curve, double error) {
  const Point& last = curve.points.back();
  return last.seconds * (last.error / error) * (last.error / error);
}

std::vector<Curve> one_bounce(std::string& summary) {
  std::vector<double> alphas;
  for (int k = 1; k <= 20; ++k) alphas.push_back(0.05 * k);
  Work work = make_work(alphas, 18, 19, "1");
  const double start = seconds();
  for (const TableLine& line : work.lines) {
    std::vector<Rgb> values(line.wi.size());
    work.surfaces[line.surface]->exact_row(line.wo, line.wi, {.values = values});
    work.truth.emplace_back();
    for (const Rgb& value : values) work.truth.back().push_back(value.x);
  }
  const double quadrature = seconds() - start;
  std::vector<Curve> curves(4);
  curves[0].title = "plain Monte Carlo, scalar double";
  for (const std::uint32_t n : {16u, 64u, 256u, 1024u, 4096u, 16384u}) {
    // Fewer entries of more samples: about 2^22 samples in all.
    curves[0].points.push_back(plain_monte_carlo(work, n, n < 1024 ? 7 : 23, n < 256 ? 5 : n < 4096 ? 41 : 61));
  }
  curves[1].title = "shared facets, Philox, float";
  curves[2].title = "shared facets, Sobol, float";
  for (std::uint32_t n = 64; n <= 65536; n *= 4) {
    curves[1].points.push_back(shared_rows(work, Sampler::philox, n));
    curves[2].points.push_back(shared_rows(work, Sampler::sobol, n));
  }
  // Its error is not measured here: tests/reference_test holds it to 3.7e-12 of an independent quadrature.
  curves[3].title = "quadrature (its error: reference\\_test)";
  curves[3].points.push_back({quadrature, 3.7e-12});
  for (const Curve& curve : curves) print(curve);

  const auto reaches =
      std::find_if(curves[2].points.begin(), curves[2].points.end(), [](const Point& p) { return p.error <= 1e-5; });
  if (reaches != curves[2].points.end()) {
    const double plain = seconds_at(curves[0], reaches->error);
    summary += fmt::format(
        "one bounce, 123,120 entries: Sobol reaches rms {:.2g} in {:.3g} s; plain Monte Carlo, scaled by 1/sqrt(n) "
        "from "
        "its last point, needs {:.3g} s for that: {:.3g} times as long\n",
        reaches->error, reaches->seconds, plain, plain / reaches->seconds);
  }
  return curves;
}

std::vector<Curve> all_bounces(std::string& summary) {
  Work work = make_work({0.25, 0.5, 1.0}, 9, 10, "all");
  const auto solve = [&](const SmithOrders::Resolution& resolution) {
    std::vector<std::vector<double>> f;
    std::unique_ptr<SmithOrders> orders;
    std::size_t surface = work.alphas.size();
    for (const TableLine& line : work.lines) {
      const double alpha = work.alphas[line.surface];
      if (line.surface != surface) orders = std::make_unique<SmithOrders>(Distribution::ggx, alpha, 64, resolution);
      surface = line.surface;
      f.emplace_back();
      for (const Direction& wi : line.wi) {
        const double lambdas =
            smith_lambda(Distribution::ggx, alpha, wi) + smith_lambda(Distribution::ggx, alpha, line.wo);
        double sum =
            shared_visibility(Distribution::ggx, alpha, wi, line.wo) / ((1.0 + lambdas) * pi * wi.z * line.wo.z);
        const std::vector<double> further = orders->evaluate(wi, line.wo);
        for (std::size_t n = 1; n < further.size(); ++n) sum += further[n];
        f.back().push_back(sum);
      }
    }
    return f;
  };
  work.truth = solve({56, 48, 12});
  std::vector<Curve> curves(4);
  curves[0].title = "walk, one pair at a time, scalar double";
  for (const std::uint32_t n : {16u, 128u, 1024u, 8192u}) {
    curves[0].points.push_back(plain_monte_carlo(work, n, 1, n < 128 ? 3 : n < 1024 ? 17 : n < 8192 ? 61 : 89));
  }
  curves[1].title = "walk, shared paths, Philox, float";
  curves[2].title = "walk, shared paths, Sobol, float";
  for (std::uint32_t n = 64; n <= (1u << 18); n *= 8) {
    curves[1].points.push_back(shared_rows(work, Sampler::philox, n));
    curves[2].points.push_back(shared_rows(work, Sampler::sobol, n));
  }
  for (const SmithOrders::Resolution& resolution :
       {SmithOrders::Resolution{8, 8, 4}, {12, 12, 4}, {16, 16, 5}, {24, 20, 6}, {32, 26, 7}, {40, 32, 8}}) {
    const double start = seconds();
    const auto f = solve(resolution);
    const double spent = seconds() - start;
    double squares = 0.0;
    for (std::size_t l = 0; l < f.size(); ++l) {
      for (std::size_t j = 0; j < f[l].size(); ++j)
        squares += (f[l][j] - work.truth[l][j]) * (f[l][j] - work.truth[l][j]);
    }
    curves[3].points.push_back({spent, pi * std::sqrt(squares / static_cast<double>(work.entries()))});
  }
  curves[3].title = "SmithOrders, 8 to 40 polar angles";
  for (const Curve& curve : curves) print(curve);
  summary += fmt::format("all bounces, 2,430 entries: SmithOrders at its default takes {:.3g} s for rms {:.2g}\n",
                         curves[3].points.back().seconds, curves[3].points.back().error);
  return curves;
}

bool draw(const std::string& path, const std::vector<Curve>& one, const std::vector<Curve>& all) {
  std::FILE* gnuplot = popen("gnuplot", "w");
  if (!gnuplot) return false;
  std::string script = fmt::format(
      "set terminal pngcairo size 1500,680 font 'DejaVu Sans,12'\nset output '{}'\nset multiplot layout 1,2\n"
      "set logscale xy\nset format x '10^{{%L}}'\nset format y '10^{{%L}}'\nset grid lc rgb '#dddddd'\n"
      ""
      "set xlabel 'CPU time of the table on one core (s)'\nset ylabel 'rms of π (f − truth)'\n",
      path);
  const auto panel = [&](const std::string& title, const std::vector<Curve>& curves) {
    script += fmt::format("set title '{}'\n", title);
    for (std::size_t k = 0; k < curves.size(); ++k) {
      script += fmt::format("$c{} << EOD\n", k);
      for (const Point& p : curves[k].points) script += fmt::format("{} {}\n", p.seconds, p.error);
      script += "EOD\n";
    }
    script += "plot ";
    constexpr const char* colours[] = {"#888888", "#d95f02", "#1b6ca8", "#2e8b57"};
    for (std::size_t k = 0; k < curves.size(); ++k) {
      script += fmt::format("{}$c{} with linespoints lw 2 pt {} ps 1.3 lc rgb '{}' title '{}'", k ? ", " : "", k,
                            std::array{7, 5, 9, 13}[k], colours[k], curves[k].title);
    }
    script += "\n";
  };
  script +=
      "set yrange [1e-12:1]\nset xrange [1e-3:1e3]\nset key at graph 0.98, graph 0.45 right box lc rgb '#cccccc'\n";
  panel("One bounce: 123,120 entries, α .05 … 1", one);
  script += "set xrange [1e-4:1e2]\nset key at graph 0.745, graph 0.15 right box lc rgb '#cccccc'\n";
  panel("All bounces, ρ = 1: 2,430 entries, α .25, .5, 1", all);
  script += "unset multiplot\n";
  std::fputs(script.c_str(), gnuplot);
  return pclose(gnuplot) == 0;
}

}  // namespace

}  // namespace lobefit

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: lobefit_convergence FILE.png\n", stderr);
    return 2;
  }
  std::string summary;
  const auto one = lobefit::one_bounce(summary);
  const auto all = lobefit::all_bounces(summary);
  fmt::print("{}", summary);
  return lobefit::draw(argv[1], one, all) ? 0 : 1;
}
