#pragma once
// Sizes of the stages of a design, when each ends, and how strong effects are made: one table.

namespace calib::diagnosis {

/// How strong an effect may be, in units (strength 1 is seen with lambda = 21): from low to high to
/// either side.
struct StrengthWidth {
  double low = 0.4, high = 17;
};
/// Priors under which names are asked for, the reference first: lambda from 4 to 1000 and beyond
/// where effects saturate; half as far to both sides; twice as far.
inline constexpr StrengthWidth kStrengthWidths[] = {{0.4, 17}, {0.8, 8.5}, {0.2, 34}};

/// A run is one parameter set through all fitted tests.
struct DesignCaps {
  /// Of each entry of the race: at its two catalogue steps, of two-sided ones one to each side.
  int scout_runs = 2;
  /// Once more, where fewer came to their ends, at this part of the strength: as the screen did.
  double weaker = 0.1;
  /// Main: 16 uses of an entry, three entries in a run (the prototype's 96 runs of four of 16
  /// entries had 24); within bounds that hold all stages together below 160 runs for 17 entries.
  int uses_of_entry = 16, entries_of_run = 3, main_least = 24, main_most = 80;
  /// Of the base parameters of main runs: spread over the whole box, the rest over the tempered
  /// posterior. Chosen: where a model that lacks an effect has bent them lies outside the latter.
  double spread_share = 0.3;
  /// Strengths of main runs: as the reference prior has them.
  StrengthWidth strengths = kStrengthWidths[0];
  /// Sequential batches end when no probability has moved by more than `moved`, or when a batch is
  /// expected to tell less than a move from 0.5 by that does: 0.02 nats.
  ///                                         [relative entropy: Kullback & Leibler 1951, Eq. 2.4]
  int sequential_runs = 6, sequential_batches = 3;
  double moved = 0.1, told = 0.02;
  /// Verification: fresh runs at the optimum of what would be named and of its siblings; the mean
  /// of six is known to 0.4 of a run's scatter.
  int verification_runs = 6, verified_models = 4;
  double sibling = 0.01;  ///< probability of a model that is verified too, of another family
  double asked = 0.01;    ///< probability of a model whose misfit is asked for
  /// Triples are asked for that have a pair of such a probability: below it none of them could come
  /// into a set of 95 % by its prior alone. So many: their evidences take a tenth of the pairs'.
  double leading_pair = 0.05;
  int triples = 12;
};
inline constexpr DesignCaps kDesignCaps{};

}  // namespace calib::diagnosis
