#include "server/methods/registry.h"

#include "server/methods/adaptive_emulator/adaptive_emulator.h"
#include "server/methods/design/design.h"
#include "server/methods/iterative_bayesian_filter/iterative_bayesian_filter.h"
#include "server/methods/sqmc/sqmc.h"
#include "server/methods/surrogate_msrs/surrogate_msrs.h"
#include "server/methods/table/table.h"
#include "server/methods/tmcmc/tmcmc.h"

namespace calib::methods {

const campaign::MethodList& All() {
  static const campaign::MethodList all({
      // The first is that of files that name none. One more: a line here.
      MakeIterativeBayesianFilter(),
      MakeSqmc(),
      MakeTmcmc(),
      MakeSurrogateMsrs(),
      MakeAdaptiveEmulator(),
      MakeTable(),
      MakeDesign(),
  });
  return all;
}

}  // namespace calib::methods
