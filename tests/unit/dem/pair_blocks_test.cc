// Blocks of listed pairs against loops over single contacts, and the bookkeeping of lanes against a
// brute-force search while grains come, go and move.
#include "dem/dynamics/pair_blocks.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <random>
#include <set>

#include "dem/dynamics/assembly.h"
#include "dem/dynamics/chunks.h"
#include "dem/registry/registry.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double In(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  int Below(int n) { return std::uniform_int_distribution<int>(0, n - 1)(engine_); }

 private:
  std::mt19937 engine_;
};

ParticleArrays Cloud(int n, Random& random) {
  ParticleArrays p;
  for (auto* a : {&p.x, &p.y, &p.z, &p.vx, &p.vy, &p.vz, &p.wx, &p.wy, &p.wz}) {
    for (int g = 0; g < n; ++g) a->push_back(random.In(-1, 1));
  }
  for (int g = 0; g < n; ++g) p.radius.push_back(random.In(0.1, 0.3));
  for (auto* a : {&p.fx, &p.fy, &p.fz, &p.tx, &p.ty, &p.tz}) {
    a->assign(static_cast<std::size_t>(n), std::nan(""));
  }
  return p;
}

/// Random pairs of n grains in lanes of whole blocks.
PairLanes RandomLanes(int n, int blocks, Random& random) {
  PairLanes lanes;
  for (int k = 0; k < blocks * kBlock; ++k) {
    const int i = random.Below(n - 1);
    lanes.first.push_back(i);
    lanes.second.push_back(i + 1 + random.Below(n - 1 - i));
    lanes.image.push_back(static_cast<std::uint8_t>(random.Below(kImages)));
  }
  return lanes;
}

TEST(PairBlocks, LanesAreLoadedAsSinglePairsWouldBe) {
  Random random(1);
  const int n = 37;  // no multiple of a vector's width
  const ParticleArrays p = Cloud(n, random);
  std::vector<GrainRecord> records(static_cast<std::size_t>(n));
  PackGrains(p, 0, 5, records.data());
  PackGrains(p, 5, n, records.data());
  ImageShift shift[kImages] = {};
  for (auto& translation : shift) {
    for (int a = 0; a < 3; ++a) translation[a] = random.In(-0.5, 0.5);
  }
  const PairLanes lanes = RandomLanes(n, 20, random);
  int blocks_apart = 0;
  for (int b = 0; b < lanes.blocks(); ++b) {
    ContactBlock block;
    const bool any = LoadBranches(lanes, b, records.data(), shift, block);
    LoadGrains(lanes, b, records.data(), block);
    bool overlap = false;
    for (int k = 0; k < kBlock; ++k) {
      const auto lane = static_cast<std::size_t>(b * kBlock + k);
      const auto i = static_cast<std::size_t>(lanes.first[lane]);
      const auto j = static_cast<std::size_t>(lanes.second[lane]);
      const double* const s = shift[lanes.image[lane]];
      EXPECT_EQ(block.dx[k], p.x[j] + s[0] - p.x[i]);
      EXPECT_EQ(block.dy[k], p.y[j] + s[1] - p.y[i]);
      EXPECT_EQ(block.dz[k], p.z[j] + s[2] - p.z[i]);
      EXPECT_EQ(block.vx[k], p.vx[j] - p.vx[i]);
      EXPECT_EQ(block.vz[k], p.vz[j] - p.vz[i]);
      EXPECT_EQ(block.wiy[k], p.wy[i]);
      EXPECT_EQ(block.wjz[k], p.wz[j]);
      EXPECT_EQ(block.radius_i[k], p.radius[i]);
      EXPECT_EQ(block.radius_j[k], p.radius[j]);
      overlap =
          overlap || std::hypot(block.dx[k], block.dy[k], block.dz[k]) < p.radius[i] + p.radius[j];
    }
    EXPECT_EQ(any, overlap);
    blocks_apart += any ? 0 : 1;
  }
  EXPECT_LT(blocks_apart, lanes.blocks());
}

TEST(PairBlocks, ABlockOfDistantGrainsIsApart) {
  PairLanes lanes;
  std::vector<GrainRecord> records = {{{0, 0, 0, 1}, {}, {0, 0, 0, 1}},
                                      {{2.001, 0, 0, 1}, {}, {0, 0, 0, 1}}};
  const ImageShift shift[kImages] = {};
  lanes.first.assign(kBlock, 0);
  lanes.second.assign(kBlock, 1);
  lanes.image.assign(kBlock, kHomeImage);
  ContactBlock block;
  EXPECT_FALSE(LoadBranches(lanes, 0, records.data(), shift, block));
  records[1].at[0] = 1.999;
  EXPECT_TRUE(LoadBranches(lanes, 0, records.data(), shift, block));
}

TEST(PairBlocks, OnlyLanesThatOverlapOrAreHeldAct) {
  Random random(2);
  constexpr int kWidth = 3;
  constexpr double kReach = 0.2;
  for (int round = 0; round < 200; ++round) {
    ContactBlock block;
    std::array<std::uint8_t, kBlock> touching{};
    std::array<std::uint8_t, kBlock> expected{};
    const int count = round == 0 ? kBlock : 1 + random.Below(kBlock);
    int overlaps = 0;
    for (int k = 0; k < kBlock; ++k) {
      // Round 0: all act, where nothing may be cleared.
      block.overlap[k] = round == 0 ? 0.1 : random.In(-0.4, 0.4);
      block.holds[k] = random.Below(2);
      touching[static_cast<std::size_t>(k)] = static_cast<std::uint8_t>(random.Below(2));
      for (auto* lane :
           {&block.force_x, &block.force_y, &block.force_z, &block.torque_ix, &block.torque_iy,
            &block.torque_iz, &block.torque_jx, &block.torque_jy, &block.torque_jz}) {
        (*lane)[k] = 1 + k;
      }
      for (int c = 0; c <= kWidth; ++c) block.own_history[c][k] = 10.0 * c + k + 1;
      const bool over = block.overlap[k] > 0;
      const bool held = touching[static_cast<std::size_t>(k)] != 0 && block.holds[k] > 0 &&
                        block.overlap[k] > -kReach;
      expected[static_cast<std::size_t>(k)] = k < count && (over || held) ? 1 : 0;
      overlaps += k < count && over ? 1 : 0;
    }
    EXPECT_EQ(CloseBlock(count, kReach, kWidth, block, touching.data()), overlaps);
    EXPECT_EQ(touching, expected);
    for (int k = 0; k < kBlock; ++k) {
      const double keep = expected[static_cast<std::size_t>(k)];
      EXPECT_EQ(block.force_y[k], keep * (1 + k));
      EXPECT_EQ(block.torque_ix[k], keep * (1 + k));
      EXPECT_EQ(block.torque_jz[k], keep * (1 + k));
      for (int c = 0; c < kWidth; ++c) {
        EXPECT_EQ(block.own_history[c][k], keep * (10.0 * c + k + 1));
      }
      EXPECT_EQ(block.own_history[kWidth][k], 10.0 * kWidth + k + 1);  // somebody else's
    }
  }
}

TEST(PairBlocks, LoadsAreSummedChunkByChunkInTheOrderOfLanes) {
  Random random(3);
  const int n = 43;
  const int blocks = 21;  // the last of three chunks is not whole
  constexpr int kBlocks = kPairChunk / kBlock;
  PairLanes lanes = RandomLanes(n - 1, blocks, random);  // nothing meets the last grain
  LoadPlaces places;
  places.Assign(n, lanes);
  using Six = std::array<double, 6>;
  std::vector<Six> expected(n, Six{});
  LaneSums sums;
  double stress[4] = {0, 0, 0, 0};
  for (const bool again : {false, true}) {  // what was left before is forgotten
    expected.assign(n, Six{});
    for (int chunk = 0; chunk * kBlocks < blocks; ++chunk) {
      GrainLoad* const loads = places.Clear(chunk);
      std::vector<Six> of_chunk(n, Six{});
      for (int b = chunk * kBlocks; b < std::min((chunk + 1) * kBlocks, blocks); ++b) {
        ContactBlock block;
        for (auto* lane : {&block.force_x, &block.force_y, &block.force_z, &block.torque_ix,
                           &block.torque_iy, &block.torque_iz, &block.torque_jx, &block.torque_jy,
                           &block.torque_jz, &block.dx, &block.dy, &block.dz}) {
          for (double& value : *lane) value = random.In(-1, 1);
        }
        BlockForces forces;
        AddLoads(lanes, b, block, loads, forces, sums);
        for (int k = 0; k < kBlock; ++k) {
          const auto lane = static_cast<std::size_t>(b * kBlock + k);
          const double f[3] = {block.force_x[k], block.force_y[k], block.force_z[k]};
          const Six on_i = {
              -f[0], -f[1], -f[2], block.torque_ix[k], block.torque_iy[k], block.torque_iz[k]};
          const Six on_j = {
              f[0], f[1], f[2], block.torque_jx[k], block.torque_jy[k], block.torque_jz[k]};
          for (std::size_t c = 0; c < 6; ++c) {
            of_chunk[static_cast<std::size_t>(lanes.first[lane])][c] += on_i[c];
            of_chunk[static_cast<std::size_t>(lanes.second[lane])][c] += on_j[c];
          }
          EXPECT_EQ((std::array{forces.x[k], forces.y[k], forces.z[k]}),
                    (std::array{f[0], f[1], f[2]}));
          stress[0] += f[0] * block.dx[k];
          stress[1] += f[1] * block.dy[k];
          stress[2] += f[2] * block.dz[k];
          stress[3] += f[0] * block.dz[k] + f[2] * block.dx[k];
        }
      }
      for (std::size_t g = 0; g < expected.size(); ++g) {
        for (std::size_t c = 0; c < 6; ++c) expected[g][c] += of_chunk[g][c];
      }
    }
    ParticleArrays p = Cloud(n, random);
    places.Gather(0, 8, p);
    places.Gather(8, n, p);
    for (std::size_t g = 0; g < expected.size(); ++g) {
      EXPECT_EQ(expected[g], (Six{p.fx[g], p.fy[g], p.fz[g], p.tx[g], p.ty[g], p.tz[g]}))
          << g << (again ? " again" : "");
      const Vec3 force = places.ForceOn(static_cast<int>(g));
      EXPECT_EQ((std::array{force.x, force.y, force.z}), (std::array{p.fx[g], p.fy[g], p.fz[g]}));
    }
  }
  for (int a = 0; a < 4; ++a) {
    EXPECT_NEAR(sums.at[a][0] + sums.at[a][1] + sums.at[a][2] + sums.at[a][3], stress[a], 1e-11);
  }
}

TEST(PairBlocks, ChangesByHandBetweenMotionAndForcesCount) {
  Packing two;
  two.x = {4e-3, 6.1e-3};
  two.y = two.z = {5e-3, 5e-3};
  two.radius = {1e-3, 1e-3};
  two.clump = {-1, -1};
  two.length[0] = two.length[1] = two.length[2] = 1e-2;
  Assembly assembly(two, 2650, ContactModelOf(test::LinearModel()), Surroundings{}, 1);
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  EXPECT_EQ(assembly.contacts(), 0);
  assembly.Move({.dt = 1e-9});
  for (double& x : assembly.mutable_particles().x) x *= 0.95;
  ASSERT_TRUE(assembly.EvaluateForces().ok());
  EXPECT_EQ(assembly.contacts(), 1);
}

/// Finds what contacts remember among the members that an assembly shows to archives.
struct MemoryFinder {
  LaneMemory* memory = nullptr;

  template <class... T>
  void operator()(T&... members) {
    (Look(members), ...);
  }
  void Look(LaneMemory& found) { memory = &found; }
  template <class T>
  void Look(T& /*other*/) {}
};

using Pair = std::pair<int, int>;  // of ids, the smaller first

/// A loose box of grains that are pushed about, taken out and put in.
class Crowd {
 public:
  explicit Crowd(unsigned seed) : random_(seed), assembly_(Make(random_)) {
    EXPECT_TRUE(assembly_.EvaluateForces().ok());
  }

  Assembly& assembly() { return assembly_; }
  Random& random() { return random_; }

  /// Some steps with fresh velocities, so that contacts form, shear and open.
  void Stir() {
    ParticleArrays& p = assembly_.mutable_particles();
    for (auto* v : {&p.vx, &p.vy, &p.vz}) {
      for (double& value : *v) value = random_.In(-0.02, 0.02);
    }
    const double dt = 0.1 * assembly_.NominalCriticalStep();
    for (int step = 0; step < 40; ++step) {
      assembly_.Move({.dt = dt});
      ASSERT_TRUE(assembly_.EvaluateForces().ok());
    }
  }

  /// All grains at rest: evaluations then move no memory on.
  void Stop() {
    ParticleArrays& p = assembly_.mutable_particles();
    for (auto* v : {&p.vx, &p.vy, &p.vz, &p.wx, &p.wy, &p.wz}) std::fill(v->begin(), v->end(), 0.0);
    ASSERT_TRUE(assembly_.EvaluateForces().ok());
  }

  Pair IdsOf(int slot) const {
    const auto s = static_cast<std::size_t>(slot);
    const std::vector<int>& id = assembly_.particles().id;
    const NeighborList& list = assembly_.neighbors();
    return std::minmax(id[static_cast<std::size_t>(list.first[s])],
                       id[static_cast<std::size_t>(list.second[s])]);
  }

  /// What the pairs that touch remember, with the sign of the smaller id first.
  std::map<Pair, std::vector<double>> Memory() {
    MemoryFinder finder;
    assembly_.Visit(finder);
    const auto width = static_cast<std::size_t>(assembly_.model().history_size());
    std::map<Pair, std::vector<double>> memory;
    for (int slot = 0; slot < assembly_.neighbors().size(); ++slot) {
      if (!assembly_.touching(slot)) continue;
      const auto s = static_cast<std::size_t>(slot);
      std::vector<double> columns;
      for (std::size_t c = 0; c < width; ++c) {
        columns.push_back((*finder.memory)[s / kBlock * width + c].lane[s % kBlock]);
      }
      EXPECT_TRUE(memory.emplace(IdsOf(slot), columns).second) << "a pair is listed twice";
    }
    return memory;
  }

  /// Pairs that touch, by looking at all of them.
  std::set<Pair> Touching() const {
    const ParticleArrays& p = assembly_.particles();
    std::set<Pair> pairs;
    for (std::size_t i = 0; i < p.x.size(); ++i) {
      for (std::size_t j = i + 1; j < p.x.size(); ++j) {
        const double d = std::hypot(p.x[j] - p.x[i], p.y[j] - p.y[i], p.z[j] - p.z[i]);
        if (d < p.radius[i] + p.radius[j]) pairs.insert(std::minmax(p.id[i], p.id[j]));
      }
    }
    return pairs;
  }

  void TakeOutSome() {
    std::vector<int> out;
    for (int g = 0; g < assembly_.particles().size(); ++g) {
      if (random_.Below(12) == 0) out.push_back(g);
    }
    assembly_.Remove(out);
  }

  void PutInSome() {
    std::vector<NewGrain> grains;
    for (int k = random_.Below(8); k >= 0; --k) {
      grains.push_back({.centre = RandomPlace(random_), .velocity = {}, .radius = kSmallest});
    }
    assembly_.Insert(grains);
  }

 private:
  static constexpr double kSize = 0.02;
  static constexpr double kSmallest = 0.9e-3;

  static Vec3 RandomPlace(Random& random) {
    return {random.In(0, kSize), random.In(0, kSize), random.In(0, kSize)};
  }

  /// On a lattice a little closer than the largest diameter: some neighbours touch.
  static Assembly Make(Random& random) {
    Packing grains;
    constexpr int kSide = 9;
    for (int k = 0; k < kSide * kSide * kSide; ++k) {
      const double step = kSize / kSide;
      grains.x.push_back((k % kSide + 0.5) * step + random.In(-1e-4, 1e-4));
      grains.y.push_back((k / kSide % kSide + 0.5) * step + random.In(-1e-4, 1e-4));
      grains.z.push_back((k / kSide / kSide + 0.5) * step + random.In(-1e-4, 1e-4));
      grains.radius.push_back(random.In(kSmallest, 1.2e-3));
      grains.clump.push_back(-1);
    }
    for (double& length : grains.length) length = kSize;
    return {grains, 2650e3, ContactModelOf(test::LinearModel()), Surroundings{}, 1};
  }

  Random random_;
  Assembly assembly_;
};

TEST(PairBlocks, MemoryFollowsPairsThroughComingAndGoing) {
  Crowd crowd(4);
  std::size_t followed = 0;
  for (int round = 0; round < 25; ++round) {
    crowd.Stir();
    crowd.Stop();
    const auto before = crowd.Memory();
    const int act = crowd.random().Below(4);
    if (act != 1) crowd.TakeOutSome();
    if (act != 2) crowd.PutInSome();
    crowd.assembly().SearchAgain();
    ASSERT_TRUE(crowd.assembly().EvaluateForces().ok());
    const auto after = crowd.Memory();
    std::set<Pair> touching;
    for (const auto& [pair, columns] : after) {
      touching.insert(pair);
      const auto old = before.find(pair);
      for (std::size_t c = 0; c < columns.size(); ++c) {
        const double expected = old != before.end() ? std::abs(old->second[c]) : 0.0;
        EXPECT_NEAR(std::abs(columns[c]), expected, 1e-9 * expected) << "column " << c;
        followed += expected > 0 ? 1 : 0;
      }
    }
    EXPECT_EQ(touching, crowd.Touching());
  }
  EXPECT_GT(followed, 1000U);
}

TEST(PairBlocks, PairsKeepTheirLanesWhileTheListHolds) {
  Crowd crowd(5);
  crowd.Stir();
  crowd.Stop();
  Assembly& assembly = crowd.assembly();
  const std::vector<int> first = assembly.neighbors().first;
  const std::vector<int> second = assembly.neighbors().second;
  ParticleArrays& p = assembly.mutable_particles();
  const std::vector<double> x = p.x;
  std::set<std::set<Pair>> seen;
  for (int round = 0; round < 20; ++round) {
    for (std::size_t g = 0; g < x.size(); ++g) p.x[g] = x[g] + crowd.random().In(-2e-6, 2e-6);
    ASSERT_TRUE(assembly.EvaluateForces().ok());
    EXPECT_EQ(assembly.neighbors().first, first);
    EXPECT_EQ(assembly.neighbors().second, second);
    std::set<Pair> touching;
    for (const auto& [pair, columns] : crowd.Memory()) touching.insert(pair);
    EXPECT_EQ(touching, crowd.Touching());
    seen.insert(touching);
  }
  EXPECT_GT(seen.size(), 10U);  // contacts do open and close
}

}  // namespace
}  // namespace calib::dem
