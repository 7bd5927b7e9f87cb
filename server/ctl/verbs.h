#pragma once
// One function per verb, each in verb_<name>.cc. They print their answer and return an exit code.

#include "server/ctl/arguments.h"

namespace calib::ctl {

int Simulate(const Arguments& arguments);
int Run(const Arguments& arguments);
int Submit(const Arguments& arguments);
int Validate(const Arguments& arguments);
int List(const Arguments& arguments);
int Show(const Arguments& arguments);
int Watch(const Arguments& arguments);
int Posterior(const Arguments& arguments);
int Samples(const Arguments& arguments);
int States(const Arguments& arguments);
int Models(const Arguments& arguments);
int Sensitivity(const Arguments& arguments);
int Compare(const Arguments& arguments);
int Diagnose(const Arguments& arguments);
int Extend(const Arguments& arguments);
int Improve(const Arguments& arguments);
int Predict(const Arguments& arguments);
int Report(const Arguments& arguments);
int Export(const Arguments& arguments);
int Workers(const Arguments& arguments);
int Drain(const Arguments& arguments);
int Doctor(const Arguments& arguments);
int Effects(const Arguments& arguments);
int Tests(const Arguments& arguments);
int Contacts(const Arguments& arguments);
int Pack(const Arguments& arguments);
int Pause(const Arguments& arguments);
int Resume(const Arguments& arguments);
int Cancel(const Arguments& arguments);
int Delete(const Arguments& arguments);

}  // namespace calib::ctl
