#include "server/ctl/verb_list.h"

namespace calib::ctl {

// Each is a file in verbs/: that of X defines the function XVerb. The order is that of the help.
#define CALIB_VERBS(VERB) \
  VERB(Inspect)           \
  VERB(Simulate)          \
  VERB(Run)               \
  VERB(Submit)            \
  VERB(Validate)          \
  VERB(List)              \
  VERB(Show)              \
  VERB(Lineage)           \
  VERB(Watch)             \
  VERB(Page)              \
  VERB(Posterior)         \
  VERB(Samples)           \
  VERB(States)            \
  VERB(Compare)           \
  VERB(Sensitivity)       \
  VERB(Models)            \
  VERB(Diagnose)          \
  VERB(Extend)            \
  VERB(Improve)           \
  VERB(Predict)           \
  VERB(Report)            \
  VERB(Export)            \
  VERB(Vtk)               \
  VERB(Kept)              \
  VERB(Pause)             \
  VERB(Resume)            \
  VERB(Cancel)            \
  VERB(Priority)          \
  VERB(Delete)            \
  VERB(Quota)             \
  VERB(Workers)           \
  VERB(Backup)            \
  VERB(Prune)             \
  VERB(Doctor)            \
  VERB(Drain)             \
  VERB(Scale)             \
  VERB(Effects)           \
  VERB(Tests)             \
  VERB(Contacts)          \
  VERB(Schema)            \
  VERB(New)               \
  VERB(Pack)              \
  VERB(Certs)             \
  VERB(Completion)        \
  VERB(Man)

#define CALIB_DECLARE_VERB(name) Verb name##Verb();
CALIB_VERBS(CALIB_DECLARE_VERB)

#define CALIB_CALL_VERB(name) name##Verb(),
std::vector<Verb> AllVerbs() { return {CALIB_VERBS(CALIB_CALL_VERB)}; }

}  // namespace calib::ctl
