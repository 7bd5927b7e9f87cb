#include "dem/registry/registry.h"

#include <algorithm>
#include <cassert>
#include <tuple>
#include <utility>
#include <vector>

#include "dem/registry/found_entries.h"

namespace calib::dem {
namespace {

template <class Entry>
std::vector<Entry> InPlace(std::vector<Entry> found) {
  std::sort(found.begin(), found.end(), [](const Entry& a, const Entry& b) {
    return std::tie(a.place, a.info.name) < std::tie(b.place, b.info.name);
  });
  return found;
}

template <class Entry>
const Entry* EntryNamed(std::span<const Entry> entries, const std::string& name) {
  const auto it = std::find_if(entries.begin(), entries.end(),
                               [&](const Entry& entry) { return entry.info.name == name; });
  return it == entries.end() ? nullptr : &*it;
}

/// Effects, with the names of the tests whose traits they ask for.
std::vector<EffectEntry> EffectsWithTests() {
  std::vector<EffectEntry> effects = InPlace(FoundEffects());
  for (EffectEntry& effect : effects) {
    for (const TestEntry& test : TestEntries()) {
      if (effect.shows_in != nullptr && effect.shows_in(test.info)) {
        effect.info.excited_by.push_back(test.info.name);
      }
    }
  }
  return effects;
}

}  // namespace

std::span<const ContactEntry> ContactEntries() {
  static const std::vector<ContactEntry> entries = InPlace(FoundContacts());
  return entries;
}

std::span<const EffectEntry> EffectEntries() {
  static const std::vector<EffectEntry> entries = EffectsWithTests();
  return entries;
}

std::span<const TestEntry> TestEntries() {
  static const std::vector<TestEntry> entries = InPlace(FoundTests());
  return entries;
}

const TestEntry* FindTestEntry(const std::string& name) { return EntryNamed(TestEntries(), name); }

ModelEntries EntriesOf(const Model& model) {
  ModelEntries entries{.law = EntryNamed(ContactEntries(), model.contact)};
  assert(entries.law != nullptr);
  for (const EffectEntry& effect : EffectEntries()) {
    if (std::find(model.effects.begin(), model.effects.end(), effect.info.name) !=
        model.effects.end()) {
      entries.effects.push_back(&effect);
    }
  }
  return entries;
}

ContactModel ContactModelOf(const Model& model, double thickness) {
  return ContactModel(model, EntriesOf(model), thickness);
}

}  // namespace calib::dem
