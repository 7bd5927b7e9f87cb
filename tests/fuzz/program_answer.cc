// What a program that is the model prints. The first byte: bit 0, a persistent program; bit 1, one
// of checkpoints; bit 2, the rest is a table; the other bits, the size of the pieces in which it
// comes. '{' and '#' begin a plain answer and a table, and are part of them.
#include <cmath>

#include "tests/fuzz/fuzz_target.h"
#include "worker/program/answer_reader.h"
#include "worker/program/table_reader.h"

namespace {

using namespace calib;

constexpr int kLoadSteps = 4;
const std::vector<std::string> kObservables{"p", "q"};  // NOLINT(cert-err58-cpp)

/// All that a reader tells, in words.
template <typename Reader>
std::string Told(Reader reader, const std::string& text, std::size_t piece) {
  std::string told;
  int reached = 0;
  const auto take = [&] {
    for (const v1::State& state : reader.TakeStates()) {
      const bool joins = state.values().empty();
      fuzz::Expect(state.load_step() == (joins ? reached - 1 : reached), "states come in order");
      fuzz::Expect(joins ? !state.others().empty() : state.values_size() == 2,
                   "a state has every observable that was asked, or joins the last one");
      fuzz::Expect(state.others_size() <= 256, "a state fits into its message");
      for (const double value : state.values()) fuzz::Expect(std::isfinite(value), "finite");
      reached += joins ? 0 : 1;
      told += std::to_string(state.load_step());
      for (const double value : state.values()) told += " " + worker::NumberText(value);
      const std::map<std::string, double> others(state.others().begin(), state.others().end());
      for (const auto& [name, value] : others) {
        fuzz::Expect(std::isfinite(value) && !name.empty() && name.size() <= 256, "others");
        told += " " + name + "=" + worker::NumberText(value);
      }
      told += "\n";
    }
  };
  for (std::size_t at = 0; at < text.size(); at += piece) {
    reader.Add(std::string_view(text).substr(at, piece));
    take();
  }
  reader.EndOfInput();
  take();
  fuzz::Expect(reached == reader.states().reached() && reached <= kLoadSteps, "states are counted");
  if (reader.end().has_value()) {
    const bool complete = reader.end()->kind == worker::AnswerEnd::Kind::kComplete;
    fuzz::Expect(complete == reader.end()->reason.empty(), "an end has its reason");
    told += reader.end()->reason;
  }
  fuzz::last_was_good = reader.states().complete() && !reader.end().has_value();
  return told;
}

}  // namespace

// NOLINTNEXTLINE(readability-identifier-naming)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  fuzz::last_was_good = false;
  if (size == 0) {
    return 0;
  }
  const bool plain = data[0] == '{' || data[0] == '#';
  const unsigned how = plain ? (data[0] == '#' ? 4U : 0U) : data[0];
  const std::string text = fuzz::TextOf(data + (plain ? 0 : 1), size - (plain ? 0 : 1));
  const auto same_in_pieces = [&](const auto& reader) {
    const std::string whole = Told(reader, text, text.size() + 1);
    fuzz::Expect(Told(reader, text, 1 + (how >> 3U)) == whole, "pieces alter nothing");
  };
  if ((how & 4U) != 0) {
    v1::ProgramTable table;
    for (const std::string& name : {std::string("p"), std::string("q"), std::string("r")}) {
      v1::ProgramColumn& column = *table.add_columns();
      column.set_name(name);
      column.set_column(name);
      column.set_factor(2);
    }
    same_in_pieces(worker::TableReader(table, kObservables, kLoadSteps));
  } else {
    same_in_pieces(worker::AnswerReader({.observables = kObservables,
                                         .load_steps = kLoadSteps,
                                         .run = "1",
                                         .persistent = (how & 1U) != 0,
                                         .checkpoint = (how & 2U) != 0}));
  }
  return 0;
}
