// Errors of rough diffuse forms against figures that another program measured (formulas.md §3).
#include "fit/diffuse_errors.h"

#include <gtest/gtest.h>

#include <map>

#include "evaluate/callisto_cost.h"
#include "evaluate/float_model.h"

namespace lobefit {
namespace {

Monitor silent;

TEST(DiffuseErrors, AreThoseMeasuredElsewhere) {
  std::map<std::string, std::array<double, 2>> found;
  for (const DiffuseError& error : diffuse_errors({}, silent)) found[error.label] = error.rms;
  // Three digits are given; both programs integrate, so 5 %.
  const std::map<std::string, std::array<double, 2>> expected{{"Lambert", {0.212, 0.078}},
                                                              {"Burley", {0.237, 0.091}},
                                                              {"Hammon", {0.096, 0.083}},
                                                              {"Chan 2018", {0.164, 0.062}},
                                                              {"Chan 2024", {0.023, 0.031}},
                                                              {"EON, r = .4√α", {0.150, 0.024}},
                                                              {"Proxima, published", {0.125, 0.159}},
                                                              {"Proxima, refit", {0.110, 0.077}}};
  for (const auto& [label, rms] : expected) {
    ASSERT_TRUE(found.contains(label)) << label;
    for (const std::size_t which : {std::size_t{0}, std::size_t{1}}) {
      EXPECT_NEAR(found.at(label)[which], rms[which], 0.05 * rms[which])
          << label << " against " << diffuse_reference_names[which];
    }
  }
  EXPECT_NEAR(found.at("EON, r = .536α^.67")[1], 0.019, 0.05 * 0.019);
  // Its sigma is fitted here over [0, π/2] per alpha: never worse than what is given there.
  EXPECT_NEAR(found.at("Oren-Nayar")[0], 0.040, 0.05 * 0.040);
  EXPECT_LE(found.at("Oren-Nayar")[1], 0.052);
  // A refit is at least as close as what it starts from, and c1 on Lambert holds Lambert.
  for (const std::size_t which : {std::size_t{0}, std::size_t{1}}) {
    EXPECT_LE(found.at("Proxima, refit")[which], found.at("Proxima, published")[which]);
    EXPECT_LT(found.at("Callisto Full")[which], found.at("Lambert")[which]);
  }
}

TEST(CallistoCost, IsPartOfTheWholeModel) {
  const OperationCount part = callisto_diffuse_operations();
  const OperationCount whole = count_operations(find_float_model("callisto_lambert").trace());
  EXPECT_EQ(part.transcendental, 8);  // four pow
  EXPECT_LT(part.add_multiply, whole.add_multiply);
  EXPECT_LT(part.total(), whole.total());
  EXPECT_GT(part.total(), count_operations(find_float_model("lambert").trace()).total());
}

}  // namespace
}  // namespace lobefit
