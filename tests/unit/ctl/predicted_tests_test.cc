// What a predicted test takes of the campaign's own experiment.
#include "server/ctl/predicted_tests.h"

#include <gtest/gtest.h>

#include "server/campaign/file/text/yaml_text.h"

namespace calib::ctl {
namespace {

campaign::YamlNode Tree(const std::string& text) {
  campaign::YamlParse parse = campaign::ParseYaml(text);
  EXPECT_FALSE(parse.error.has_value()) << text;
  return *parse.root;
}

std::string Taken(const std::string& from, const std::string& experiment) {
  campaign::YamlNode taker = Tree(experiment);
  TakeSpecimen(Tree(from), taker);
  return campaign::ToYaml(taker);
}

std::string Same(const std::string& text) { return campaign::ToYaml(Tree(text)); }

constexpr const char* kParent =
    "{test: shaken_box, packing: {file: p.txt}, realizations: 3, "
    "materials: {walls: steel, intruder: steel, grains: {wood: 0.25}}}";

TEST(TakeSpecimen, APackingComesWithItsRealizationsAndItsMixture) {
  EXPECT_EQ(Taken(kParent, "{test: oedometric}"),
            Same("{test: oedometric, packing: {file: p.txt}, realizations: 3, "
                 "materials: {grains: {wood: 0.25}}}"));
  EXPECT_EQ(Taken("{packing: {file: p.txt}}", "{test: oedometric}"),
            Same("{test: oedometric, packing: {file: p.txt}}"));
}

TEST(TakeSpecimen, WhatATestSaysItselfStays) {
  for (const char* own : {"{test: oedometric, packing: {file: q.txt}}", "{test: collision}"}) {
    EXPECT_EQ(Taken(kParent, own), Same(own));
  }
  EXPECT_EQ(Taken(kParent, "{test: oedometric, realizations: 1, materials: {}}"),
            Same("{test: oedometric, realizations: 1, materials: {}, packing: {file: p.txt}}"));
}

}  // namespace
}  // namespace calib::ctl
