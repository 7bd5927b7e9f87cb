#include "server/campaign/keys/key.h"

#include <algorithm>
#include <cctype>
#include <limits>
#include <utility>

namespace calib::campaign {

Form Text() { return {}; }

Form Number(std::string unit, Range range) {
  return {.kind = Form::Kind::kNumber, .unit = std::move(unit), .range = range};
}

Form NumberOfCatalogue() { return {.kind = Form::Kind::kNumber}; }

Form Whole(std::int64_t least, std::uint64_t most) {
  return {.kind = Form::Kind::kWhole, .least = least, .most = most};
}

Form Seed() { return Whole(0, std::numeric_limits<std::uint64_t>::max()); }

Form OneWord(std::vector<std::string> words) {
  return {.kind = Form::Kind::kWord, .words = std::move(words)};
}

Form TrueOrFalse() { return {.kind = Form::Kind::kTrueOrFalse}; }

Form Nothing() { return {.kind = Form::Kind::kNothing}; }

Form ListOf(Form form) { return {.kind = Form::Kind::kList, .of = {std::move(form)}}; }

Form OneOrMore(Form form) {
  Form list = ListOf(form);
  return AnyOf({std::move(form), std::move(list)});
}

Form MapOf(std::string section) {
  return {.kind = Form::Kind::kMap, .section = std::move(section)};
}

Form AnyOf(std::vector<Form> forms) { return {.kind = Form::Kind::kAnyOf, .of = std::move(forms)}; }

const Form* FindForm(const Form& form, Form::Kind kind) {
  if (form.kind == kind) return &form;
  for (const Form& one : form.of) {
    if (const Form* found = FindForm(one, kind)) return found;
  }
  return nullptr;
}

bool IsPlaceholder(const Key& key) {
  return std::all_of(key.name.begin(), key.name.end(),
                     [](unsigned char c) { return std::isupper(c) != 0 || c == '-'; });
}

const Key* FindKey(const Section& section, std::string_view name) {
  const Key* any = nullptr;
  for (const Key& key : section.keys) {
    if (key.name == name) return &key;
    if (IsPlaceholder(key)) any = &key;
  }
  return any;
}

}  // namespace calib::campaign
