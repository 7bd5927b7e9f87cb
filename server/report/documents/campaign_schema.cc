#include "server/report/documents/campaign_schema.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "dem/registry/catalog.h"
#include "server/campaign/keys/sections.h"

namespace calib::report {
namespace {

using campaign::Form;
using campaign::Key;
using campaign::Section;
using Json = nlohmann::ordered_json;

// A number with a unit behind it is a text that begins as a number does.
constexpr const char* kQuantity = R"(^\s*[-+]?(\.?[0-9]|inf))";

void AddBounds(const campaign::Range& range, Json& schema) {
  if (std::isfinite(range.min)) schema[range.min_open ? "exclusiveMinimum" : "minimum"] = range.min;
  if (std::isfinite(range.max)) schema[range.max_open ? "exclusiveMaximum" : "maximum"] = range.max;
}

Json SchemaOf(const Form& form) {
  switch (form.kind) {
    case Form::Kind::kText:
      return {{"type", {"string", "number", "boolean"}}};
    case Form::Kind::kNumber: {
      Json schema = {{"type", {"number", "string"}}, {"pattern", kQuantity}};
      AddBounds(form.range, schema);  // of numbers alone; texts may have other units
      return schema;
    }
    case Form::Kind::kWhole:
      return {{"type", "integer"}, {"minimum", form.least}, {"maximum", form.most}};
    case Form::Kind::kWord: {
      Json words = form.words;
      for (const std::string& word : form.words) {  // editors of YAML read these as no texts
        if (word == "off" || word == "false") words.push_back(false);
      }
      return {{"enum", words}};
    }
    case Form::Kind::kTrueOrFalse:
      return {{"type", "boolean"}};
    case Form::Kind::kNothing:
      return {{"type", "null"}};
    case Form::Kind::kList:
      return {{"type", "array"}, {"items", SchemaOf(form.of.front())}};
    case Form::Kind::kMap:
      return {{"$ref", "#/definitions/" + form.section}};
    case Form::Kind::kAnyOf: {
      Json any = Json::array();
      for (const Form& one : form.of) any.push_back(SchemaOf(one));
      return {{"anyOf", any}};
    }
  }
  return {};
}

std::string PlainText(const std::string& markdown) {
  std::string text;
  for (const char c : markdown) {
    if (c != '`' && c != '*' && c != '\\') text += c;
  }
  return text;
}

// In draft 7 nothing counts beside a $ref.
Json Described(const Form& form, const std::string& description) {
  Json schema = {{"description", PlainText(description)}};
  Json own = SchemaOf(form);
  if (own.contains("$ref")) {
    schema["allOf"] = Json::array({own});
  } else {
    schema.update(own);
  }
  return schema;
}

std::string UnitText(const Form& form) {
  const Form* number = FindForm(form, Form::Kind::kNumber);
  if (number == nullptr || number->unit.empty() || number->unit == "1") return "";
  return absl::StrCat(" [", number->unit, "]");
}

std::string DescriptionOf(const Key& key) {
  return absl::StrCat(key.meaning, UnitText(key.form),
                      key.values.empty() ? "" : absl::StrCat("; ", key.values),
                      key.standard.empty() || key.standard == campaign::kRequired
                          ? ""
                          : absl::StrCat("; default: ", key.standard));
}

Json SchemaOf(const Section& section) {
  Json properties = Json::object();
  Json required = Json::array();
  Json others = false;
  for (const Key& key : section.keys) {
    if (IsPlaceholder(key)) {
      for (const campaign::Offered& offered : section.offered) {
        properties[offered.name] = Described(key.form, offered.meaning);
      }
      if (!section.closed) others = Described(key.form, DescriptionOf(key));
    } else {
      properties[key.name] = Described(key.form, DescriptionOf(key));
      if (key.standard == campaign::kRequired) required.push_back(key.name);
    }
  }
  Json schema = {{"type", "object"}, {"properties", properties}, {"additionalProperties", others}};
  if (!required.empty()) schema["required"] = required;
  return schema;
}

// Of each test: settings of others are no keys of its experiments.
Json RulesOfTests() {
  std::set<std::string> all;
  for (const dem::TestInfo& test : dem::Tests()) {
    for (const dem::ParameterInfo& setting : test.settings) all.insert(setting.name);
  }
  Json rules = Json::array();
  for (const dem::TestInfo& test : dem::Tests()) {
    Json none = Json::object();
    for (const std::string& name : all) none[name] = false;
    for (const dem::ParameterInfo& setting : test.settings) none.erase(setting.name);
    rules.push_back({{"if",
                      {{"properties", {{"test", {{"const", test.name}}}}},
                       {"required", Json::array({"test"})}}},
                     {"then", {{"properties", none}}}});
  }
  return rules;
}

// --- the reference -------------------------------------------------------------------------------

std::string Code(const std::string& text) { return absl::StrCat("`", text, "`"); }

std::string Anchor(const std::string& title) {
  std::string anchor;
  for (const char c : title) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-') {
      anchor += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    } else if (c == ' ') {
      anchor += '-';
    }
  }
  return anchor;
}

std::string ValuesOf(const std::vector<Section>& sections, const Form& form) {
  switch (form.kind) {
    case Form::Kind::kText:
      return "text";
    case Form::Kind::kNumber:
      return form.unit.empty() ? "number" : form.range.Describe(form.unit);
    case Form::Kind::kWhole:
      return form.most > static_cast<std::uint64_t>(1e9)
                 ? "whole number"
                 : absl::StrCat("whole number, ", form.least, " to ", form.most);
    case Form::Kind::kWord: {
      constexpr std::size_t kMostWords = 8;  // longer lists are those of the catalogue
      if (form.words.size() > kMostWords) return "name";
      std::vector<std::string> words;
      words.reserve(form.words.size());
      for (const std::string& word : form.words) words.push_back(Code(word));
      return absl::StrJoin(words, ", ");
    }
    case Form::Kind::kTrueOrFalse:
      return "`true`, `false`";
    case Form::Kind::kNothing:
      return "nothing";
    case Form::Kind::kList:
      return absl::StrCat("list: ", ValuesOf(sections, form.of.front()));
    case Form::Kind::kMap: {
      const auto is_it = [&form](const Section& s) { return s.name == form.section; };
      const std::string& title = std::find_if(sections.begin(), sections.end(), is_it)->title;
      return absl::StrCat("[", Code(title), "](#", Anchor(title), ")");
    }
    case Form::Kind::kAnyOf: {
      std::vector<std::string> values;
      values.reserve(form.of.size());
      for (const Form& one : form.of) values.push_back(ValuesOf(sections, one));
      return absl::StrJoin(values, "; or ");
    }
  }
  return "";
}

}  // namespace

std::string CampaignSchema(const campaign::MethodList& methods) {
  Json definitions = Json::object();
  const std::vector<Section> sections = campaign::Sections(methods);
  for (std::size_t i = 1; i < sections.size(); ++i) {
    definitions[sections[i].name] = SchemaOf(sections[i]);
  }
  definitions["experiment"]["allOf"] = RulesOfTests();
  Json schema = {{"$schema", "http://json-schema.org/draft-07/schema#"},
                 {"title", "Campaign file of calib"},
                 {"description",
                  "Numbers may carry a unit (0.2 MPa); without one they are SI. calibctl validate "
                  "tells the rest."}};
  schema.update(SchemaOf(sections.front()));
  schema["definitions"] = definitions;
  return schema.dump(2) + "\n";
}

std::string KeyReference(const campaign::MethodList& methods) {
  std::string text =
      "# Keys of the campaign file\n\n"
      "Generated by `calibctl schema --reference` from the table of keys that the reader itself "
      "uses.\nWhat they mean together: [CAMPAIGN_FILE.md](CAMPAIGN_FILE.md).\n";
  const std::vector<Section> sections = campaign::Sections(methods);
  for (const Section& section : sections) {
    absl::StrAppend(&text, "\n## ", section.title, "\n\n| key | values | default | meaning |\n",
                    "|---|---|---|---|\n");
    for (const Key& key : section.keys) {
      absl::StrAppend(&text, "| ", Code(key.name), " | ",
                      key.values.empty() ? ValuesOf(sections, key.form) : key.values, " | ",
                      key.standard, " | ", key.meaning, " |\n");
    }
  }
  return text;
}

}  // namespace calib::report
