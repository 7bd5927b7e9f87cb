#include "server/report/html/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <regex>

#include "server/report/text/html.h"
#include "server/report/views/comparison.h"
#include "tests/unit/report/example_view.h"

namespace calib::report {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Report, IsOneSelfContainedFile) {
  const std::string html = RenderReport(testing::ExampleView("sand"));
  EXPECT_FALSE(std::regex_search(html, std::regex("(src|href)=")));
  EXPECT_THAT(html, Not(HasSubstr("http")));
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
  EXPECT_GT(html.size(), 20000U);
}

TEST(Report, EveryPictureHasATitleForScreenReaders) {
  const std::string html = RenderReport(testing::ExampleView("sand"));
  const auto count = [&html](const std::string& what) {
    int n = 0;
    for (std::size_t at = html.find(what); at != std::string::npos; at = html.find(what, at + 1)) {
      ++n;
    }
    return n;
  };
  EXPECT_GT(count("<svg "), 15);
  EXPECT_EQ(count("<svg "), count("role=\"img\""));
  EXPECT_EQ(count("<svg "), count("<title") - 1);  // the page has one too
}

TEST(Report, SaysWhichParametersMoveTheBulkProperties) {
  CampaignView view = testing::ExampleView("sand");
  EXPECT_THAT(RenderReport(view), HasSubstr("prior: –")) << "the runs lie together";
  view.campaign.parameters[0].prior = {
      .kind = inference::PriorKind::kUniform, .min = 0.4e9, .max = 8e9};
  view.campaign.parameters[1].prior = {
      .kind = inference::PriorKind::kUniform, .min = 0.17, .max = 0.8};
  const std::string html = RenderReport(view);
  EXPECT_THAT(html, HasSubstr("<h2>What moves what</h2>"));
  EXPECT_THAT(html, Not(HasSubstr("prior: –")));
  EXPECT_THAT(html, HasSubstr("share of friction angle in the peak friction angle of tx02"));
  EXPECT_THAT(html, HasSubstr("share of friction angle in the final volumetric strain of tx02"));
  view.samples.resize(10);
  EXPECT_THAT(RenderReport(view), HasSubstr("an emulator needs at least 20 finished runs"));
}

TEST(Report, AHostileNameStaysText) {
  const std::string name = "</title><script>alert(1)</script><img src=x onerror='alert(2)'>\"&";
  CampaignView view = testing::ExampleView(name);
  view.status.set_reason(name);
  view.campaign.experiments[0].name = name;
  view.posterior.mutable_parameters(0)->set_name(name);
  view.posterior.add_warnings(name);
  const std::string html = RenderReport(view);
  EXPECT_THAT(html, Not(HasSubstr("<script")));
  EXPECT_THAT(html, Not(HasSubstr("<img")));
  EXPECT_THAT(html, HasSubstr("&lt;script&gt;"));
}

TEST(Report, ShowsTheScatterOfTheModelBesideTheNoise) {
  CampaignView view = testing::ExampleView("scattered");
  EXPECT_THAT(RenderReport(view), HasSubstr("<th>scatter</th>"));
  EXPECT_THAT(RenderReport(view), HasSubstr(">not known<"));
  const campaign::Experiment& experiment = view.campaign.experiments[0];
  v1::Posterior::Scatter& scatter = *view.posterior.add_scatter();
  scatter.set_experiment(experiment.name);
  scatter.set_observable(experiment.observables[0].name);
  for (std::size_t i = 0; i < experiment.control.size(); ++i) {
    scatter.add_load_step(static_cast<int>(i));
    scatter.add_sd(0.5 * ErrorOf(view, experiment.observables[0], i));
  }
  scatter.set_from("realizations");
  scatter.set_runs(4);
  scatter.set_share(1);
  const std::string html = RenderReport(view);
  EXPECT_THAT(html, HasSubstr("<td>0.5</td><td class=\"l\">4 packings</td>"));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

// Whatever the method: what the store holds of them is shown.
TEST(Report, ShowsHowThePosteriorJudgesItself) {
  CampaignView view = testing::ExampleView("judged");
  for (auto& p : *view.posterior.mutable_parameters()) p.set_split_half(NAN);
  view.posterior.clear_predictive_p();
  const std::string before = RenderReport(view);
  EXPECT_THAT(before, Not(HasSubstr("Fit and errors")));
  EXPECT_THAT(before, Not(HasSubstr("halves, sd")));
  view.posterior.set_predictive_p(0.034);
  view.posterior.mutable_parameters(1)->set_split_half(0.21);
  v1::Posterior::NoiseScale& scale = *view.posterior.add_noise_scale();
  scale.add_observables("tx02.q_over_p");
  scale.add_observables("tx02.<b>");
  scale.set_q05(1.1);
  scale.set_q50(1.4);
  scale.set_q95(1.9);
  const std::string html = RenderReport(view);
  EXPECT_THAT(html, HasSubstr("p-value 0.034"));
  EXPECT_THAT(html, HasSubstr("Of data sets drawn from the posterior 3.4"));
  EXPECT_THAT(html, HasSubstr("Errors of tx02.q_over_p, tx02.&lt;b&gt; are 1.4 times as large as "
                              "stated (5–95&#8201;%: 1.1 to 1.9)"));
  EXPECT_THAT(html, HasSubstr("<th>halves, sd</th>"));
  EXPECT_THAT(html, HasSubstr("<td>0.21</td>"));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST(Report, TellsTheStoryOfAnAddedEffect) {
  const CampaignView view = testing::ExampleView("sand");
  ObservableMisfit misfit;
  misfit.experiment = "tx02";
  misfit.observable = "q_over_p";
  misfit.rms_error = 4.25;
  const auto relative = [](const std::string& id, const std::string& purpose,
                           const std::string& effect, double log_evidence) {
    Relative r;
    r.campaign = id;
    if (!effect.empty()) {
      r.parent = "c0";
      r.effects = {effect};
    }
    r.purpose = campaign::ToDerivedFor(purpose);
    r.log_evidence = log_evidence;
    return r;
  };
  Story story;
  story.family = {relative("c0", "", "", -80),
                  relative("c1", "extension", "rolling_resistance", 12),
                  relative("c2", "warm_fit", "<b>membrane", std::nan(""))};
  story.steps.resize(2);
  story.steps[0].campaign = "c0";
  story.steps[0].rms_error = 4.25;
  story.steps[0].heldout_rms_error = 5;
  story.steps[0].by_observable = {misfit};
  story.steps[1].campaign = "c1";
  story.steps[1].effects = {"rolling_resistance"};
  story.steps[1].rms_error = 1;
  const std::string html = RenderReport(view, story);
  EXPECT_THAT(html, HasSubstr("Error before and after"));
  EXPECT_THAT(html, HasSubstr("<strong>c1: rolling resistance</strong>, log evidence 12"));
  EXPECT_THAT(html, HasSubstr("c2: &lt;b&gt;membrane (tried)"));
  EXPECT_THAT(html, HasSubstr("<td>4.25</td>"));
  EXPECT_THAT(html, HasSubstr("Error of all observables against step"));
  EXPECT_THAT(html, Not(HasSubstr("nan")));
  EXPECT_THAT(html, Not(HasSubstr("Why each step"))) << "extended by hand";
  EXPECT_THAT(html, Not(HasSubstr("left out")));
  story.improvement = StoredImprovement{
      .steps = {{.campaign = "c0",
                 .verdict = "ambiguous",
                 .reason = "rolling_resistance is added, <i>twisting</i> is no step.",
                 .left_out_error = 2.75},
                {.campaign = "c1", .verdict = "adequate", .reason = "", .left_out_error = 0.9}},
      .verdict_digest = "5f1e",
      .opened_before = {"ab"}};
  const std::string improved = RenderReport(view, story);
  for (const char* said :
       {"<td>4.25</td><td>2.75</td><td>5</td>", "<td>1</td><td>0.9</td><td>–</td>",
        "<li>c0: rolling_resistance is added, &lt;i&gt;twisting&lt;/i&gt; is no step.</li>",
        "SHA-256 5f1e, before the held-out data", "opened before, for another verdict"}) {
    EXPECT_THAT(improved, HasSubstr(said));
  }
}

// The JSON of `calibctl diagnose`, shortened.
constexpr const char* kDiagnosis = R"json({"campaign": "c1", "verdict": "missing_effect",
  "effect": "contact_plasticity", "sentence": "Missing: contact_plasticity.",
  "adequacy": {"chi2": 431, "degrees": 76, "p_value": 1e-40, "rms": 2.4, "left_out_error": 3.1},
  "candidates": [
    {"effect": "contact_plasticity", "p_value": 0.0013, "explained_fraction": 0.98,
     "predicted_rms_error": 0.91, "amplitude": {"contact_plasticity.stiffness": 3200, "cohesion.range": 2},
     "confusable_with": ["twisting_resistance"], "angles": {"twisting_resistance": 12.4},
     "warm_fit": {"campaign": "c7", "p_value": 0.56, "left_out_error": 1.02}},
    {"effect": "<b>membrane", "p_value": 1, "explained_fraction": 0.02, "predicted_rms_error": 2.4,
     "amplitude": {}, "confusable_with": []}],
  "units": {"contact_plasticity.stiffness": "Pa"}, "only_adequacy": false,
  "not_excitable": [{"effect": "wall_friction", "reason": "none of the fitted tests can show it"}],
  "next_experiment": {"snippet": "  - name: next\n", "separates": ["contact_plasticity"],
                      "expected_power": 0.93,
                      "not_separated": [["adhesion_dmt", "adhesion_jkr"]]}, "warnings": ["closer than the stated errors"]})json";

TEST(Report, ShowsTheDiagnosisThatWasKept) {
  const CampaignView view = testing::ExampleView("sand");
  Story story;
  story.known = true;
  EXPECT_THAT(RenderReport(view, story), HasSubstr("calibctl diagnose c1"));
  auto diagnosis = ReadDiagnosis(kDiagnosis);
  ASSERT_TRUE(diagnosis.ok()) << diagnosis.status();
  diagnosis->digest = "5f1e";
  story.diagnoses = {*diagnosis};
  const std::string html = RenderReport(view, story);
  for (const char* said :
       {"Missing: contact_plasticity.", "<b>contact plasticity</b><span>missing, says",
        "<strong>contact plasticity</strong>", "<td>0.0013</td><td>98 %</td><td>0.91</td>",
        "<td>0.56</td><td>1.02</td>", ">cohesion: range = 2, stiffness = 3.2 kPa<",
        "twisting resistance (12°)", "&lt;b&gt;membrane", "chi-squared 431", "SHA-256 5f1e",
        "wall friction: none of the fitted tests can show it", "closer than the stated errors",
        "  - name: next", ", but not adhesion dmt from adhesion jkr.",
        "By rules of an earlier build; <code>calibctl diagnose c1</code> asks again."}) {
    EXPECT_THAT(html, HasSubstr(said));
  }
  EXPECT_THAT(html, Not(HasSubstr("nan")));
}

TEST(StoredDiagnosis, TheLatestThatTriedEffectsIsShown) {
  const auto make = [](const char* verdict, bool only_adequacy, const char* next) {
    StoredDiagnosis d;
    d.campaign = "c1";
    d.verdict = verdict;
    d.only_adequacy = only_adequacy;
    d.next_experiment = next;
    return d;
  };
  std::vector<StoredDiagnosis> kept = {make("unexplained", true, "")};
  EXPECT_EQ(LatestOf(kept, "c1"), &kept[0]);
  EXPECT_EQ(LatestOf(kept, "c2"), nullptr);
  kept.push_back(make("missing_effect", false, "- name: next"));
  kept.push_back(make("missing_effect", false, ""));
  kept.push_back(make("unexplained", true, ""));
  EXPECT_EQ(LatestOf(kept, "c1"), &kept[1]);
  kept.push_back(make("ambiguous", false, ""));
  EXPECT_EQ(LatestOf(kept, "c1"), &kept[4]);
  kept.push_back(make("ambiguous", false, "- name: next"));
  kept.push_back(make("ambiguous", false, ""));
  EXPECT_EQ(LatestOf(kept, "c1"), &kept[5]);
  kept.back().then_file = "next.csv";
  EXPECT_EQ(LatestOf(kept, "c1"), &kept[6]) << "it knows another measurement";
}

TEST(Report, ShowsWhatEachMeasurementIsExpectedToTell) {
  const CampaignView view = testing::ExampleView("sand");
  auto diagnosis = ReadDiagnosis(R"json({
    "campaign": "c1", "verdict": "ambiguous", "sentence": "One of these two.",
    "probabilities": [{"effects": ["a"], "probability": 1}],
    "then": {"file": "again.csv"},
    "next_experiment": {"snippet": "  - name: next\n", "expected_power": 0.8, "considered": [
      {"in_words": "oedometric <one>", "forecast": {"decides": 0.8, "told_apart_bits": 0.75}},
      {"in_words": "low again", "forecast": {"decides": 0.25, "told_apart_bits": 0.125}},
      {"in_words": "not run", "forecast": null}]}})json");
  ASSERT_TRUE(diagnosis.ok()) << diagnosis.status();
  EXPECT_EQ(diagnosis->then_file, "again.csv");
  Story story;
  story.known = true;
  story.diagnoses = {*diagnosis};
  const std::string html = RenderReport(view, story);
  EXPECT_THAT(html, HasSubstr("oedometric &lt;one&gt;</td><td>80 %</td><td>0.75</td>"));
  EXPECT_THAT(html, HasSubstr("low again</td><td>25 %</td><td>0.12</td>"));
  EXPECT_THAT(html, Not(HasSubstr("not run")));
  EXPECT_THAT(html, HasSubstr("<pre>  - name: next"));
}

TEST(StoredDiagnosis, AnotherDocumentIsRefused) {
  for (const char* text : {"", "{", "[]", "{}", R"({"campaign": 3, "verdict": "adequate"})"}) {
    EXPECT_FALSE(ReadDiagnosis(text).ok()) << text;
    EXPECT_FALSE(ReadImprovement(text).ok()) << text;
  }
  const auto improvement = ReadImprovement(R"json({
    "steps": [{"campaign": "c1", "verdict": "ambiguous", "left_out_error": null}, {"campaign": null},
              4, {"campaign": "c9", "left_out_error": 0.8, "reason": "It is needed."}],
    "verdict_digest": "5f1e", "opened_before": ["ab", "cd"]})json");
  ASSERT_TRUE(improvement.ok());
  ASSERT_EQ(improvement->steps.size(), 2U);
  EXPECT_EQ(improvement->steps[0].verdict, "ambiguous");
  EXPECT_FALSE(improvement->steps[0].left_out_error.has_value());
  EXPECT_EQ(improvement->steps[1].campaign, "c9");
  EXPECT_EQ(improvement->steps[1].left_out_error, 0.8);
  EXPECT_EQ(improvement->steps[1].reason, "It is needed.");
  EXPECT_EQ(improvement->verdict_digest, "5f1e");
  EXPECT_EQ(improvement->opened_before, (std::vector<std::string>{"ab", "cd"}));
}

TEST(Report, ACampaignWithoutAnIterationSaysSo) {
  CampaignView view = testing::ExampleView("young");
  view.posterior = v1::Posterior();
  view.iterations.clear();
  for (v1::Sample& sample : view.samples) sample.set_weight(std::nan(""));
  EXPECT_THAT(RenderReport(view), HasSubstr("No iteration is complete yet"));
}

// tmcmc takes a hundred steps and more: the page showed a row of each.
TEST(Report, ATableOfIterationsKeepsTheFirstAndTheLastOfMany) {
  CampaignView view = testing::ExampleView("sand");
  const v1::Posterior last = view.posterior;
  view.iterations.assign(111, last);
  for (int k = 0; k < 111; ++k) {
    view.iterations[static_cast<std::size_t>(k)].set_iteration(k);
    if (k < 110) view.iterations[static_cast<std::size_t>(k)].set_log_evidence(std::nan(""));
  }
  const std::string html = RenderReport(view);
  const std::string table = html.substr(html.find("<th>after iteration</th>"));
  std::vector<std::string> rows;
  const std::regex row("<tr><td>([0-9]+)</td>");
  const std::string until = table.substr(0, table.find("</table>"));
  for (std::sregex_iterator at(until.begin(), until.end(), row), end; at != end; ++at) {
    rows.push_back((*at)[1]);
  }
  ASSERT_EQ(rows.size(), 20U);
  EXPECT_EQ(rows.front(), "1");
  EXPECT_EQ(rows.back(), "111");
  EXPECT_THAT(until, Not(HasSubstr("– ±")));
}

TEST(Html, EscapesMarkupAndRepairsText) {
  EXPECT_EQ(Escape("a<b>&\"'"), "a&lt;b&gt;&amp;&quot;&#39;");
  EXPECT_EQ(Escape("\x01\x7f"), "");
  EXPECT_EQ(Escape("µ \xff"), "µ \xEF\xBF\xBD");
}

}  // namespace
}  // namespace calib::report
