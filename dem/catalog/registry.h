#pragma once
// Where contact laws, effects and lab tests are listed, for everything that reads the catalogue and for
// the engine. Effects are found by their files, one each in dem/effects; the others are a line each in
// registry.cc.

#include <optional>
#include <span>
#include <vector>

#include "dem/catalog/catalog.h"
#include "dem/contact/contact_kernel.h"
#include "dem/lab_tests/element_test.h"
#include "dem/measure/apparatus.h"

namespace calib::dem {

/// A contact law; its kernel runs at ContactStage::kNormal, friction and shear spring follow for
/// every law. A dashpot, where there is one, runs at the end of kNormalExtra.
struct ContactEntry {
  ContactInfo info;
  MakeKernel make = nullptr;
  MakeKernel make_dashpot = nullptr;
};

/// One kernel of an effect and where in the chain it acts.
struct EffectKernel {
  ContactStage stage = ContactStage::kMoment;
  MakeKernel make = nullptr;
};

/// How the specimen and its initial state differ from packing and consolidation as asked for.
struct Preparation {
  double densification = 0;      ///< fall of porosity [-]
  double stress_anisotropy = 0;  ///< q/p during consolidation [-]
  double aspect = 1;             ///< length over width of the grains; 1: as they are [-]
  // Of grains that crush: CrushingLaw in dynamics/crushing.h.
  double weakness = 0;               ///< [1/Pa]
  double weibull_modulus = 3;        ///< [-]
  double reference_diameter = 1e-3;  ///< [m]
  double size_loss = 0;              ///< [-]
};

/// What distinguishes contacts with walls from those between grains.
struct WallProperties {
  double friction_ratio = 1;       ///< tan(phi_w)/tan(phi_mu) [-]
  std::optional<double> friction;  ///< tan(phi_w) itself, in place of the ratio [-]
};

/// An effect acts between grains, at walls, on the readings, or on the initial state: it sets what
/// it needs.
struct EffectEntry {
  EffectInfo info;
  int place = 1000;  ///< effects of one stage act, and all are listed, in this order, then by name
  std::vector<EffectKernel> kernels = {};
  void (*alter)(const ParameterSet& parameters, Apparatus& apparatus) = nullptr;
  void (*prepare)(const ParameterSet& parameters, Preparation& preparation) = nullptr;
  void (*bound)(const ParameterSet& parameters, WallProperties& walls) = nullptr;
};

/// A test of one specimen in its periodic cell.
struct ElementTestEntry {
  TestInfo info;
  PlanElementTest plan = nullptr;
  RigLoad rig_load = RigLoad::kNone;
};

/// A test of grains under gravity between walls; its procedure is in simulation/.
struct GravityTestEntry {
  TestInfo info;
};

/// Given values of one law or effect without their prefix, and the defaults of what was not given.
ParameterSet ResolveParameters(const std::vector<ParameterInfo>& infos, const std::string& prefix,
                               const std::map<std::string, double>& given);

std::span<const ContactEntry> ContactEntries();

/// Every effect of dem/effects, in the order of their places.
std::span<const EffectEntry> EffectEntries();

std::span<const ElementTestEntry> ElementTestEntries();
std::span<const GravityTestEntry> GravityTestEntries();

}  // namespace calib::dem
