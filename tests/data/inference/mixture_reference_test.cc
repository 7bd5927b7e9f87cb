// The variational mixture against scikit-learn 1.2.1, state by state.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "inference/mixture/dirichlet_mixture.h"
#include "tests/data/inference/reference_files.h"

namespace calib::inference {
namespace {

struct Case {
  nlohmann::json reference;
  WeightedPoints data;
};

Case ReadCase(const std::string& name) {
  Case result{.reference = ReadReference(name + ".json"), .data = {}};
  if (result.reference.at("data").is_string()) {
    result.data.points =
        ReadTable(result.reference.at("data").get<std::string>(), true).values.transpose();
  } else {
    // The expanded glass-bead ensemble: rows repeated `copies` times in sample order, scaled to [0,
    // 1].
    const Table table = ReadTable("glass_beads_oedometric/ensemble_iter0_parameters.csv");
    const auto copies = result.reference.at("copies").get<std::vector<int>>();
    const Eigen::VectorXd low = ToVector(result.reference.at("min"));
    const Eigen::VectorXd high = ToVector(result.reference.at("max"));
    std::vector<Eigen::VectorXd> rows;
    for (std::size_t i = 0; i < copies.size(); ++i) {
      const Eigen::VectorXd row = table.values.row(static_cast<Eigen::Index>(i)).segment(1, 4);
      for (int k = 0; k < copies[i]; ++k)
        rows.emplace_back((row - low).array() / (high - low).array());
    }
    result.data.points.resize(4, static_cast<Eigen::Index>(rows.size()));
    for (std::size_t i = 0; i < rows.size(); ++i)
      result.data.points.col(static_cast<Eigen::Index>(i)) = rows[i];
  }
  result.data.counts = Eigen::VectorXd::Ones(result.data.points.cols());
  return result;
}

Eigen::MatrixXd FromLabels(const nlohmann::json& labels) {
  Eigen::MatrixXd responsibilities = Eigen::MatrixXd::Zero(labels.size(), 10);
  for (std::size_t i = 0; i < labels.size(); ++i) {
    responsibilities(static_cast<Eigen::Index>(i), labels[i].get<Eigen::Index>()) = 1;
  }
  return responsibilities;
}

double Relative(const Eigen::MatrixXd& found, const Eigen::MatrixXd& expected) {
  return (found - expected).cwiseAbs().maxCoeff() / expected.cwiseAbs().maxCoeff();
}

struct Tolerances {
  double weights, shape, bound;
};

void ExpectState(const DirichletMixture& fit, const nlohmann::json& expected,
                 const Tolerances& tolerance) {
  EXPECT_LE((fit.state.Weights() - ToVector(expected.at("weights"))).cwiseAbs().maxCoeff(),
            tolerance.weights);
  EXPECT_LE(Relative(fit.state.means.transpose(), ToMatrix(expected.at("means"))), tolerance.shape);
  EXPECT_LE(Relative(fit.state.degrees_of_freedom, ToVector(expected.at("degrees_of_freedom"))),
            tolerance.shape);
  EXPECT_LE(Relative(fit.state.mean_precision, ToVector(expected.at("mean_precision"))),
            tolerance.shape);
  EXPECT_LE(Relative(fit.state.a, ToVector(expected.at("weight_concentration_a"))),
            tolerance.shape);
  EXPECT_LE(Relative(fit.state.b, ToVector(expected.at("weight_concentration_b"))),
            tolerance.shape);
  for (Eigen::Index k = 0; k < fit.state.size(); ++k) {
    EXPECT_LE(Relative(fit.state.covariances[k], ToMatrix(expected.at("covariances").at(k))),
              tolerance.shape);
  }
  EXPECT_NEAR(fit.lower_bound, expected.at("lower_bound_sklearn").get<double>(), tolerance.bound);
}

class MixtureReference : public testing::TestWithParam<const char*> {
 protected:
  const Case case_ = ReadCase(GetParam());
};
INSTANTIATE_TEST_SUITE_P(Cases, MixtureReference,
                         testing::Values("dpgmm_iter0_ensemble", "dpgmm_synthetic_2d3",
                                         "dpgmm_synthetic_4d1"));

TEST_P(MixtureReference, FirstIterationsFromGivenLabels) {
  const auto& states = case_.reference.at("from_init_labels");
  const Eigen::MatrixXd start = FromLabels(case_.reference.at("init_labels"));
  for (const int iterations : {1, 5}) {
    const DirichletMixture fit =
        FitFrom(case_.data, {.tolerance = 1e-300, .max_iterations = iterations}, start);
    const auto& expected = states.at("after_" + std::to_string(iterations) + "_iterations");
    ExpectState(fit, expected,
                {.weights = 1e-9, .shape = 1e-9, .bound = 1e-9 * std::abs(fit.lower_bound)});
  }
}

TEST_P(MixtureReference, ConvergedStateBoundsAndDensities) {
  const Eigen::MatrixXd start = FromLabels(case_.reference.at("init_labels"));
  const DirichletMixture fit =
      FitFrom(case_.data, {.tolerance = 1e-9, .max_iterations = 5000}, start);
  const auto& expected = case_.reference.at("from_init_labels").at("converged_tol_1e-9");
  EXPECT_TRUE(fit.converged);
  ExpectState(fit, expected, {.weights = 1e-5, .shape = 1e-4, .bound = 1e-5});
  EXPECT_NEAR(EvidenceLowerBound(case_.data, fit.prior, fit.state),
              expected.at("elbo_full").get<double>(), 1e-5);

  const Eigen::MatrixXd query = ToMatrix(case_.reference.at("query_points")).transpose();
  const Eigen::VectorXd variational = ToVector(expected.at("log_density_variational_at_query"));
  const Eigen::VectorXd plug_in = ToVector(expected.at("log_density_mixture_at_query"));
  EXPECT_LE((EStep(query, fit.state).log_density - variational).cwiseAbs().maxCoeff(), 1e-4);
  const GaussianMixture mixture(fit.PlugIn());
  for (Eigen::Index i = 0; i < query.cols(); ++i) {
    EXPECT_NEAR(mixture.LogDensity(query.col(i)), plug_in[i], 1e-4);
  }
}

TEST_P(MixtureReference, BestOfFiftyStarts) {
  const auto fit = FitDirichletMixture(case_.data, {.tolerance = 1e-5, .restarts = 50, .seed = 1});
  ASSERT_TRUE(fit.ok()) << fit.status();
  const double best =
      case_.reference.at("best_of_restarts").at("lower_bounds_sorted").at(0).get<double>();
  const bool ensemble = case_.reference.at("truth").is_null();
  EXPECT_GE(fit->lower_bound, best - (ensemble ? 50 : 1));
  if (ensemble) return;
  const Eigen::VectorXd weights = fit->state.Weights();
  EXPECT_EQ(std::count_if(weights.begin(), weights.end(), [](double w) { return w > 0.01; }),
            static_cast<long>(case_.reference.at("truth").at("weights").size()));
}

// A weight of three is three copies.
TEST_P(MixtureReference, CountsStandForCopies) {
  if (!case_.reference.contains("copies")) GTEST_SKIP() << "not an expanded ensemble";
  WeightedPoints merged;
  std::vector<Eigen::Index> first;
  for (Eigen::Index i = 0; i < case_.data.points.cols(); ++i) {
    if (i == 0 || case_.data.points.col(i) != case_.data.points.col(i - 1)) first.push_back(i);
  }
  const Eigen::MatrixXd start = FromLabels(case_.reference.at("init_labels"));
  Eigen::MatrixXd merged_start(first.size(), 10);
  merged.points.resize(4, first.size());
  merged.counts.resize(first.size());
  for (std::size_t k = 0; k < first.size(); ++k) {
    const auto column = static_cast<Eigen::Index>(k);
    const Eigen::Index end = k + 1 < first.size() ? first[k + 1] : case_.data.points.cols();
    merged.points.col(column) = case_.data.points.col(first[k]);
    merged.counts[column] = static_cast<double>(end - first[k]);
    merged_start.row(column) = start.middleRows(first[k], end - first[k]).colwise().mean();
  }
  const DirichletMixture fit =
      FitFrom(merged, {.tolerance = 1e-300, .max_iterations = 5}, merged_start);
  ExpectState(fit, case_.reference.at("from_init_labels").at("after_5_iterations"),
              {.weights = 1e-9, .shape = 1e-9, .bound = 1e-5});
}

}  // namespace
}  // namespace calib::inference
