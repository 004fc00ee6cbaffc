#include "report/metrics_report.h"

#include <algorithm>
#include <memory>

#include "report/sphere.h"

namespace lobefit {

namespace {

/// Up to `most` rows, the first and the last among them.
std::vector<std::size_t> spread_rows(std::size_t rows, std::size_t most) {
  std::vector<std::size_t> result;
  const std::size_t count = std::min(rows, most);
  for (std::size_t k = 0; k < count; ++k) result.push_back(count == 1 ? 0 : k * (rows - 1) / (count - 1));
  return result;
}

void add_spheres(const BrdfPair& pair, const ReportOptions& options, MetricsReport& report) {
  const Table& table = *pair.table;
  if (!pair.truth || !pair.other) {
    report.not_formed.push_back({"sphere", "one of the two has no values between its entries"});
    return;
  }
  if (const std::optional<std::string> reason = no_hemisphere(table)) {
    report.not_formed.push_back({"sphere", *reason});
    return;
  }
  const double pixels = static_cast<double>(pixels_of_sphere(options.sphere_size));
  constexpr double least_cover = 0.5;
  for (const std::size_t row : spread_rows(table.parameter_rows(), options.most_sphere_rows)) {
    // What a table of one channel is held against is its first, as in TableModel::render().
    const auto at_row = [row, one_channel = table.channels == 1](const RowBrdf& brdf) -> SphereBrdf {
      return [&brdf, row, one_channel](const Direction& wi, const Direction& wo) {
        const std::optional<Rgb> value = brdf(row, wi, wo);
        return value && one_channel ? grey(value->x) : value;
      };
    };
    const std::array<SphereBrdf, 2> brdfs{at_row(pair.truth), at_row(pair.other)};
    for (const std::string_view name : lighting_names) {
      const std::vector<SphereImage> images =
          render_spheres(brdfs, find_lighting(name), {.size = options.sphere_size, .isotropic = pair.isotropic});
      const auto covered = std::count(images[0].cover.begin(), images[0].cover.end(), 1.0f);
      const double cover = static_cast<double>(covered) / pixels;
      const std::optional<ImageDifference> difference =
          cover >= least_cover ? image_difference(images[0], images[1]) : std::nullopt;
      if (!difference) {
        report.not_formed.push_back({"sphere", "the two have values in common on too little of it, lighting " +
                                                   std::string(name) + ", row " + std::to_string(row)});
        continue;
      }
      report.spheres.push_back({row, std::string(name), *difference, cover});
    }
  }
}

Json or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

}  // namespace

std::optional<double> MetricsReport::mean(std::string_view lighting, double ImageDifference::*member) const {
  double sum = 0.0;
  int count = 0;
  for (const SphereDifference& sphere : spheres) {
    if (sphere.lighting != lighting) continue;
    sum += sphere.image.*member;
    ++count;
  }
  if (count == 0) return std::nullopt;
  return sum / count;
}

MetricsReport metrics_report(const BrdfPair& pair, const ReportOptions& options) {
  MetricsReport report{.brdf = brdf_difference(pair), .sphere_size = options.sphere_size};
  if (options.sphere_size > 0) add_spheres(pair, options, report);
  return report;
}

BrdfPair model_pair(const BrdfFile& file, const TableModel& model, std::span<const float> values) {
  BrdfPair pair{.table = &file.table,
                .values = values,
                .truth = row_brdf(file),
                .other = row_brdf(model),
                .isotropic = is_isotropic(file.table) && model.model().info->isotropic};
  if (file.table.coordinates == Coordinates::list || file.rgl) return pair;
  const auto laid = std::make_shared<const BrdfFile>(
      BrdfFile{.format = FileFormat::exr,
               .table = file.table.with_values(std::string(model.model().info->name), {values.begin(), values.end()})});
  pair.other = [laid, brdf = row_brdf(*laid)](std::size_t row, const Direction& wi, const Direction& wo) {
    return brdf(row, wi, wo);
  };
  // Angles are all that a grid tells.
  pair.isotropic = true;
  return pair;
}

Json MetricsReport::json(const Table& table) const {
  Json document = brdf.json(table);
  for (const NotFormed& missing : not_formed) {
    document["not_formed"].push_back({{"metric", missing.metric}, {"reason", missing.reason}});
  }
  document["sphere"] = nullptr;
  if (spheres.empty()) return document;
  Json& sphere = document["sphere"] = {
      {"size", sphere_size}, {"white_luminance", white_luminance}, {"pixels_per_degree", pixels_per_degree}};
  for (const std::string_view lighting : lighting_names) {
    sphere[std::string(lighting)] = {{"delta_e_itp_mean", or_null(mean(lighting, &ImageDifference::delta_e_itp_mean))},
                                     {"delta_e_itp_p95", or_null(mean(lighting, &ImageDifference::delta_e_itp_p95))},
                                     {"flip_mean", or_null(mean(lighting, &ImageDifference::flip_mean))}};
  }
  sphere["rows"] = Json::array();
  for (const SphereDifference& one : spheres) {
    Json line = row_json(table, one.row);
    line.update({{"lighting", one.lighting},
                 {"delta_e_itp_mean", one.image.delta_e_itp_mean},
                 {"delta_e_itp_p95", one.image.delta_e_itp_p95},
                 {"flip_mean", one.image.flip_mean},
                 {"cover", one.cover}});
    sphere["rows"].push_back(std::move(line));
  }
  return document;
}

}  // namespace lobefit
