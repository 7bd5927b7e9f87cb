// Series for ParaView, read back with an XML parser: the same grains and forces to the last bit.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <boost/property_tree/ptree.hpp>
#include <boost/property_tree/xml_parser.hpp>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "absl/strings/escaping.h"
#include "dem/simulate/packing_generator.h"
#include "dem/simulate/simulate.h"
#include "dem/simulate/vtk_series.h"
#include "tests/support/dem/scenarios.h"

namespace calib::dem {
namespace {

using boost::property_tree::ptree;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Vtk : public ::testing::Test {
 protected:
  Vtk()
      : folder_(std::filesystem::path(::testing::TempDir()) /
                ("calib_vtk_" +
                 std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()))) {
    std::filesystem::remove_all(folder_);
  }
  ~Vtk() override { std::filesystem::remove_all(folder_); }

  /// The document of a file, which has to be of a type.
  ptree Read(const std::string& name, const std::string& type) const {
    ptree file;
    read_xml((folder_ / name).string(), file);
    EXPECT_EQ(file.get<std::string>("VTKFile.<xmlattr>.type"), type);
    return file.get_child("VTKFile." + type);
  }

  /// Load steps and files of a collection; each of the files has to be there and well-formed.
  std::vector<std::pair<int, std::string>> Collection(const std::string& name) const {
    std::vector<std::pair<int, std::string>> entries;
    for (const auto& [tag, set] : Read(name, "Collection")) {
      if (tag != "DataSet") continue;
      entries.emplace_back(set.get<int>("<xmlattr>.timestep"),
                           set.get<std::string>("<xmlattr>.file"));
      const bool vtu = entries.back().second.ends_with(".vtu");
      Read(entries.back().second, vtu ? "UnstructuredGrid" : "PolyData");
    }
    return entries;
  }

  const std::filesystem::path folder_;
};

/// Values of the array of a name below a section.
template <class T>
std::vector<T> Values(const ptree& section, const std::string& name) {
  for (const ptree::value_type& item : section) {
    const ptree& array = item.second;
    if (item.first != "DataArray" || array.get<std::string>("<xmlattr>.Name") != name) continue;
    std::string bytes;
    EXPECT_TRUE(absl::Base64Unescape(array.data(), &bytes));
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data(), sizeof length);
    EXPECT_EQ(bytes.size(), sizeof length + length);
    const int components = array.get<int>("<xmlattr>.NumberOfComponents");
    EXPECT_EQ(length, array.get<std::size_t>("<xmlattr>.NumberOfTuples") *
                          static_cast<std::size_t>(components) * sizeof(T));
    std::vector<T> values(length / sizeof(T));
    std::memcpy(values.data(), bytes.data() + sizeof length, length);
    return values;
  }
  ADD_FAILURE() << "no array " << name;
  return {};
}

TEST_F(Vtk, GrainsComeBackBitForBitInTheOrderOfThePacking) {
  const Scenario scenario = test::SmallTriaxial(test::HertzModel());
  VtkSeries series(folder_.string());
  std::vector<Assembly> seen;
  const auto summary = SimulateGrains(scenario,
                                      [&](const State& state, const Assembly& assembly) {
                                        seen.push_back(assembly);
                                        return series.Add(assembly, state.load_step);
                                      },
                                      {});
  ASSERT_TRUE(summary.ok());
  EXPECT_THAT(Collection("grains.pvd"),
              ElementsAre(std::pair(0, "grains_0000.vtu"), std::pair(1, "grains_0001.vtu"),
                          std::pair(2, "grains_0002.vtu")));
  EXPECT_EQ(Collection("cell.pvd").size(), 3U);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "walls.pvd"));
  for (int step = 0; step < 3; ++step) {
    const ptree grid = Read("grains_000" + std::to_string(step) + ".vtu", "UnstructuredGrid");
    const ptree& piece = grid.get_child("Piece");
    const Assembly& assembly = seen[static_cast<std::size_t>(step)];
    const ParticleArrays& p = assembly.particles();
    EXPECT_EQ(piece.get<int>("<xmlattr>.NumberOfPoints"), p.size());
    EXPECT_EQ(piece.get<int>("<xmlattr>.NumberOfCells"), p.size());
    EXPECT_THAT(Values<std::int32_t>(grid.get_child("FieldData"), "load_step"), ElementsAre(step));
    const auto length = Values<double>(grid.get_child("FieldData"), "cell_length");
    const ptree& data = piece.get_child("PointData");
    EXPECT_EQ(Values<double>(data, "radius"), scenario.packing.radius);
    const auto id = Values<std::int32_t>(data, "id");
    const auto at = Values<double>(piece.get_child("Points"), "points");
    const auto velocity = Values<double>(data, "velocity");
    const auto spin = Values<double>(data, "angular_velocity");
    for (std::size_t k = 0; k < id.size(); ++k) {
      EXPECT_EQ(id[k], static_cast<int>(k));
      const auto g =
          static_cast<std::size_t>(std::find(p.id.begin(), p.id.end(), id[k]) - p.id.begin());
      for (std::size_t a = 0; a < 3; ++a) {
        EXPECT_EQ(length[a], assembly.cell().length[a]);
        EXPECT_GE(at[3 * k + a], 0);
        EXPECT_LE(at[3 * k + a], length[a]);
      }
      const double turns = (p.x[g] - at[3 * k]) / length[0];
      EXPECT_NEAR(turns, std::round(turns), 1e-12);
      EXPECT_EQ(spin[3 * k + 1], p.wy[g]);
      EXPECT_EQ(velocity[3 * k + 2], p.vz[g] + assembly.cell().stretch[2] * p.z[g]);
    }
    std::int64_t contacts = 0;
    for (const std::int32_t n : Values<std::int32_t>(data, "coordination_number")) contacts += n;
    EXPECT_EQ(contacts, 2 * assembly.contacts());
    const ptree& cells = piece.get_child("Cells");
    const auto vertices = Values<std::int64_t>(cells, "connectivity");
    const auto ends = Values<std::int64_t>(cells, "offsets");
    for (std::size_t k = 0; k < id.size(); ++k) {
      EXPECT_EQ(vertices[k], static_cast<std::int64_t>(k));
      EXPECT_EQ(ends[k], static_cast<std::int64_t>(k) + 1);
    }
    EXPECT_THAT(Values<std::uint8_t>(cells, "types"), ::testing::Each(1));
  }
}

/// Contacts as lines carry the trace of the Love-Weber stress: branches cross the faces of a
/// sheared cell as they should, forces have their sign.
TEST_F(Vtk, ContactsCarryTheMeanStress) {
  Scenario scenario = test::SmallTriaxial(test::HertzModel());
  scenario.test = "simple_shear";
  scenario.packing = test::SmallPacking(200);
  scenario.path = {{.target = 0, .load_step = 0}, {.target = 0.02, .load_step = 1}};
  VtkSeries series(folder_.string());
  std::vector<double> trace, shear, tilt;
  const auto summary = SimulateGrains(
      scenario,
      [&](const State& state, const Assembly& assembly) {
        const auto& stress = assembly.stress();
        trace.push_back((stress[0] + stress[1] + stress[2]) * assembly.cell().Volume());
        shear.push_back(assembly.shear_stress() * assembly.cell().Volume());
        tilt.push_back(assembly.cell().Tilt());
        return series.Add(assembly, state.load_step);
      },
      {});
  ASSERT_TRUE(summary.ok());
  ASSERT_EQ(Collection("contacts.pvd").size(), 2U);
  for (std::size_t step = 0; step < 2; ++step) {
    const ptree piece =
        Read("contacts_000" + std::to_string(step) + ".vtp", "PolyData").get_child("Piece");
    const auto at = Values<double>(piece.get_child("Points"), "points");
    const auto force = Values<double>(piece.get_child("CellData"), "normal_force");
    const auto friction = Values<double>(piece.get_child("CellData"), "tangential_force");
    const auto vector = Values<double>(piece.get_child("CellData"), "force");
    EXPECT_EQ(piece.get<std::size_t>("<xmlattr>.NumberOfLines"), force.size());
    EXPECT_EQ(Values<std::int64_t>(piece.get_child("Lines"), "connectivity").size(),
              2 * force.size());
    double sum = 0;
    double sheared = 0;
    for (std::size_t c = 0; c < force.size(); ++c) {
      const double* const from = &at[6 * c];
      sheared -=
          0.5 * (vector[3 * c] * (from[5] - from[2]) + vector[3 * c + 2] * (from[3] - from[0]));
      sum += force[c] * std::hypot(from[3] - from[0], from[4] - from[1], from[5] - from[2]);
      EXPECT_LE(friction[c], (0.55 + 1e-9) * force[c]);
    }
    EXPECT_NEAR(sum, trace[step], 1e-9 * trace[step]);
    EXPECT_NEAR(sheared, shear[step], 1e-9 * trace[step]);
    const ptree cell = Read("cell_000" + std::to_string(step) + ".vtp", "PolyData");
    const auto corners = Values<double>(cell.get_child("Piece.Points"), "points");
    EXPECT_NEAR(corners[12], tilt[step], 1e-15) << "the first corner of the top";
  }
}

TEST_F(Vtk, CollectionsAreWholeAtAnyMoment) {
  std::size_t reached = 0;
  const auto summary = Simulate(test::SmallTriaxial(test::HertzModel()),
                                [&](const State&) {
                                  if (reached > 0) {
                                    EXPECT_EQ(Collection("grains.pvd").size(), reached);
                                  }
                                  ++reached;
                                },
                                {}, {.vtk_directory = folder_.string()});
  ASSERT_TRUE(summary.ok());
  EXPECT_EQ(Collection("grains.pvd").size(), 3U);
  for (const auto& file : std::filesystem::directory_iterator(folder_)) {
    EXPECT_NE(file.path().extension(), ".part") << file.path();
  }
}

TEST_F(Vtk, AResumedRunGoesOnWithItsSeries) {
  const Scenario scenario = test::SmallTriaxial(test::HertzModel());
  std::vector<std::string> checkpoints;
  const auto keep = [&](const std::string& bytes) {
    checkpoints.push_back(bytes);
    return absl::OkStatus();
  };
  const auto none = [](const State&) {};
  ASSERT_TRUE(
      Simulate(scenario, none, {}, {.vtk_directory = folder_.string(), .checkpoint = keep}).ok());
  const auto whole = Collection("grains.pvd");
  const std::string last = test::ReadFile((folder_ / "grains_0002.vtu").string());
  std::filesystem::remove(folder_ / "grains_0002.vtu");
  std::filesystem::remove(folder_ / "grains.pvd");
  ASSERT_TRUE(Simulate(scenario, none, {},
                       {.vtk_directory = folder_.string(), .resume_from = checkpoints[1]})
                  .ok());
  EXPECT_EQ(Collection("grains.pvd"), whole);
  EXPECT_EQ(test::ReadFile((folder_ / "grains_0002.vtu").string()), last);
}

TEST_F(Vtk, ASiloShowsTheGrainsThatAreLeftAndItsWalls) {
  Scenario silo;
  silo.model.contact = "hertz_mindlin";
  silo.model.density = 2500;
  silo.model.effects = {"viscous_damping"};
  silo.model.parameters = {{"young_modulus", 5e6},
                           {"poisson_ratio", 0.25},
                           {"friction_coefficient", 0.5},
                           {"viscous_damping.ratio", 0.3}};
  silo.test = "silo_discharge";
  silo.settings = {{"silo_width", 0.03}, {"duration", 0.3}};
  silo.packing = *GenerateSizes({.particles = 100, .mean_radius = 0.002, .seed = 3});
  silo.path = {{.target = 0.02, .load_step = 4}};
  const auto summary = Simulate(silo, [](const State&) {}, {}, {.vtk_directory = folder_.string()});
  ASSERT_TRUE(summary.ok()) << summary.status();
  ASSERT_EQ(summary->outcome, Outcome::kCompleted) << summary->reason;
  EXPECT_THAT(Collection("walls.pvd"), ElementsAre(std::pair(4, "walls_0004.vtp")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "cell.pvd")) << "a silo is open above";
  const ptree grains = Read("grains_0004.vtu", "UnstructuredGrid").get_child("Piece");
  const auto left = Values<std::int32_t>(grains.get_child("PointData"), "id");
  EXPECT_GT(left.size(), 0U);
  EXPECT_LT(left.size(), 100U);
  EXPECT_TRUE(std::is_sorted(left.begin(), left.end()));
  const ptree walls = Read("walls_0004.vtp", "PolyData").get_child("Piece");
  const auto corners = Values<std::int64_t>(walls.get_child("Polys"), "connectivity");
  EXPECT_EQ(corners.size(), 3 * walls.get<std::size_t>("<xmlattr>.NumberOfPolys"));
  EXPECT_LT(*std::max_element(corners.begin(), corners.end()),
            walls.get<std::int64_t>("<xmlattr>.NumberOfPoints"));
  EXPECT_THAT(Values<std::int32_t>(walls.get_child("CellData"), "wall"),
              ::testing::AllOf(::testing::Contains(0), ::testing::Contains(1)));
}

TEST_F(Vtk, NamesTheFileThatCannotBeWritten) {
  const auto summary = Simulate(test::SmallTriaxial(test::HertzModel()), [](const State&) {}, {},
                                {.vtk_directory = "/proc/nowhere"});
  EXPECT_EQ(summary.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(summary.status().message()),
              HasSubstr("cannot write /proc/nowhere/grains_0000.vtu: "));
}

}  // namespace
}  // namespace calib::dem
