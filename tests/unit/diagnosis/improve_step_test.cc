// Which models are calibrated next, why, and what speaks against one.
#include "server/diagnosis/improve_step.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace calib::diagnosis {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

using Names = std::vector<std::string>;

// Models by probability; those that hold 95 % are the first seven.
Answer AnswerWith(AnswerVerdict verdict) {
  Answer answer{.verdict = verdict};
  answer.probabilities = {{.effects = {"a", "b"}, .probability = 0.3},
                          {.effects = {}, .probability = 0.2},
                          {.effects = {"a"}, .probability = 0.15},
                          {.effects = {"b"}, .probability = 0.12},
                          {.effects = {}, .none_of_these = true, .probability = 0.1},
                          {.effects = {"c"}, .probability = 0.05},
                          {.effects = {"d"}, .probability = 0.04},
                          {.effects = {"e"}, .probability = 0.04}};
  return answer;
}

std::vector<Names> Tried(const Answer& answer, int most) {
  std::vector<Names> effects;
  for (const NamedModel* model : ModelsToTry(answer, most)) effects.push_back(model->effects);
  return effects;
}

TEST(ImproveStep, TheNamedModelIsTriedAlone) {
  Answer answer = AnswerWith(AnswerVerdict::kMissingEffect);
  answer.effects = {"b", "a"};  // most probable effect first: not the order of the model
  EXPECT_THAT(Tried(answer, 3), ElementsAre(Names({"a", "b"})));
  EXPECT_THAT(Tried(answer, 1), IsEmpty()) << "half of what is named is another model";
  answer.effects = {"c"};
  EXPECT_THAT(Tried(answer, 1), ElementsAre(Names({"c"})));
  EXPECT_EQ(WhyNext(answer, *ModelsToTry(answer, 1)[0]), "c is named and added.");
  answer.effects = {"a", "b"};
  EXPECT_EQ(WhyNext(answer, answer.probabilities[0]), "a and b are named and added.");
}

TEST(ImproveStep, TheThreeFirstOfACredibleSetAreTried) {
  Answer answer = AnswerWith(AnswerVerdict::kAmbiguous);
  EXPECT_THAT(Tried(answer, 2), ElementsAre(Names({"a", "b"}), Names({"a"}), Names({"b"})));
  EXPECT_THAT(Tried(answer, 1), ElementsAre(Names({"a"}), Names({"b"}), Names({"c"})));
  EXPECT_THAT(Tried(answer, 0), IsEmpty());
  EXPECT_EQ(WhyNext(answer, answer.probabilities[2]),
            "a is added, of what these tests do not tell apart (probability 15 %).");
}

TEST(ImproveStep, WhoIsNotInTheSetIsNotTried) {
  Answer answer = AnswerWith(AnswerVerdict::kAmbiguous);
  answer.probabilities = {{.effects = {}, .probability = 0.9},
                          {.effects = {"d"}, .probability = 0.06},
                          {.effects = {"e"}, .probability = 0.04}};
  EXPECT_THAT(Tried(answer, 3), ElementsAre(Names({"d"})));
}

TEST(ImproveStep, WhereNothingExplainsTheMostProbableIsTriedWhateverItsProbability) {
  Answer answer = AnswerWith(AnswerVerdict::kUnexplained);
  EXPECT_THAT(Tried(answer, 3), ElementsAre(Names({"a", "b"})));
  EXPECT_THAT(Tried(answer, 1), ElementsAre(Names({"a"})));
  EXPECT_EQ(WhyNext(answer, answer.probabilities[0]),
            "a and b are added, the most probable of what does not explain all (30 %).");
  answer.probabilities = {{.none_of_these = true, .probability = 0.98},
                          {.effects = {}, .probability = 0.01},
                          {.effects = {"c"}, .probability = 0.01}};
  EXPECT_THAT(Tried(answer, 3), ElementsAre(Names({"c"})));
  answer.probabilities.pop_back();
  EXPECT_THAT(Tried(answer, 3), IsEmpty());
}

TEST(ImproveStep, AModelThatComesNoCloserIsNoStep) {
  const CalibratedModel without{.rms_error = 2, .has_posterior = true, .log_evidence = 0};
  EXPECT_EQ(WhyNoStep(without, {.rms_error = 1, .has_posterior = true, .log_evidence = 5}), "");
  EXPECT_EQ(WhyNoStep(without, {.rms_error = 2.5, .has_posterior = true, .log_evidence = 50}),
            "it comes no closer, 2.5 sd, 2 without it");
  EXPECT_THAT(WhyNoStep(without, {.rms_error = 2.5, .has_posterior = false}),
              HasSubstr("it has no posterior and it"));
  EXPECT_NE(WhyNoStep(without, {.rms_error = std::numeric_limits<double>::quiet_NaN(),
                                .has_posterior = true}),
            "");
}

TEST(ImproveStep, EvidenceAgainstItOutweighsAFitThatIsALittleCloser) {
  const CalibratedModel without{
      .rms_error = 1.1, .has_posterior = true, .log_evidence = 100, .log_evidence_se = 0.3};
  CalibratedModel with{
      .rms_error = 1.0, .has_posterior = true, .log_evidence = 96, .log_evidence_se = 0.4};
  EXPECT_THAT(WhyNoStep(without, with), HasSubstr("the evidence is against it, by 4 ± 0.5"));
  with.log_evidence = 99.5;  // within two standard errors
  EXPECT_EQ(WhyNoStep(without, with), "");
  with.log_evidence = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(WhyNoStep(without, with), "");
  with = {.rms_error = 1.0, .has_posterior = false, .log_evidence = -1e3};
  EXPECT_EQ(WhyNoStep(without, with), "") << "an evidence without a posterior is none";
}

}  // namespace
}  // namespace calib::diagnosis
