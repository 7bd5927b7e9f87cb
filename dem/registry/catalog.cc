#include "dem/registry/catalog.h"

#include <algorithm>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/formula/user_effect.h"
#include "dem/lab_tests/shared/procedure_observables.h"
#include "dem/measure/found_observables.h"
#include "dem/model/readings.h"
#include "dem/registry/registry.h"

namespace calib::dem {
namespace {

template <class Info, class Entry>
std::vector<Info> InfosOf(std::span<const Entry> entries) {
  std::vector<Info> infos;
  infos.reserve(entries.size());
  for (const Entry& entry : entries) {
    infos.push_back(entry.info);
  }
  return infos;
}

template <class Info>
const Info* FindByName(std::span<const Info> infos, const std::string& name) {
  const auto it =
      std::find_if(infos.begin(), infos.end(), [&](const Info& i) { return i.name == name; });
  return it == infos.end() ? nullptr : &*it;
}

void Append(std::string& text, const ParameterInfo& p) {
  absl::StrAppend(&text, "  ", p.name, " [", p.unit, "]");
  for (const auto& [contact, unit] : p.unit_by_contact) {
    absl::StrAppend(&text, " ", contact, ":[", unit, "]");
  }
  absl::StrAppend(&text, p.min_open ? " (" : " [", p.min, ", ", p.max, "] ", p.default_prior.kind,
                  " ", p.default_prior.min, " ", p.default_prior.max);
  if (p.default_value) {
    absl::StrAppend(&text, " default ", *p.default_value);
  }
  if (p.null_value) {
    absl::StrAppend(&text, " null ", *p.null_value);
  }
  for (const auto& [contact, null] : p.null_by_contact) {
    absl::StrAppend(&text, " ", contact, ":null ", null);
  }
  absl::StrAppend(&text, p.of_pairs ? " of pairs" : "",
                  p.alternative_to.empty() ? "" : " alternative to ", p.alternative_to, ": ",
                  p.description, "\n");
}

}  // namespace

std::span<const ContactInfo> Contacts() {
  static const std::vector<ContactInfo> infos = InfosOf<ContactInfo>(ContactEntries());
  return infos;
}

std::span<const EffectInfo> Effects() {
  static const std::vector<EffectInfo> infos = InfosOf<EffectInfo>(EffectEntries());
  return infos;
}

std::span<const TestInfo> Tests() {
  static const std::vector<TestInfo> infos = InfosOf<TestInfo>(TestEntries());
  return infos;
}

std::span<const ObservableInfo> Observables() {
  static const std::vector<ObservableInfo> infos = [] {
    std::vector<ObservableEntry> entries = FoundObservables();
    for (const ReadingEntry& reading : Readings()) {
      entries.push_back({.info = reading.info, .place = reading.place});
    }
    const auto procedures = ProcedureObservables();
    entries.insert(entries.end(), procedures.begin(), procedures.end());
    std::sort(entries.begin(), entries.end(),
              [](const ObservableEntry& a, const ObservableEntry& b) {
                return std::tie(a.place, a.info.name) < std::tie(b.place, b.info.name);
              });
    return InfosOf<ObservableInfo>(std::span<const ObservableEntry>(entries));
  }();
  return infos;
}

const ContactInfo* FindContact(const std::string& name) { return FindByName(Contacts(), name); }
const EffectInfo* FindEffect(const std::string& name) { return FindByName(Effects(), name); }

const TestInfo* FindTest(const std::string& name) { return FindByName(Tests(), name); }
const ObservableInfo* FindObservable(const std::string& name) {
  return FindByName(Observables(), name);
}

const ParameterInfo* FindParameter(const std::string& contact, std::span<const std::string> effects,
                                   const std::string& dotted_name) {
  const auto dot = dotted_name.find('.');
  if (dot == std::string::npos) {
    const ContactInfo* info = FindContact(contact);
    return info == nullptr
               ? nullptr
               : FindByName(std::span<const ParameterInfo>(info->parameters), dotted_name);
  }
  const std::string prefix = dotted_name.substr(0, dot);
  const EffectInfo* info = FindEffect(prefix);
  if (info == nullptr || std::find(effects.begin(), effects.end(), prefix) == effects.end()) {
    return nullptr;
  }
  return FindByName(std::span<const ParameterInfo>(info->parameters), dotted_name.substr(dot + 1));
}

std::string CatalogText() {
  std::string text = absl::StrCat("engine ", EngineVersion(), "\n");
  for (const ContactInfo& c : Contacts()) {
    absl::StrAppend(&text, "contact ", c.name, ": ", c.description, " {", c.reference, "}\n");
    for (const ParameterInfo& p : c.parameters) {
      Append(text, p);
    }
  }
  for (const EffectInfo& e : Effects()) {
    absl::StrAppend(&text, "effect ", e.name, " (", e.kind, "; ", absl::StrJoin(e.contacts, " "),
                    "): ", e.description, " {", e.reference, "}\n");
    for (const ParameterInfo& p : e.parameters) {
      Append(text, p);
    }
  }
  for (const TestInfo& t : Tests()) {
    absl::StrAppend(&text, "test ", t.name, " control ", t.control,
                    t.stress_control.empty() ? "" : " or ", t.stress_control,
                    t.may_reverse ? " reversible" : "", ": ", t.description, " {", t.reference,
                    "} ", absl::StrJoin(t.observables, " "), "\n");
    for (const ParameterInfo& p : t.settings) {
      Append(text, p);
    }
    for (const MeshInfo& m : t.meshes) {
      absl::StrAppend(&text, "mesh ", m.name, ": ", m.description, "\n");
    }
  }
  for (const auto& quantities :
       {ContactQuantities(), StageQuantities(), ContactTargets(), ReadingTargets()}) {
    for (const FormulaQuantity& q : quantities) {
      absl::StrAppend(&text, "formula ", q.name, " [", q.unit, "]: ", q.description, "\n");
    }
  }
  for (const ObservableInfo& o : Observables()) {
    absl::StrAppend(&text, "observable ", o.name, " [", o.unit, "]: ", o.description, "\n");
  }
  return text;
}

}  // namespace calib::dem
