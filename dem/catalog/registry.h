#pragma once
// Where contact laws, effects and lab tests are listed: one line each in registry.cc makes an entry
// known to everything that reads the catalogue and to the engine.

#include <span>
#include <vector>

#include "dem/catalog/catalog.h"
#include "dem/contact/contact_kernel.h"
#include "dem/lab_tests/element_test.h"

namespace calib::dem {

/// A contact law; its kernel runs at ContactStage::kNormal, friction and shear spring follow for
/// every law.
struct ContactEntry {
  ContactInfo info;
  MakeKernel make = nullptr;
};

/// One kernel of an effect and where in the chain it acts.
struct EffectKernel {
  ContactStage stage = ContactStage::kMoment;
  MakeKernel make = nullptr;
};

/// An effect; those that do not act between grains have no kernels. Effects of one stage act in the
/// order of the registry.
struct EffectEntry {
  EffectInfo info;
  std::vector<EffectKernel> kernels = {};
};

/// A test of one specimen in its periodic cell.
struct ElementTestEntry {
  TestInfo info;
  PlanElementTest plan = nullptr;
};

std::span<const ContactEntry> ContactEntries();
std::span<const EffectEntry> EffectEntries();
std::span<const ElementTestEntry> ElementTestEntries();

}  // namespace calib::dem
