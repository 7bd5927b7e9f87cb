#include "dem/neighbor/neighbor_list.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <random>
#include <set>

namespace calib::dem {
namespace {

Packing RandomGrains(unsigned seed, int n, double height) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> u(0, 1);
  Packing p;
  p.length[0] = 0.9e-2;
  p.length[1] = 1.1e-2;
  p.length[2] = height;
  for (int i = 0; i < n; ++i) {
    p.x.push_back((3 * u(random) - 1) * p.length[0]);  // also outside the cell
    p.y.push_back(u(random) * p.length[1]);
    p.z.push_back(u(random) * p.length[2]);
    p.radius.push_back(0.5e-3 + 1e-3 * u(random));
    p.clump.push_back(-1);
  }
  return p;
}

TEST(NeighborList, FindsWhatBruteForceFindsInShearedCells) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Packing packing = RandomGrains(seed, 150, seed % 2 == 0 ? 0.8e-2 : 2.3e-2);
    ParticleArrays p = MakeParticles(packing, 2650);
    PeriodicCell cell{.length = {packing.length[0], packing.length[1], packing.length[2]}};
    cell.displacement = (0.17 * seed - 1.7) * cell.length[0];
    cell.Reduce();
    ASSERT_LE(std::abs(cell.Tilt()), 0.5 * cell.length[0] * (1 + 1e-12));
    const double skin = 0.3e-3;
    NeighborList list;
    ASSERT_TRUE(NeighborSearch().Build(cell, skin, p, list).ok());
    std::set<std::pair<int, int>> expected;
    for (int i = 0; i < p.size(); ++i) {
      for (int j = i + 1; j < p.size(); ++j) {
        for (int image = 0; image < 125; ++image) {  // by the full displacement, without reduction
          const int sz = image / 25 - 2;
          const double wraps = std::round(sz * cell.displacement / cell.length[0]);
          const double dx =
              p.x[j] - p.x[i] + (image % 5 - 2 - wraps) * cell.length[0] + sz * cell.displacement;
          const double dy = p.y[j] - p.y[i] + (image / 5 % 5 - 2) * cell.length[1];
          const double dz = p.z[j] - p.z[i] + sz * cell.length[2];
          if (std::hypot(dx, dy, dz) < p.radius[i] + p.radius[j] + skin) {
            expected.emplace(i, j);
          }
        }
      }
    }
    std::set<std::pair<int, int>> found;
    for (int s = 0; s < list.size(); ++s) {
      found.emplace(list.first[s], list.second[s]);
    }
    EXPECT_EQ(found.size(), static_cast<std::size_t>(list.size())) << "a pair is listed twice";
    EXPECT_EQ(found, expected) << "seed " << seed;
  }
}

TEST(NeighborList, FindsWhatBruteForceFinds) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Packing packing = RandomGrains(seed, 150, seed % 2 == 0 ? 0.8e-2 : 2.3e-2);
    ParticleArrays p = MakeParticles(packing, 2650);
    PeriodicCell cell{.length = {packing.length[0], packing.length[1], packing.length[2]}};
    const double skin = 0.3e-3;
    NeighborList list;
    ASSERT_TRUE(NeighborSearch().Build(cell, skin, p, list).ok());
    std::set<std::pair<int, int>> expected;
    for (int i = 0; i < p.size(); ++i) {
      for (int j = i + 1; j < p.size(); ++j) {
        double d2 = 0;
        const double d[3] = {p.x[j] - p.x[i], p.y[j] - p.y[i], p.z[j] - p.z[i]};
        for (int a = 0; a < 3; ++a) {
          const double nearest = d[a] - std::round(d[a] / cell.length[a]) * cell.length[a];
          d2 += nearest * nearest;
        }
        if (std::sqrt(d2) < p.radius[i] + p.radius[j] + skin) {
          expected.emplace(i, j);
        }
      }
    }
    std::set<std::pair<int, int>> found;
    for (int s = 0; s < list.size(); ++s) {
      found.emplace(list.first[s], list.second[s]);
    }
    EXPECT_EQ(found.size(), static_cast<std::size_t>(list.size())) << "a pair is listed twice";
    EXPECT_EQ(found, expected) << "seed " << seed;
  }
}

// A grid as fine as the grains would have a thousand million cells.
TEST(NeighborList, FewSmallGrainsInAWideCellTakeLittleMemory) {
  Packing packing;
  packing.length[0] = packing.length[1] = 1;
  packing.length[2] = 1e6;
  for (int i = 0; i < 20; ++i) {
    packing.x.push_back(0.5 + 1.5e-9 * i);
    packing.y.push_back(0.5);
    packing.z.push_back(3e4 * (i / 2));
    packing.radius.push_back(1e-9);
    packing.clump.push_back(-1);
  }
  ParticleArrays p = MakeParticles(packing, 2650);
  PeriodicCell cell{.length = {1, 1, 1e6}};
  rlimit limit{};
  ASSERT_EQ(getrlimit(RLIMIT_AS, &limit), 0);
  std::ifstream own("/proc/self/statm");
  rlim_t pages = 0;
  ASSERT_TRUE(own >> pages);
  rlimit little = limit;
  little.rlim_cur = pages * static_cast<rlim_t>(getpagesize()) + (rlim_t{256} << 20U);
  ASSERT_EQ(setrlimit(RLIMIT_AS, &little), 0);
  NeighborList list;
  const absl::Status status = NeighborSearch().Build(cell, 0, p, list);
  ASSERT_EQ(setrlimit(RLIMIT_AS, &limit), 0);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(list.size(), 10);
}

TEST(NeighborList, NamesTheGrainThatWasLost) {
  const Packing packing = RandomGrains(3, 50, 2e-2);
  ParticleArrays p = MakeParticles(packing, 2650);
  PeriodicCell cell{.length = {packing.length[0], packing.length[1], packing.length[2]}};
  p.y[7] = std::numeric_limits<double>::quiet_NaN();
  NeighborList list;
  const absl::Status status = NeighborSearch().Build(cell, 1e-4, p, list);
  EXPECT_EQ(status.code(), absl::StatusCode::kOutOfRange);
  EXPECT_NE(std::string(status.message()).find("grain " + std::to_string(p.id[7])),
            std::string::npos);
}

TEST(NeighborList, RefusesACellOfLessThanTwoRanges) {
  const Packing packing = RandomGrains(3, 50, 2e-2);
  ParticleArrays p = MakeParticles(packing, 2650);
  PeriodicCell cell{.length = {packing.length[0], packing.length[1], 4e-3}};
  NeighborList list;
  EXPECT_EQ(NeighborSearch().Build(cell, 1e-4, p, list).code(), absl::StatusCode::kOutOfRange);
}

}  // namespace
}  // namespace calib::dem
