#!/usr/bin/env python3
"""Copies sources of the scheduler with faults in them that a simulation can switch on.
usage: plant.py ROOT FROM TO   writes TO, a copy of ROOT/FROM with its faults; exit 1 where a place is not there any more.
"""
import os
import sys

# (fault, file of server/scheduler, the place, what stands there then); the fault is asked for by IsPlanted.
PLACES = [
    ('stale_states', 'scheduler_runs.cc',
     '''  if (!leases_.Named(batch.attempt(), worker.hello.name(), ports_.Now())) {
    Refuse(session, batch.attempt());
    return std::nullopt;
  }
  const EvaluationKey key = leases_.Find(batch.attempt(), worker.hello.name())->key;''',
     '''  const bool is_held = leases_.Named(batch.attempt(), worker.hello.name(), ports_.Now());
  if (IsPlanted("stale_states")) {
    if (is_held) {
      const EvaluationKey held = leases_.Find(batch.attempt(), worker.hello.name())->key;
      simulation::granted[batch.attempt()] = {held.campaign, held.sample, held.experiment};
    } else if (const auto found = simulation::granted.find(batch.attempt());
               found != simulation::granted.end() && FindRun(found->second[0]) != nullptr) {
      TakenStates stale{.campaign = found->second[0]};
      for (const v1::State& state : batch.states()) {
        stale.records.push_back({.key = {found->second[0], static_cast<int>(found->second[1]), static_cast<int>(found->second[2])},
                                 .load_step = state.load_step(),
                                 .observables = {state.values().begin(), state.values().end()}});
      }
      stale.ack.set_attempt(batch.attempt());
      stale.ack.set_up_to(batch.first() + batch.states_size());
      return stale;
    }
  }
  if (!is_held) {
    Refuse(session, batch.attempt());
    return std::nullopt;
  }
  const EvaluationKey key = leases_.Find(batch.attempt(), worker.hello.name())->key;'''),
    ('counted_twice', 'scheduler_runs.cc',
     '''  taken.ack.set_up_to(batch.first() + batch.states_size());''',
     '''  taken.ack.set_up_to(batch.first() + batch.states_size());
  if (IsPlanted("counted_twice")) {
    taken.ack.set_up_to(simulation::counted[batch.attempt()] += batch.states_size());
  }'''),
    ('end_without_states', 'scheduler_runs.cc',
     '''      if (missing == 0) {''',
     '''      if (missing == 0 || (IsPlanted("end_without_states") && !run.Find(lease.key)->rest_after)) {'''),
    ('no_give_back', 'scheduler_runs.cc',
     '''  SetStatus(*run, lease.key, status, failures);
  const store::Store::Job end = [key = lease.key, status, failures, now''',
     '''  if (!IsPlanted("no_give_back") || outcome != AttemptOutcome::kLost) SetStatus(*run, lease.key, status, failures);
  const store::Store::Job end = [key = lease.key, status, failures, now'''),
    ('two_leases', 'scheduler_leasing.cc',
     '''  Changed(key.campaign);
  WorkersChanged();
  if (run.state() == CampaignState::kQueued) {''',
     '''  if (IsPlanted("two_leases") && attempt % 16 == 0) waiting_.Put(key, run.Find(key)->held_in);
  Changed(key.campaign);
  WorkersChanged();
  if (run.state() == CampaignState::kQueued) {'''),
    ('refusal_unsent', 'scheduler_links.cc',
     '''  if (ending_.count(attempt) > 0) {
    return;  // the acknowledgement follows''',
     '''  if (ending_.count(attempt) > 0 || IsPlanted("refusal_unsent")) {
    return;  // the acknowledgement follows'''),
    ('batch_by_arrival', 'scheduler_plans.cc',
     '''  store::CampaignProgress& progress = run->progress();
  progress.phase = plan.phase;''',
     '''  if (IsPlanted("batch_by_arrival") && plan.start.has_value() && plan.start->iteration > 0) {
    auto& samples = plan.start->samples;
    const auto by = last_attempt_ % static_cast<std::int64_t>(std::max<std::size_t>(1, samples.size()));
    for (std::int64_t i = 0; i < by; ++i) {
      for (std::size_t k = 1; k < samples.size(); ++k) std::swap(samples[k].parameters, samples[k - 1].parameters);
    }
  }
  store::CampaignProgress& progress = run->progress();
  progress.phase = plan.phase;'''),
    ('iteration_lost', 'scheduler_commands.cc',
     '''  std::vector<EvaluationKey> again;
  std::map<EvaluationKey, std::string> others;''',
     '''  if (IsPlanted("iteration_lost")) run->progress().iteration = 0;
  std::vector<EvaluationKey> again;
  std::map<EvaluationKey, std::string> others;'''),
    ('one_renewed', 'leases/lease_table.cc',
     '''          std::max({holder.heard, leases_.at(attempt).started, pardoned_}) + lease_;''',
     '''          std::max({IsPlanted("one_renewed") && attempt != *holder.attempts.begin() ? leases_.at(attempt).started : holder.heard,
                    leases_.at(attempt).started, pardoned_}) + lease_;'''),
    ('never_expires', 'leases/lease_table.cc',
     '''  while (!looks_.empty() && looks_.begin()->first < now) {''',
     '''  while (!IsPlanted("never_expires") && !looks_.empty() && looks_.begin()->first < now) {'''),
    ('drained_leased', 'leases/worker_table.cc',
     '''  return entry.session != 0 && !entry.draining && !entry.leaving && !entry.silent;''',
     '''  return entry.session != 0 && (!entry.draining || IsPlanted("drained_leased")) && !entry.leaving && !entry.silent;'''),
]


def main():
    root, source, target = sys.argv[1:]
    with open(os.path.join(root, source), encoding='utf-8') as file:
        text = file.read()
    for fault, place, old, new in PLACES:
        if source != 'server/scheduler/' + place:
            continue
        if text.count(old) != 1:
            sys.exit(f'{source}: the place of the planted fault {fault} stands there {text.count(old)} times: mend {__file__}')
        text = text.replace(old, new)
    head = '#include "tests/simulation/faults.h"\nnamespace calib::scheduler { using simulation::IsPlanted; }\n'
    os.makedirs(os.path.dirname(target), exist_ok=True)
    with open(target, 'w', encoding='utf-8') as file:
        file.write(head + text)


if __name__ == '__main__':
    main()
