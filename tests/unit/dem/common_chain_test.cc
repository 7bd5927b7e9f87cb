// The chains in one pass against the same chains kernel by kernel: every bit.
#include "dem/dynamics/common_chain.h"

#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "dem/dynamics/contact_model.h"
#include "dem/dynamics/pair_blocks.h"
#include "dem/geometry/vector3.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

/// A block and what its contacts remember, some lanes apart.
struct Case {
  ContactBlock block;
  std::uint8_t touching[kBlock] = {};

  Case(unsigned seed, int count, int columns) {
    std::mt19937 engine(seed);
    const auto in = [&engine](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(engine);
    };
    ContactBlock& b = block;
    b.count = count;
    b.dt = 1e-5;
    b.sliding_friction = 0.4;
    b.stretch[0] = 0.05;
    b.stretch[2] = -0.1;
    b.shear = 0.3;
    for (int k = 0; k < kBlock; ++k) {
      b.radius_i[k] = in(0.8e-3, 1.2e-3);
      b.radius_j[k] = in(0.8e-3, 1.2e-3);
      const Vec3 d{in(-1, 1), in(-1, 1), in(0.1, 1)};
      const double distance = (b.radius_i[k] + b.radius_j[k]) * in(0.998, 1.001) / Length(d);
      b.dx[k] = distance * d.x;
      b.dy[k] = distance * d.y;
      b.dz[k] = distance * d.z;
      for (auto* lane : {&b.vx, &b.vy, &b.vz}) (*lane)[k] = in(-0.1, 0.1);
      for (auto* lane : {&b.wix, &b.wiy, &b.wiz, &b.wjx, &b.wjy, &b.wjz}) {
        (*lane)[k] = in(-100, 100);
      }
      touching[k] = 1;
      for (int c = 0; c < columns; ++c) b.history[c][k] = c < 3 ? in(-2, 2) : in(-1e-3, 1e-3);
    }
    PadLanes(columns, b);
  }
};

Model With(const Model& base, const std::vector<std::string>& effects, bool ratio) {
  Model model = base;
  for (const std::string& effect : effects) {
    model.effects.push_back(effect);
    model.parameters[effect + (ratio ? ".stiffness_ratio" : ".stiffness")] = 0.4;
    model.parameters[effect + ".friction"] = 0.1;
  }
  return model;
}

Model Damped(Model model) {
  model.effects.emplace_back("viscous_damping");
  model.parameters["viscous_damping.ratio"] = 0.3;
  return model;
}

TEST(CommonChain, HasTheBitsOfItsKernels) {
  const std::vector<std::vector<std::string>> effects = {
      {}, {"rolling_resistance"}, {"rolling_resistance", "twisting_resistance"}};
  for (const Model& law : {test::HertzModel(), test::LinearModel(), Damped(test::HertzModel()),
                           Damped(test::LinearModel())}) {
    for (const auto& names : effects) {
      for (const bool ratio : {false, true}) {
        for (unsigned seed = 1; seed <= 30; ++seed) {
          SCOPED_TRACE(law.contact + " " + std::to_string(names.size()));
          const ContactModel model = ContactModelOf(With(law, names, ratio));
          ASSERT_TRUE(model.common().has_value());
          const int count = seed % 3 == 0 ? 19 : kBlock;
          Case one(seed, count, model.history_size());
          Case other(seed, count, model.history_size());
          model.Evaluate(one.block);
          const int overlaps = CloseBlock(count, 0, model.history_size(), one.block, one.touching);
          EXPECT_EQ(EvaluateCommonChain(*model.common(), other.block, other.touching), overlaps);
          EXPECT_GT(overlaps, 0);
          EXPECT_LT(overlaps, count);
          EXPECT_EQ(std::memcmp(one.touching, other.touching, sizeof one.touching), 0);
          using Member = ContactBlock::Lane ContactBlock::*;
          for (const Member lane :
               {&ContactBlock::force_x, &ContactBlock::force_y, &ContactBlock::force_z,
                &ContactBlock::torque_ix, &ContactBlock::torque_iy, &ContactBlock::torque_iz,
                &ContactBlock::torque_jx, &ContactBlock::torque_jy, &ContactBlock::torque_jz}) {
            // NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): bits are what is compared
            EXPECT_EQ(std::memcmp(one.block.*lane, other.block.*lane, sizeof one.block.dx), 0);
          }
          EXPECT_EQ(
              std::memcmp(one.block.history, other.block.history,
                          static_cast<std::size_t>(model.history_size()) * sizeof one.block.dx),
              0);
        }
      }
    }
  }
}

TEST(CommonChain, StiffnessesHaveTheBitsOfItsKernels) {
  for (const Model& law : {test::HertzModel(), test::LinearModel(), Damped(test::HertzModel()),
                           Damped(test::LinearModel())}) {
    for (const std::vector<std::string>& names : {std::vector<std::string>{},
                                                  {"rolling_resistance"},
                                                  {"rolling_resistance", "twisting_resistance"}}) {
      for (unsigned seed = 1; seed <= 20; ++seed) {
        SCOPED_TRACE(law.contact + " " + std::to_string(names.size()));
        const ContactModel model = ContactModelOf(With(law, names, seed % 2 == 0));
        Case one(seed, kBlock, model.history_size());
        Case other(seed, kBlock, model.history_size());
        model.Evaluate(one.block);
        CommonChainStiffness(*model.common(), other.block);
        using Member = ContactBlock::Lane ContactBlock::*;
        for (const Member lane :
             {&ContactBlock::nx, &ContactBlock::ny, &ContactBlock::nz, &ContactBlock::overlap,
              &ContactBlock::normal_stiffness, &ContactBlock::tangential_stiffness,
              &ContactBlock::rolling_stiffness, &ContactBlock::twisting_stiffness,
              &ContactBlock::normal_damping, &ContactBlock::tangential_damping}) {
          for (int k = 0; k < kBlock; ++k) {
            if (other.block.overlap[k] > 0) {
              EXPECT_EQ((one.block.*lane)[k], (other.block.*lane)[k]);
            }
          }
        }
      }
    }
  }
}

TEST(CommonChain, OtherModelsHaveNone) {
  const Model twists = With(test::LinearModel(), {"twisting_resistance"}, false);
  EXPECT_FALSE(CommonChainOf(twists, EntriesOf(twists)));
  Model sticky = test::HertzModel();
  sticky.effects = {"linear_cohesion"};
  sticky.parameters["linear_cohesion.energy_density"] = 1e4;
  EXPECT_FALSE(CommonChainOf(sticky, EntriesOf(sticky)));
  Model tsuji = test::HertzModel();
  tsuji.contact = "tsuji";
  EXPECT_FALSE(CommonChainOf(tsuji, EntriesOf(tsuji)));
  Model rescaled = test::HertzModel();
  rescaled.shear_unloading = ShearUnloading::kRescaled;
  EXPECT_FALSE(CommonChainOf(rescaled, EntriesOf(rescaled)));
}

}  // namespace
}  // namespace calib::dem
