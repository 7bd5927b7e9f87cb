#pragma once
// What the names of a model (contact law, effects) stand for: entries of the registry.

#include <vector>

#include "dem/model/contact_law.h"
#include "dem/model/effect.h"

namespace calib::dem {

/// Entries of the contact law and the effects that a model names. They live as long as the program.
struct ModelEntries {
  const ContactEntry* law = nullptr;
  std::vector<const EffectEntry*> effects =
      {};  ///< those that the model names, in the order of their places, however the
           ///< user lists them; not those that a user declares
};

}  // namespace calib::dem
